//! `sweep`, `sensitivity` and `pareto`: studies beyond one campaign; and the corrections and load cases of a campaign.

use std::time::{Duration, Instant};

use acceptance::{Sandbox, assert_code, errors, printed, small_campaign};

/// Writes a campaign that is small enough to be repeated, and returns its file.
fn small(sandbox: &Sandbox, name: &str) -> String {
    let file = sandbox.write(name, &small_campaign(60, 30));
    file.to_str().expect("a plain path").to_owned()
}

fn csv(sandbox: &Sandbox, path: &str) -> Vec<Vec<String>> {
    let text = std::fs::read_to_string(sandbox.path(path)).expect("the table was written");
    let fields = |line: &str| line.split(',').map(str::to_owned).collect();
    text.lines().map(fields).collect()
}

fn column<'a>(table: &'a [Vec<String>], name: &str) -> impl Iterator<Item = &'a str> {
    let at = table[0].iter().position(|head| head == name).expect(name);
    table[1..].iter().map(move |row| row[at].as_str())
}

fn modified(sandbox: &Sandbox, path: &str) -> std::time::SystemTime {
    let metadata = std::fs::metadata(sandbox.path(path)).expect("the file is there");
    metadata.modified().expect("a time")
}

#[test]
fn a_sweep_is_continued_after_a_kill_and_repeats_nothing() {
    let sandbox = Sandbox::new();
    let text = small_campaign(60, 30).replacen("samples = 100 ", "samples = 2000 ", 1);
    let file = sandbox.write("small.toml", &text);
    let file = file.to_str().unwrap();
    let arguments = ["sweep", file, "--teeth", "19..=21", "--out", "sweep"];
    let running = sandbox.start("coordinator", &arguments);
    let finished = |status: &serde_json::Value| status["finished"] == true;
    let first = "sweep/quick-z19.db";
    sandbox.wait_for(first, "the first number of teeth", finished);
    let after_first = |status: &serde_json::Value| status["stage"] != "doe";
    sandbox.wait_for("sweep/quick-z20.db", "the second one", after_first);
    running.kill();
    assert!(
        !sandbox.path("sweep/sweep.csv").exists(),
        "nothing to tell yet"
    );

    // Finished campaigns are not run again: a report is written at the end of a run.
    let report = "sweep/quick-z19-report/report.html";
    let before = modified(&sandbox, report);
    let output = sandbox.coordinator(&arguments);
    assert_code(&output, 0);
    assert_eq!(modified(&sandbox, report), before);
    let page = printed(&output);
    for line in ["| 19 : 21 |", "| 20 : 22 |", "| 21 : 23 |", "sweep.svg"] {
        assert!(page.contains(line), "no {line:?} in\n{page}");
    }
    let table = csv(&sandbox, "sweep/sweep.csv");
    assert!(
        column(&table, "teeth_p")
            .filter(|teeth| *teeth == "20")
            .count()
            >= 4
    );
    // With one centre distance, more teeth have a smaller module.
    let modules: Vec<f64> = table[1..]
        .iter()
        .filter(|row| row[2] == "archard")
        .filter_map(|row| {
            let at = table[0].iter().position(|head| head == "normal_module_mm");
            row[at.unwrap()].parse().ok()
        })
        .collect();
    assert_eq!(modules.len(), 3);
    let svg = std::fs::read_to_string(sandbox.path("sweep/sweep.svg")).unwrap();
    assert!(svg.contains("teeth of the pinion"));

    // A further run writes the same tables from the same stores and only reads.
    let written = std::fs::read(sandbox.path("sweep/sweep.csv")).unwrap();
    let third = modified(&sandbox, "sweep/quick-z21-report/report.html");
    assert_code(&sandbox.coordinator(&arguments), 0);
    assert_eq!(
        std::fs::read(sandbox.path("sweep/sweep.csv")).unwrap(),
        written
    );
    assert_eq!(
        modified(&sandbox, "sweep/quick-z21-report/report.html"),
        third
    );

    // A sweep without interruption and with another number of workers gives the same table.
    let arguments = [
        "sweep",
        file,
        "--teeth",
        "19..22",
        "--out",
        "other",
        "--workers",
        "3",
    ];
    assert_code(&sandbox.coordinator(&arguments), 0);
    assert_eq!(
        std::fs::read(sandbox.path("other/sweep.csv")).unwrap(),
        written
    );
}

