//! Programs that are called through files.

use problem::simulator::State;

use super::*;

/// The variables and the response of the Ishigami function, with a program that computes another function and draws
/// its random effects itself.
fn through_files(template: &str, command: &str) -> (Problem, Backend, tempfile::TempDir) {
    let (before, random) = ISHIGAMI.split_once("[[random]]").unwrap();
    let (_, after) = random.split_once("\n\n").unwrap();
    of_campaign(&format!("{before}{after}"), template, command)
}

const ISHIGAMI: &str = include_str!("../../../../../../campaigns/ishigami/campaign.toml");

fn of_campaign(text: &str, template: &str, command: &str) -> (Problem, Backend, tempfile::TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("in.txt");
    std::fs::write(&path, template).unwrap();
    let problem = Problem::new(Campaign::parse("i.toml", text).unwrap());
    let exec = Exec {
        interface: Interface::Files {
            command: command.to_owned(),
            template: path,
            result: "out.txt".into(),
        },
        timeout: Duration::from_secs(10),
        environment: Vec::new(),
    };
    let backend = chosen(&problem, &exec);
    (problem, backend, folder)
}

const TEMPLATE: &str = "{x1} {x2} {x3} {seed} {other}\n";

/// `y` is the sum of the variables, plus the seed's last digit in thousandths.
const SUM: &str = "awk '{print \"# sum\\ny = \" $1+$2+$3+($4%10)/1000}' in.txt > out.txt # done";

fn sum(problem: &Problem, backend: &Backend) -> Result<(f64, [f64; 2]), String> {
    let design = Design::new(vec![1.0, 0.25, 0.5]);
    let answer = |simulator: &dyn Simulator| {
        let told = |error| match error {
            NoAnswer::Refused(reason) => format!("refused {reason}"),
            NoAnswer::Failed(why) => why,
            NoAnswer::Machine(why) => format!("machine: {why}"),
        };
        let mut prepared = simulator.prepare(&design).map_err(told)?;
        let baseline = prepared.analyse(State::Baseline).map_err(told)?.value;
        let sample = |number| {
            let mut rng = stats::streams::stream(1, stats::streams::Purpose::Wear, 0, number);
            Ok::<f64, String>(prepared.sample(&mut rng).map_err(told)?[0])
        };
        let [first, second] = [0, 1].map(sample);
        Ok((baseline, [first?, second?]))
    };
    backend.with(problem, answer).0
}

#[test]
fn a_program_is_asked_through_files() {
    let (problem, backend, _folder) = through_files(TEMPLATE, SUM);
    let (baseline, samples) = sum(&problem, &backend).unwrap();
    assert_eq!(baseline, 1.75, "the seed of the baseline is 0");
    assert!(
        samples.iter().all(|y| (1.75..1.76).contains(y)),
        "{samples:?}"
    );
    assert_eq!(sum(&problem, &backend).unwrap(), (baseline, samples));
    // The command knows the worker's folder.
    let here = format!(
        "test \"$OLDPWD\" = '{}' && {SUM}",
        std::env::current_dir().unwrap().display()
    );
    let (problem, backend, _folder) = through_files(TEMPLATE, &here);
    assert_eq!(sum(&problem, &backend).unwrap().0, 1.75);
}

