//! Correct and faulty external simulators.

use std::ops::Range;
use std::sync::atomic::AtomicU32;

use ledger::{Generation, StreamId, Unit};
use problem::Campaign;
use problem::task::{Output, Run, Source, compute, compute_until};

use super::*;
use crate::exit::HasExitCode as _;

mod ends;
mod faults;
mod other_output;
mod through_files;
mod trials;

/// A simulator as a shell script, which answers each kind of request by a function.
const PREAMBLE: &str = r#"
answer() { printf '{"id":%s,%s}\n' "$id" "$1"; }
on_describe() { answer '"protocol":2,"version":"test"'; }
geometry='"contact_ratio":1.6,"specific_sliding":1.5,"root_stress_mpa":700,"clearance_p_mm":0.5,"clearance_r_mm":0.5,"flank_margin_p_mm":0.1,"flank_margin_r_mm":0.1'
# Only the analysis with wear asks for the pressure on worn flanks.
on_evaluate() { case $line in *worn*) on_archard;; *) on_unworn;; esac; }
on_unworn() { answer "$geometry,\"delta_ste_um\":0.5,\"hertz_pressure_mpa\":1200"; }
on_archard() { answer "$geometry,\"delta_ste_archard_um\":0.75,\"hertz_pressure_worn_mpa\":1300.5"; }
# The first word of the seed, as thousandths of its lowest digits.
on_sample() {
    word=${line##*'"seed":['}; word=${word%%,*}
    answer "\"delta_ste_um\":1.$(printf %03d $((word % 1000)))"
}
"#;
const LOOP: &str = r#"
while read -r line; do
    id=${line#*'"id":'}; id=${id%%[,\}]*}
    name=${line#*'"request":"'}; name=${name%%'"'*}
    "on_$name"
done
"#;

fn problem() -> Problem {
    let text = Campaign::PAPER.replace("compare_with_paper = true", "compare_with_paper = false")
        + "\n[simulator]\nkind = \"external\"\nprobe_designs = 1\n";
    Problem::new(Campaign::parse("external.toml", &text).unwrap())
}

fn backend_of(command: String, timeout: Duration) -> Backend {
    let exec = Exec {
        interface: Interface::Lines(command),
        timeout,
        environment: Vec::new(),
    };
    chosen(&problem(), &exec)
}

/// The backend of a machine that is tried again at once.
fn chosen(problem: &Problem, exec: &Exec) -> Backend {
    const QUICK: [Duration; 3] = [Duration::from_millis(1); 3];
    let mut backend = Backend::choose(problem, Some(exec), watch::Sender::default()).unwrap();
    if let Backend::External(programs) = &mut backend {
        programs.pauses = &QUICK;
    }
    backend
}

/// A backend whose script has `changes` to the functions above.
fn backend(changes: &str) -> Backend {
    backend_of(
        format!("{PREAMBLE}\n{changes}\n{LOOP}"),
        Duration::from_secs(60),
    )
}

const X: [f64; 6] = [0.25, 1.37, 1.37, 0.85, 1.31, 0.80];

const THREE: Range<u32> = 0..3;

/// Samples of the first design.
fn unit(samples: Range<u32>) -> Unit {
    Unit {
        stream: StreamId::design(0),
        generation: Generation::default(),
        samples,
    }
}

fn source() -> Source {
    let problem = problem();
    Source::Design(problem.design(&X, problem.base()))
}

fn run(backend: &Backend, samples: Range<u32>) -> Result<Output, String> {
    let compute = |simulator: &dyn Simulator| compute(simulator, &unit(samples), &source());
    backend.with(&problem(), compute).0
}

fn values(output: &Output) -> Vec<f64> {
    match output {
        Output::Design { samples, .. } => samples.values().to_vec(),
        other => panic!("no samples: {other:?}"),
    }
}

/// Processes whose command line holds `mark`.
fn processes(mark: &str) -> usize {
    std::fs::read_dir("/proc")
        .unwrap()
        .filter_map(Result::ok)
        .filter_map(|entry| std::fs::read(entry.path().join("cmdline")).ok())
        .filter(|line| String::from_utf8_lossy(line).contains(mark))
        .count()
}

fn eventually(what: &str, holds: impl Fn() -> bool) {
    let since = Instant::now();
    while !holds() {
        assert!(
            since.elapsed() < Duration::from_secs(20),
            "waiting for {what}"
        );
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// A text that no other test's command line holds.
fn mark() -> String {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    let next = NEXT.fetch_add(1, Ordering::Relaxed);
    format!("external-{}-{next}-", std::process::id())
}

#[test]
fn answers_become_results_and_one_process_gives_them_all() {
    let backend = backend("echo started >&2");
    let result = run(&backend, THREE).unwrap();
    let Output::Design {
        responses, samples, ..
    } = &result
    else {
        panic!("a simulated design")
    };
    let named = |name| {
        let problem = problem();
        let place = problem.responses().iter().position(|r| r.name == name);
        responses[place.unwrap()]
    };
    for (name, value) in [
        ("contact_ratio", 1.6),
        ("hertz_pressure_mpa", 1200.0),
        ("hertz_pressure_worn_mpa", 1300.5),
        ("delta_ste_um", 0.5),
        ("delta_ste_archard_um", 0.75),
    ] {
        assert_eq!(named(name), value, "{name}");
    }
    assert_eq!(samples.len(), 3);
    assert_ne!(
        samples.get(0),
        samples.get(1),
        "every sample has a seed of its own"
    );
    // A repetition gives the same numbers, and so does a part.
    assert_eq!(run(&backend, THREE).unwrap(), result);
    let part = run(&backend, 2..3).unwrap();
    assert_eq!(values(&part), samples.values()[2..]);
    let Backend::External(programs) = &backend else {
        panic!("an external backend")
    };
    assert_eq!(programs.idle().len(), 1, "one process served every job");
}

#[test]
fn the_digest_tells_programs_apart() {
    let digest = |changes| backend(changes).model_digest(&problem(), 2).unwrap();
    let usual = digest("");
    assert_eq!(usual, digest(""));
    // However many programs answer at the same time.
    for slots in [1, 16] {
        let digest = backend("").model_digest(&problem(), slots);
        assert_eq!(usual, digest.unwrap());
    }
    assert_ne!(
        usual,
        digest(
            r#"on_archard() { answer '"delta_ste_archard_um":0.76,"hertz_pressure_worn_mpa":1300.5'; }"#
        )
    );
    assert_ne!(
        usual,
        digest(r#"on_describe() { answer '"protocol":2,"version":"other"'; }"#)
    );
    let error = backend("on_describe() { answer '\"protocol\":1'; }")
        .model_digest(&problem(), 2)
        .unwrap_err()
        .to_string();
    assert!(error.contains("uses protocol 1"), "{error}");
}

#[test]
fn a_refused_design_is_a_result_and_a_refused_sample_is_infinitely_bad() {
    let refusing = "on_unworn() { answer '\"refused\":\"contact-gap: the teeth lose contact\"'; }";
    let reason = "contact-gap: the teeth lose contact".to_owned();
    assert_eq!(run(&backend(refusing), THREE), Ok(Output::Refused(reason)));
    let refusing = "on_sample() { answer '\"refused\":\"contact-gap: not now\"'; }";
    let Ok(Output::Design { samples, .. }) = run(&backend(refusing), THREE) else {
        panic!("the refused samples are a result");
    };
    assert_eq!(samples.values(), [f64::INFINITY; 3]);
}

#[test]
fn a_failure_names_design_sample_status_request_and_standard_error() {
    // Fails on the third sample.
    let ending = r#"
        n=0
        on_sample() {
            n=$((n + 1))
            [ $n -lt 3 ] || { echo 'out of licences' >&2; exit 3; }
            answer '"delta_ste_um":1'
        }"#;
    let error = run(&backend(ending), THREE).unwrap_err();
    for part in [
        "design-0, sample 2: the simulator ended (exit status: 3) before it had answered",
        "\"request\":\"sample\"",
        "out of licences",
    ] {
        assert!(error.contains(part), "no {part:?} in: {error}");
    }
}

#[test]
fn a_process_that_crashed_is_replaced() {
    let once = mark();
    let file = std::env::temp_dir().join(&once);
    let crashing = format!(
        "on_sample() {{ [ -e {file} ] || {{ : > {file}; kill -9 $$; }}; answer '\"delta_ste_um\":1'; }}",
        file = file.display()
    );
    let backend = backend(&crashing);
    let error = run(&backend, THREE).unwrap_err();
    assert!(error.contains("signal: 9"), "{error}");
    assert_eq!(values(&run(&backend, THREE).unwrap()), [1.0; 3]);
    std::fs::remove_file(file).unwrap();
}

#[test]
fn a_process_that_ended_between_jobs_fails_none() {
    // The process ends by itself after the third sample, between two requests.
    let ending = r#"
        n=0
        on_sample() { n=$((n + 1)); answer '"delta_ste_um":1'; [ $n -lt 3 ] || exit 0; }"#;
    let backend = backend(ending);
    for _ in 0..2 {
        assert_eq!(values(&run(&backend, THREE).unwrap()), [1.0; 3]);
        let Backend::External(programs) = &backend else {
            panic!("an external backend")
        };
        eventually("its end", || programs.idle().iter().all(Program::has_ended));
    }
}

#[test]
fn what_hangs_is_killed_with_everything_it_started() {
    let mark = mark();
    let hanging = format!(
        "{PREAMBLE}\non_sample() {{ echo 'still thinking' >&2; sh -c 'sleep 600; : {mark}' & wait; }}\n{LOOP}"
    );
    let backend = backend_of(hanging, Duration::from_millis(300));
    let error = run(&backend, THREE).unwrap_err();
    assert!(
        error.contains("gave no answer within 0.3 s and was ended"),
        "{error}"
    );
    assert!(error.contains("still thinking"), "{error}");
    eventually("the processes' end", || processes(&mark) == 0);
}

#[test]
fn malformed_answers_end_the_process_and_are_quoted() {
    for (malformed, why) in [
        (
            "answer '\"delta_ste_um\":0,1'",
            "malformed answer (it is not JSON: ",
        ),
        (
            "id=99; answer '\"delta_ste_um\":1'",
            "it answers request 99 instead of 4",
        ),
        (
            "answer '\"depth\":1'",
            "malformed answer (it has no \"delta_ste_um\", which was asked for): {\"depth\":1}",
        ),
        (
            "printf '{\"id\":'; exit 3",
            "ended (exit status: 3) before it had answered in the middle of the line {\"id\":",
        ),
        (
            "exec >&-; sleep 600",
            "closed its standard output and was ended",
        ),
        (
            "answer '\"error\":\"no licence\"'",
            "the simulator says: no licence",
        ),
    ] {
        let changes = format!("on_sample() {{ {malformed}; }}");
        let error = run(&backend(&changes), THREE).unwrap_err();
        assert!(error.contains(why), "{malformed}: {error}");
        assert!(error.starts_with("design-0, sample "), "{error}");
    }
}

#[test]
fn slow_writers_of_partial_lines_are_waited_for() {
    let slow = r#"on_sample() {
        printf '{"id":%s,' "$id"; sleep 0.05; printf '"delta_ste_um":'; sleep 0.05; printf '2.5}\n'
    }"#;
    assert_eq!(values(&run(&backend(slow), THREE).unwrap()), [2.5; 3]);
}

#[test]
fn a_flood_of_standard_error_blocks_nothing_and_its_end_is_kept() {
    let flooding = r#"
        n=0
        on_sample() {
            n=$((n + 1))
            awk 'BEGIN { for (i = 0; i < 40000; i++) print "a line of no interest " i }' >&2
            [ $n -lt 3 ] || { echo 'the last line' >&2; exit 1; }
            answer '"delta_ste_um":1'
        }"#;
    let error = run(&backend(flooding), THREE).unwrap_err();
    assert!(
        error.contains("sample 2") && error.ends_with("the last line"),
        "{error}"
    );
    let tail = error.split_once("standard error:\n").unwrap().1;
    assert!(tail.len() > 10_000 && tail.len() < 17_000, "{}", tail.len());
}

#[test]
fn a_command_that_is_none_says_what_the_shell_said() {
    let folder = tempfile::tempdir().unwrap();
    let script = folder.path().join("model.py");
    std::fs::write(&script, "print(1)\n").unwrap();
    for (command, status, said, remedy) in [
        (
            "/no/such/simulator",
            127,
            "not found",
            "; install the program on this machine, or correct --exec or simulator.command",
        ),
        (
            script.to_str().unwrap(),
            126,
            "Permission denied",
            "(chmod +x), or name its interpreter, as in \"python3 model.py\"",
        ),
    ] {
        let backend = backend_of(command.to_owned(), Duration::from_secs(5));
        let error = backend.model_digest(&problem(), 2).unwrap_err();
        assert_eq!(error.exit_code(), crate::exit::FILE_ACCESS);
        let error = error.to_string();
        assert!(error.contains(&format!("exit status: {status}")), "{error}");
        assert!(
            error.starts_with("this machine cannot run the simulator: ") && error.ends_with(remedy),
            "{error}"
        );
        assert!(
            error.contains(said) || error.contains("No such file"),
            "{error}"
        );
        assert_eq!(error.lines().count(), 1, "{error}");
    }
}

#[test]
fn stopping_ends_what_is_waited_for() {
    let mark = mark();
    let hanging = format!("{PREAMBLE}\non_sample() {{ : {mark}; sleep 600; }}\n{LOOP}");
    let backend = backend_of(hanging, Duration::from_secs(600));
    std::thread::scope(|scope| {
        let job = scope.spawn(|| run(&backend, THREE));
        eventually("the program", || processes(&mark) > 0);
        backend.stop();
        let error = job.join().unwrap().unwrap_err();
        assert!(error.contains("because the worker stops"), "{error}");
    });
    eventually("the program's end", || processes(&mark) == 0);
}

#[test]
fn a_stopped_task_keeps_its_finished_samples() {
    let asked = Cell::new(0);
    let keep_going = |_: &dyn Fn() -> Option<Output>| {
        asked.set(asked.get() + 1);
        asked.get() <= 3
    };
    let backend = backend("");
    let (computed, seconds) = backend.with(&problem(), |simulator| {
        compute_until(simulator, &unit(THREE), &source(), &keep_going)
    });
    // `keep_going` is called before the design and before each of its samples.
    let whole = run(&backend, THREE).unwrap();
    assert_eq!(values(&computed.output.unwrap()), values(&whole)[..2]);
    assert!(seconds > 0.0);
}

/// Otherwise a report would show an optimum of −5 µm.
#[test]
fn a_simulator_whose_numbers_cannot_be_fails() {
    let negative =
        "on_archard() { answer '\"delta_ste_archard_um\":-5,\"hertz_pressure_worn_mpa\":1'; }";
    let error = run(&backend(negative), THREE).unwrap_err();
    assert!(
        error.contains("ΔSTE with Archard's wear is -5e0 µm"),
        "{error}"
    );
    let absurd = "on_sample() { answer '\"delta_ste_um\":1e308'; }";
    let error = run(&backend(absurd), THREE).unwrap_err();
    assert!(
        error.contains("design-0, sample 0: delta_ste_um is 1e308 µm"),
        "{error}"
    );
}

#[test]
fn a_failing_program_fails_the_optimiser_too() {
    let source = Source::Run(Run {
        approach: problem::Approach::Baseline,
        start: 0,
        base: problem().base().clone(),
        models: Vec::new(),
        from: None,
    });
    let failing = "n=0\non_archard() { n=$((n + 1)); [ $n -lt 4 ] || exit 9; answer \"$geometry,\\\"delta_ste_archard_um\\\":1,\\\"hertz_pressure_worn_mpa\\\":1\"; }";
    let compute = |simulator: &dyn Simulator| compute(simulator, &unit(0..1), &source);
    let error = backend(failing).with(&problem(), compute).0.unwrap_err();
    assert!(
        error.starts_with("simulator call ") && error.contains("exit status: 9"),
        "{error}"
    );
}

#[test]
fn a_simulator_that_the_campaign_does_not_want_is_refused() {
    let built_in = Problem::new(Campaign::parse("paper.toml", Campaign::PAPER).unwrap());
    let exec = Exec {
        interface: Interface::Lines("true".to_owned()),
        timeout: Duration::from_secs(1),
        environment: Vec::new(),
    };
    let unwanted = Backend::choose(&built_in, Some(&exec), watch::Sender::default()).unwrap_err();
    assert!(
        unwanted.to_string().contains("without --exec"),
        "{unwanted}"
    );
    let missing = Backend::choose(&problem(), None, watch::Sender::default()).unwrap_err();
    assert!(missing.to_string().contains("--exec 'CMD'"), "{missing}");
    for error in [unwanted, missing] {
        assert_eq!(error.exit_code(), crate::exit::REFUSED);
    }
}

#[test]
fn timeouts_are_numbers_of_seconds() {
    assert_eq!(seconds("0.25"), Ok(Duration::from_millis(250)));
    for nonsense in ["0", "-1", "nan", "inf", "1e300", "soon"] {
        assert!(seconds(nonsense).is_err(), "{nonsense}");
    }
}