#[test]
fn teeth_for_which_nothing_is_feasible_are_said_so() {
    let sandbox = Sandbox::new();
    let text =
        small_campaign(20, 30).replacen("contact_limit_mpa = 1550.0", "contact_limit_mpa = 1.0", 1);
    let file = sandbox.write("weak.toml", &text);
    let arguments = [
        "sweep",
        file.to_str().unwrap(),
        "--teeth",
        "20",
        "--out",
        "weak",
    ];
    let output = sandbox.coordinator(&arguments);
    assert_code(&output, 0);
    let page = printed(&output);
    assert!(page.contains("| 20 : 22 | none feasible |"), "{page}");
    let table = csv(&sandbox, "weak/sweep.csv");
    assert!(column(&table, "p90_um").all(str::is_empty));
}

#[test]
fn a_sweep_into_the_folder_of_another_loses_nothing() {
    let sandbox = Sandbox::new();
    let sweep = |file: &str, teeth: &str| {
        sandbox.coordinator(&["sweep", file, "--teeth", teeth, "--out", "sweep"])
    };
    let file = small(&sandbox, "small.toml");
    for teeth in ["21", "20"] {
        assert_code(&sweep(&file, teeth), 0);
    }
    let both = csv(&sandbox, "sweep/sweep.csv");
    let teeth: Vec<&str> = column(&both, "teeth_p").collect();
    assert!(
        teeth.starts_with(&["20"]) && teeth.ends_with(&["21"]),
        "{teeth:?}"
    );
    let other = small_campaign(60, 30).replacen("name = \"quick\"", "name = \"other\"", 1);
    let changed = small_campaign(60, 30).replacen("seed = 2009", "seed = 7", 1);
    for text in [other, changed] {
        let file = sandbox.write("other.toml", &text);
        let output = sweep(file.to_str().unwrap(), "22");
        assert_code(&output, 2);
        let said = errors(&output);
        assert!(said.contains("has the sweep of another campaign"), "{said}");
        assert_eq!(csv(&sandbox, "sweep/sweep.csv"), both);
    }
}

#[test]
fn sizes_are_ranked_and_written_as_pair_files() {
    let sandbox = Sandbox::new();
    let file = small(&sandbox, "small.toml");
    let sizing = ["sizing", &file, "--teeth", "20..=21", "--out", "sizes"];
    let narrow = [&sizing[..], &["--ratio-tolerance", "0"]].concat();
    let output = sandbox.coordinator(&[&narrow[..2], &["--teeth", "21"], &narrow[4..]].concat());
    assert_code(&output, 2);
    assert!(
        errors(&output).contains("--ratio-tolerance"),
        "{}",
        errors(&output)
    );
    let output =
        sandbox.coordinator(&[&sizing[..], &["--ratio-tolerance", "0.06", "--top", "1"]].concat());
    assert_code(&output, 0);
    let table = csv(&sandbox, "sizes/sizing.csv");
    assert_eq!(column(&table, "teeth_r").count(), 6);
    let pair = [
        "simulate",
        "--pair",
        "sizes/pair-1.toml",
        "--wear",
        "archard",
    ];
    let output = sandbox.coordinator(&pair);
    assert_code(&output, 0);
    assert!(
        printed(&output).contains("\nfeasible"),
        "{}",
        printed(&output)
    );
    assert!(!sandbox.path("sizes/pair-2.toml").exists());
}

#[test]
fn bad_ranges_of_teeth_are_refused() {
    let sandbox = Sandbox::new();
    let file = small(&sandbox, "small.toml");
    for (teeth, why) in [
        ("30..17", "17..=30 is 17 to 30"),
        ("many", "not a number of teeth"),
        ("2..5", "from 4 to 2000"),
    ] {
        let output = sandbox.coordinator(&["sweep", &file, "--teeth", teeth]);
        assert_code(&output, 2);
        assert!(errors(&output).contains(why), "{}", errors(&output));
    }
    // 1990 teeth have a mate with 2211, which is refused before anything is computed.
    let output = sandbox.coordinator(&["sweep", &file, "--teeth", "20..=1990", "--out", "never"]);
    assert_code(&output, 3);
    assert!(
        errors(&output).contains("pinion teeth"),
        "{}",
        errors(&output)
    );
    assert!(!sandbox.path("never").exists());
}