/// The offset is normal with a standard deviation of 0.5: the command gets its value, and no seed.
#[test]
fn random_inputs_that_the_campaign_states_are_filled_in() {
    let command = "awk '{printf \"y = %.17g\", $1+$2+$3+$4}' in.txt > out.txt";
    let (problem, backend, _folder) = of_campaign(ISHIGAMI, "{x1} {x2} {x3} {offset}\n", command);
    let (baseline, samples) = sum(&problem, &backend).unwrap();
    assert_eq!(baseline, 1.75, "the mean of the offset is 0");
    let scores = |number| {
        let mut rng = stats::streams::stream(1, stats::streams::Purpose::Wear, 0, number);
        stats::normal_scores(&mut rng, 1)[0]
    };
    assert_eq!(samples, [0, 1].map(|number| 1.75 + 0.5 * scores(number)));
    let (problem, backend, _folder) = of_campaign(ISHIGAMI, "{x1} {x2} {x3} {seed}\n", command);
    let error = sum(&problem, &backend).unwrap_err();
    assert!(error.contains("in.txt has no {offset}"), "{error}");
    // At a design where the standard deviation is negative nothing is run.
    let text = ISHIGAMI.replace("sd = 0.5 ", "sd = \"x1 - 3\" ");
    let (problem, backend, _folder) = of_campaign(&text, "{x1} {x2} {x3} {offset}\n", command);
    let error = sum(&problem, &backend).unwrap_err();
    let expected =
        "refused random-input: offset has no distribution with mean = 0, sd = -2: it needs sd ≥ 0";
    assert_eq!(error, expected);
}

#[test]
fn a_result_file_for_people_is_read_by_its_lines() {
    let read = "\n[simulator.read]\ny = { line = '^ *sum of three', column = 5 }\n";
    // Two iterations, of which the last counts, in Latin-1.
    let command = "awk '{printf \"Gr\\366\\337e\\n sum of three  = 0.0\\n sum of three  = %.4fD0 mm\\n\", $1+$2+$3+$4}' in.txt > out.txt";
    let text = format!("{ISHIGAMI}{read}");
    let (problem, backend, _folder) = of_campaign(&text, "{x1} {x2} {x3} {offset}\n", command);
    assert_eq!(sum(&problem, &backend).unwrap().0, 1.75);
    let silent = command.replace("sum of", "total of");
    let (problem, backend, _folder) = of_campaign(&text, "{x1} {x2} {x3} {offset}\n", &silent);
    let error = sum(&problem, &backend).unwrap_err();
    assert!(
        error.contains("out.txt has no line that matches"),
        "{error}"
    );
}

#[test]
fn a_program_knows_the_number_of_its_slot() {
    let command = "echo \"y = $CAMPAIGN_SLOT\" > out.txt";
    let (problem, backend, _folder) = of_campaign(ISHIGAMI, "{x1} {x2} {x3} {offset}\n", command);
    let of_other = backend.with(&problem, |other: &dyn Simulator| {
        let design = Design::new(vec![1.0, 0.25, 0.5]);
        let mut held = other.prepare(&design).unwrap();
        let first = held.analyse(State::Baseline).unwrap().value;
        (first, sum(&problem, &backend).unwrap().0)
    });
    assert_eq!(of_other.0, (0.0, 1.0));
    // Both are kept, and the one that was used last is asked again.
    assert_eq!(sum(&problem, &backend).unwrap().0, 0.0);
}

#[test]
fn what_goes_wrong_with_files_is_told_with_the_folder_that_is_kept() {
    for (template, command, says, keeps) in [
        (
            "{x1} {x2} {seed}",
            SUM,
            "in.txt has no {x3}, the place of a variable",
            false,
        ),
        (
            "{x1} {x2} {x3}",
            SUM,
            "has no {seed}, the place of a sample's seed",
            false,
        ),
        (
            TEMPLATE,
            "echo no licence; exit 3",
            "ended with status 3",
            true,
        ),
        (
            TEMPLATE,
            "true",
            "the command has left no readable out.txt",
            true,
        ),
        (
            TEMPLATE,
            "echo z = 1 > out.txt",
            "out.txt has no \"y\"; it has: z",
            true,
        ),
        (
            TEMPLATE,
            "echo y = much > out.txt",
            "out.txt, line 1: \"y = much\" is not of the form",
            true,
        ),
        (
            TEMPLATE,
            "echo hello > out.txt",
            "out.txt, line 1: \"hello\" is not of the form",
            true,
        ),
        (
            TEMPLATE,
            "echo refused = no > out.txt",
            "a short name",
            false,
        ),
        (TEMPLATE, "sleep 60", "did not end within 0.3 s", true),
    ] {
        let (problem, mut backend, _folder) = through_files(template, command);
        if let Backend::External(programs) = &mut backend {
            let is_slow = command == "sleep 60";
            programs.exec.timeout = Duration::from_millis(if is_slow { 300 } else { 60_000 });
        }
        let error = sum(&problem, &backend).unwrap_err();
        assert!(error.contains(says), "{says}: {error}");
        assert_eq!(error.contains("are kept in"), keeps, "{error}");
        if keeps {
            let (_, folder) = error.split_once("are kept in ").unwrap();
            let folder = std::path::Path::new(folder);
            let filled = std::fs::read_to_string(folder.join("in.txt")).unwrap();
            assert_eq!(filled, "1.0 0.25 0.5 0 {other}\n");
            std::fs::remove_dir_all(folder).unwrap();
        }
        assert!(
            !command.contains("licence") || error.contains("no licence"),
            "{error}"
        );
    }
    let refuse = "echo refused = too-thin: it buckles > out.txt";
    let (problem, backend, _folder) = through_files(TEMPLATE, refuse);
    let error = sum(&problem, &backend).unwrap_err();
    assert_eq!(error, "refused too-thin: it buckles");
}