/// A campaign of relieved and crowned pairs under two torques, new and worn, from its file to tables and pair file. Its
/// samples are the same with one worker and with three.
#[test]
fn corrections_and_load_cases_go_through_a_campaign() {
    let sandbox = Sandbox::new();
    let section = "\n[corrections]\ntip_relief_um = { pinion = [0.0, 20.0], mate = \"tied\" }\n\
                   tip_relief_length_mm = 1.5\ncrowning_um = [0.0, 5.0]\n";
    let cases = "[[load.cases]]\nname = \"worn\"\n[[load.cases]]\nname = \"new\"\nwear = 0.0\n\
                 delta_ste_max_um = 6.0\n[[load.cases]]\nname = \"light\"\npinion_torque_nm = 50.0\n\
                 [material]";
    // The whole-face tooth model does not allow crowning.
    let text = small_campaign(60, 8)
        .replacen("\"whole-face-beam\"", "\"hertz-beam\"", 1)
        .replacen("[material]", cases, 1);
    let file = sandbox.write("cases.toml", &(text + section));
    let file = file.to_str().unwrap();
    assert_code(&sandbox.coordinator(&["check", file]), 0);
    for (db, workers) in [("a.db", "1"), ("b.db", "3")] {
        let run = [
            "run",
            file,
            "--db",
            db,
            "--workers",
            workers,
            "--out",
            workers,
        ];
        assert_code(&sandbox.coordinator(&run), 0);
        let table = |name: &str| {
            let out = format!("{name}-{db}.csv");
            let export = ["export", "--db", db, "--table", name, "--out", &out];
            assert_code(&sandbox.coordinator(&export), 0);
        };
        ["samples", "designs", "optima"]
            .iter()
            .for_each(|name| table(name));
    }
    for name in ["samples", "designs"] {
        let [one, three] = ["a.db", "b.db"].map(|db| csv(&sandbox, &format!("{name}-{db}.csv")));
        assert_eq!(one, three, "{name}");
    }
    // Optima have times, too.
    let [one, three] = ["a.db", "b.db"].map(|db| csv(&sandbox, &format!("optima-{db}.csv")));
    assert!(column(&one, "p90_um").eq(column(&three, "p90_um")));
    let samples = csv(&sandbox, "samples-a.db.csv");
    let number = |text: &str| text.parse::<f64>().unwrap();
    let of = |name: &str| -> Vec<f64> { column(&samples, name).map(number).collect() };
    let [worn, new, light] =
        ["worn", "new", "light"].map(|case| of(&format!("delta_ste_{case}_um")));
    // New flanks do not scatter from sample to sample of a design.
    assert!(
        new.chunks(8)
            .all(|design| design.iter().all(|value| *value == design[0]))
    );
    assert!(
        worn.chunks(8)
            .any(|design| design.iter().any(|value| *value != design[0]))
    );
    assert_ne!(worn, light);
    let designs = csv(&sandbox, "designs-a.db.csv");
    assert!(column(&designs, "tip_relief_p_um").any(|text| number(text) > 10.0));

    let pair = [
        "export",
        "--db",
        "a.db",
        "--pair",
        "best.toml",
        "--approach",
        "archard",
    ];
    assert_code(&sandbox.coordinator(&pair), 0);
    let best = std::fs::read_to_string(sandbox.path("best.toml")).unwrap();
    for key in [
        "tip_relief_um",
        "crowning_um",
        "[[load.cases]]",
        "delta_ste_max_um",
    ] {
        assert!(best.contains(key), "{key}: {best}");
    }
    assert_code(
        &sandbox.coordinator(&["simulate", "--pair", "best.toml"]),
        0,
    );
    let report = std::fs::read_to_string(sandbox.path("1/report.html")).unwrap();
    assert!(
        report.contains("delta_ste_new_um"),
        "the limit of a case is shown"
    );
}

/// The searches on models keep the limit of a load case, too: no design keeps this one, and nothing is recommended. The
/// measure has scores, which an approach without a design has none of.
#[test]
fn a_limit_of_a_load_case_that_no_design_keeps_leaves_no_optimum() {
    let sandbox = Sandbox::new();
    let cases = "[[load.cases]]\nname = \"worn\"\n[[load.cases]]\nname = \"new\"\nwear = 0.0\n\
                 delta_ste_max_um = 1e-3\n[objective]\nmeasure = \"superquantile\"\n[material]";
    let text = small_campaign(60, 8).replacen("[material]", cases, 1);
    let file = sandbox.write("cases.toml", &text);
    let run = ["run", file.to_str().unwrap(), "--db", "c.db", "--out", "r"];
    let output = sandbox.coordinator(&run);
    assert_code(&output, 16);
    let said = String::from_utf8_lossy(&output.stdout);
    let kriging = said.lines().find(|line| line.contains("kriging"));
    assert!(kriging.is_some_and(|line| !line.contains("µm")), "{said}");
    assert!(sandbox.path("r/report.html").exists());
    // Nor does a study show designs that break the limit.
    let study = [
        "pareto",
        file.to_str().unwrap(),
        "--db",
        "c.db",
        "--out",
        "p",
    ];
    let output = sandbox.coordinator(&study);
    assert_code(&output, 0);
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(said.contains("0 designs of the DoE"), "{said}");
    assert!(!said.contains("optimum of"), "{said}");
}

#[test]
fn a_signal_ends_a_study_that_leaves_nothing_behind() {
    let sandbox = Sandbox::new();
    let file = small(&sandbox, "small.toml");
    assert_code(&sandbox.coordinator(&["run", &file, "--db", "small.db"]), 0);
    let rows = ["--rows", "60000", "--out", "tables"];
    let study = [&["sensitivity", &file, "--db", "small.db"], &rows[..]].concat();
    for signal in ["INT", "TERM"] {
        let log = [("PITCHLINE_LOG", "debug")];
        let mut study = sandbox.start_with("coordinator", &study, &log);
        study.wait_for_line("simulating deviations");
        std::thread::sleep(Duration::from_millis(200));
        let since = Instant::now();
        study.signal(signal);
        let (status, said) = study.finish();
        assert_eq!(status.code(), Some(14), "{said}");
        assert!(since.elapsed() < Duration::from_secs(8), "{said}");
        assert!(said.contains("nothing was written"), "{said}");
        assert!(!sandbox.path("tables").exists());
    }
}

#[test]
fn studies_of_a_finished_campaign_need_one() {
    let sandbox = Sandbox::new();
    let file = small(&sandbox, "small.toml");
    for command in ["sensitivity", "pareto"] {
        let output = sandbox.coordinator(&[command, &file, "--db", "nowhere.db"]);
        assert_code(&output, 5);
    }
    // A coordinator without workers makes the DoE and waits.
    let address = acceptance::free_address().to_string();
    let serve = ["serve", &file, "--db", "begun.db", "--listen", &address];
    let running = sandbox.start("coordinator", &serve);
    sandbox.wait_for("begun.db", "the DoE", |status| status["stage"] == "sample");
    running.kill();
    for command in ["sensitivity", "pareto"] {
        let output = sandbox.coordinator(&[command, &file, "--db", "begun.db"]);
        assert_code(&output, 1);
        let said = errors(&output);
        assert!(said.contains("not finished (stage sample)"), "{said}");
    }
    let other = sandbox.write("other.toml", &small_campaign(61, 30));
    let output = sandbox.coordinator(&["pareto", other.to_str().unwrap(), "--db", "begun.db"]);
    assert_code(&output, 6);
}