/// The status of a command that had ended before it was waited for was skipped as a stale line.
#[test]
fn a_command_may_end_before_it_is_waited_for() {
    let stop = Arc::new(AtomicBool::new(false));
    let mut process = process::Process::start("echo 0", &[], stop).unwrap();
    eventually("its end", || process.has_ended());
    let read = |line: &[u8]| output::Line::Answer(line.to_vec(), true);
    let status = process.ask("", Duration::from_secs(5), &read);
    assert_eq!(status, Ok(b"0".to_vec()));
}

/// The folder that an error names.
fn kept(error: &str) -> std::path::PathBuf {
    let (_, folder) = error.split_once("are kept in ").expect(error);
    folder.into()
}

#[test]
fn a_worker_keeps_the_folders_of_its_last_failed_runs() {
    let (problem, backend, _folder) = through_files(TEMPLATE, "exit 3");
    let failed = || kept(&sum(&problem, &backend).unwrap_err());
    let folders: Vec<_> = (0..23).map(|_| failed()).collect();
    let remain = folders.iter().map(|folder| folder.exists());
    let expected = (0..23).map(|run| run >= 3);
    assert!(remain.eq(expected), "{folders:?}");
    for folder in &folders[3..] {
        std::fs::remove_dir_all(folder).unwrap();
    }
}

#[test]
fn a_command_that_is_missing_is_the_fault_of_the_machine_until_it_has_answered() {
    let (problem, backend, _folder) = through_files(TEMPLATE, "/no/such/solver");
    let error = sum(&problem, &backend).unwrap_err();
    assert!(
        error.starts_with("machine: the simulator ended with status 127: "),
        "{error}"
    );
    assert!(
        error.contains("/no/such/solver")
            && error.ends_with("or correct --exec or simulator.command"),
        "{error}"
    );

    // The first run answers, and the second one does not find a part of the program.
    let folder = tempfile::tempdir().unwrap();
    let flag = folder.path().join("answered");
    let flag = flag.display();
    let command = format!("[ -e '{flag}' ] && exit 127; : > '{flag}'; {SUM}");
    let (problem, backend, _folder) = through_files(TEMPLATE, &command);
    let error = sum(&problem, &backend).unwrap_err();
    assert!(
        error.starts_with("the simulator ended with status 127\n"),
        "{error}"
    );
    std::fs::remove_dir_all(kept(&error)).unwrap();
}

#[test]
fn a_template_that_cannot_be_read_is_the_fault_of_the_machine() {
    let (problem, backend, folder) = through_files(TEMPLATE, SUM);
    drop(folder);
    let error = sum(&problem, &backend).unwrap_err();
    assert!(
        error.starts_with("machine: template ") && error.contains("No such file"),
        "{error}"
    );
}