#[test]
fn a_finished_campaign_is_looked_at_from_two_more_sides() {
    let sandbox = Sandbox::new();
    let file = small(&sandbox, "small.toml");
    assert_code(&sandbox.coordinator(&["run", &file, "--db", "small.db"]), 0);
    let store = std::fs::read(sandbox.path("small.db")).unwrap();

    let sensitivity = ["sensitivity", &file, "--db", "small.db", "--rows", "64"];
    let output = sandbox.coordinator(&[&sensitivity[..], &["--out", "s"]].concat());
    assert_code(&output, 0);
    let scenarios = csv(&sandbox, "s/scenarios.csv");
    assert_eq!(
        scenarios.len(),
        8,
        "as designed, and three parameters by two factors"
    );
    // The value of the unchanged design equals the verified one.
    let output = sandbox.coordinator(&[
        "export",
        "--db",
        "small.db",
        "--table",
        "optima",
        "--out",
        "optima.csv",
    ]);
    assert_code(&output, 0);
    let optima = csv(&sandbox, "optima.csv");
    let least = column(&optima, "p90_um")
        .filter(|text| !text.is_empty())
        .min_by(|a, b| a.parse::<f64>().unwrap().total_cmp(&b.parse().unwrap()));
    assert_eq!(column(&scenarios, "p90_um").next(), least);
    let indices = csv(&sandbox, "s/indices.csv");
    // Variables, three parameters of the wear and the torque; for one pair the field, too.
    assert_eq!(indices.len(), 1 + 15 + 16);
    let output = sandbox.coordinator(&[&sensitivity[..], &["--approach", "magic"]].concat());
    assert_code(&output, 2);
    assert!(
        errors(&output).contains("best-of-doe"),
        "{}",
        errors(&output)
    );

    for against in ["pressure", "root-stress"] {
        let arguments = ["pareto", &file, "--db", "small.db", "--against", against];
        let arguments = [&arguments[..], &["--out", against, "--refine", "2"]].concat();
        let output = sandbox.coordinator(&arguments);
        assert_code(&output, 0);
        let table = csv(&sandbox, &format!("{against}/pareto.csv"));
        let objective = match against {
            "pressure" => "hertz_pressure_mpa",
            _ => "root_stress_mpa",
        };
        let number = |text: &str| text.parse::<f64>().unwrap();
        let front: Vec<(f64, f64)> = column(&table, objective)
            .zip(column(&table, "verified_p90_um"))
            .zip(column(&table, "on_front"))
            .filter(|(_, on_front)| *on_front == "1")
            .map(|((second, p90), _)| (number(second), number(p90)))
            .collect();
        assert!(!front.is_empty(), "{}", printed(&output));
        for pair in front.windows(2) {
            assert!(pair[0].0 < pair[1].0 && pair[0].1 > pair[1].1, "{front:?}");
        }
        assert!(sandbox.path(&format!("{against}/pareto.svg")).exists());
    }
    assert_eq!(
        std::fs::read(sandbox.path("small.db")).unwrap(),
        store,
        "they only read"
    );
}

#[test]
fn designs_of_an_external_simulator_are_weighed_by_the_samples_in_the_store() {
    let sandbox = Sandbox::new();
    let external = acceptance::root().join("campaigns/external");
    let file = external.join("campaign.toml").display().to_string();
    let exec = acceptance::python(&external.join("simulator.py"));
    let run = ["run", &file, "--db", "e.db", "--exec", &exec];
    assert_code(&sandbox.coordinator(&run), 0);
    let pareto = ["pareto", &file, "--db", "e.db", "--out", "front"];
    assert_code(&sandbox.coordinator(&pareto), 0);
    let table = csv(&sandbox, "front/pareto.csv");
    let of_doe = column(&table, "source").zip(column(&table, "verified_p90_um"));
    let verified: Vec<&str> = of_doe
        .filter(|(source, _)| source.contains("of the DoE"))
        .map(|(_, verified)| verified)
        .collect();
    assert!(!verified.is_empty() && verified.iter().all(|text| text.is_empty()));
    // Other designs would have to be simulated.
    let never = [&*file, "--db", "e.db", "--out", "never"];
    for study in [&["pareto", "--refine", "1"][..], &["sensitivity"]] {
        let refused = sandbox.coordinator(&[study, &never].concat());
        assert_code(&refused, 2);
        let said = errors(&refused);
        assert!(said.contains("without the section [simulator]"), "{said}");
        assert!(!sandbox.path("never").exists());
    }
}
