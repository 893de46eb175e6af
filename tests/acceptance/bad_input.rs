//! Invalid input gets one clear sentence and its own exit code, and changes nothing.

use std::net::TcpListener;

use acceptance::{Sandbox, assert_code, errors, free_address, printed, small_campaign};

/// Checks that a command is refused with one line that contains all `parts`.
fn refusal(sandbox: &Sandbox, arguments: &[&str], code: i32, parts: &[&str]) {
    let output = sandbox.coordinator(arguments);
    assert_code(&output, code);
    let message = errors(&output);
    assert_eq!(message.trim().lines().count(), 1, "{message}");
    for part in parts {
        assert!(message.contains(part), "no {part:?} in {message}");
    }
}

#[test]
fn a_bad_campaign_file_is_refused_by_file_line_and_key() {
    let sandbox = Sandbox::new();
    for (change, parts) in [
        (("designs = 150 ", "designs = 1 "), ["doe.designs", "is 1"]),
        (
            ("samples_per_design = 10 ", "samples_per_design = 3 "),
            ["sampling.samples_per_design", "from 4"],
        ),
        (("seed = 2009", "sed = 2009"), ["unknown field", "sed"]),
        (("seed = 2009", ""), ["missing field", "seed"]),
        (("seed = 2009", "seed = \"x\""), ["invalid type", "x"]),
        (
            ("pinion_torque_nm = 200.0", "pinion_torque_nm = 0.0"),
            ["load.pinion_torque_nm", "above 0"],
        ),
        (
            ("poisson_ratio = 0.29", "poisson_ratio = 0.6"),
            ["material.poisson_ratio", "0.499"],
        ),
        (
            ("variance = 0.01", "variance = inf"),
            ["wear.variance", "inf"],
        ),
        (
            (
                "helix_angle_deg = [0.0, 30.0]",
                "helix_angle_deg = [30.0, 0.0]",
            ),
            ["bounds.helix_angle_deg", "low < high"],
        ),
    ] {
        let file = sandbox.campaign("bad.toml", &[change]);
        let file = file.to_str().unwrap();
        let parts = [&["bad.toml, line "], &parts[..]].concat();
        refusal(&sandbox, &["run", file, "--db", "never.db"], 3, &parts);
        refusal(&sandbox, &["check", file], 3, &parts);
        assert!(
            !sandbox.path("never.db").exists(),
            "a refused campaign left a store"
        );
    }
    refusal(&sandbox, &["check", "nowhere.toml"], 4, &["nowhere.toml"]);
}

#[test]
fn a_bad_pair_file_is_refused_by_file_line_and_key() {
    let sandbox = Sandbox::new();
    let good = acceptance::FIGURE_7;
    for (from, to, part) in [
        ("centre_distance_mm = 110.0", "", "pair.centre_distance_mm"),
        (
            "face_width_mm = 10.0",
            "face_width_mm = -10.0",
            "pair.face_width_mm",
        ),
        ("teeth = [20, 22]", "teeth = [20]", "line 2"),
        ("\"hertz-beam\"", "\"rubber\"", "pair.tooth_model"),
        (
            "pinion_torque_nm = 200.0",
            "pinion_torque_nm = nan",
            "load.pinion_torque_nm",
        ),
        (
            "pressure_angle_deg = 18.0",
            "pressure_angle_deg = 0.5",
            "pair.pressure_angle_deg is 0.5, but must be a number from 1 to 45 degrees",
        ),
    ] {
        let text = good.replacen(from, to, 1);
        assert_ne!(text, good);
        sandbox.write("pair.toml", &text);
        refusal(
            &sandbox,
            &["simulate", "--pair", "pair.toml"],
            3,
            &["pair.toml, line", part],
        );
    }
}

#[test]
fn options_of_random_wear_are_refused_without_it() {
    let sandbox = Sandbox::new();
    sandbox.write("pair.toml", acceptance::FIGURE_7);
    for (option, wear) in [("--samples", "none"), ("--seed", "archard")] {
        refusal(
            &sandbox,
            &[
                "simulate",
                "--pair",
                "pair.toml",
                "--wear",
                wear,
                option,
                "40",
            ],
            2,
            &[option, "40", "--wear random"],
        );
    }
}

#[test]
fn a_store_that_is_not_this_campaigns_is_left_alone() {
    let sandbox = Sandbox::new();
    let tiny = small_campaign(12, 10);
    let file = sandbox.write("tiny.toml", &tiny);
    let file = file.to_str().unwrap();
    assert_code(&sandbox.coordinator(&["run", file, "--db", "tiny.db"]), 0);
    let before = std::fs::read(sandbox.path("tiny.db")).unwrap();

    let changed = tiny.replacen("seed = 2009", "seed = 2010", 1);
    assert_ne!(changed, tiny);
    let other = sandbox.write("other.toml", &changed);
    let other = other.to_str().unwrap();
    refusal(
        &sandbox,
        &["run", other, "--db", "tiny.db"],
        6,
        &["tiny.db", "another", "quick"].map(|part| {
            if part == "another" {
                "choose another file"
            } else {
                part
            }
        }),
    );
    assert_eq!(std::fs::read(sandbox.path("tiny.db")).unwrap(), before);

    sandbox.write("notes.txt", "not a database");
    refusal(
        &sandbox,
        &["run", file, "--db", "notes.txt"],
        7,
        &["notes.txt", "not an SQLite"],
    );
    refusal(
        &sandbox,
        &["status", "--db", "notes.txt"],
        7,
        &["notes.txt", "not an SQLite"],
    );
    assert_eq!(
        std::fs::read(sandbox.path("notes.txt")).unwrap(),
        b"not a database"
    );

    refusal(
        &sandbox,
        &["status", "--db", "nowhere.db"],
        5,
        &["nowhere.db", "no store"],
    );
    let mut damaged = before.clone();
    damaged.truncate(before.len() / 2);
    std::fs::write(sandbox.path("damaged.db"), &damaged).unwrap();
    refusal(
        &sandbox,
        &["run", file, "--db", "damaged.db"],
        8,
        &["damaged.db", "damaged"],
    );
    assert_eq!(std::fs::read(sandbox.path("damaged.db")).unwrap(), damaged);

    let export = [
        "export",
        "--db",
        "tiny.db",
        "--table",
        "samples",
        "--out",
        "notes.txt",
    ];
    refusal(&sandbox, &export, 4, &["notes.txt"]);
    refusal(&sandbox, &["init", "notes.txt"], 4, &["notes.txt"]);
    // Of two files, neither is left if the other exists.
    let external = ["init", "notes.txt", "--external"];
    refusal(&sandbox, &external, 4, &["notes.txt"]);
    assert!(!sandbox.path("notes.py").exists());
    sandbox.write("own.py", "print()");
    let external = ["init", "own.toml", "--external"];
    refusal(&sandbox, &external, 4, &["own.py"]);
    assert!(!sandbox.path("own.toml").exists());
    assert_eq!(
        std::fs::read(sandbox.path("notes.txt")).unwrap(),
        b"not a database"
    );
}

#[test]
fn a_taken_port_is_refused_without_leaving_a_store() {
    let sandbox = Sandbox::new();
    let file = sandbox.campaign("quick.toml", &[]);
    let file = file.to_str().unwrap();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let serve = ["serve", file, "--db", "never.db", "--listen", &address];
    refusal(&sandbox, &serve, 10, &["cannot listen", &address]);
    assert!(!sandbox.path("never.db").exists());
    let left = std::fs::read_dir(sandbox.path("pitchline"))
        .unwrap()
        .count();
    assert_eq!(left, 0, "nothing is left beside the access files");
}

#[test]
fn two_coordinators_do_not_share_a_store() {
    let sandbox = Sandbox::new();
    let file = sandbox.campaign("quick.toml", &[]);
    let file = file.to_str().unwrap();
    let address = free_address().to_string();
    let first = ["serve", file, "--db", "shared.db", "--listen", &address];
    let running = sandbox.start("coordinator", &first);
    sandbox.wait_for("shared.db", "the store", |_| true);
    refusal(
        &sandbox,
        &["run", file, "--db", "shared.db"],
        9,
        &["shared.db", "in use"],
    );
    running.kill();
}

#[test]
fn an_unreachable_coordinator_is_named() {
    let sandbox = Sandbox::new();
    let address = free_address().to_string();
    let output = sandbox.run(
        "worker",
        &[
            "--connect",
            &address,
            "--connect-timeout",
            "1",
            "--slots",
            "1",
        ],
    );
    assert_code(&output, 11);
    assert!(errors(&output).contains(&address), "{}", errors(&output));
    assert_eq!(
        errors(&output).trim().lines().count(),
        1,
        "{}",
        errors(&output)
    );
    let output = sandbox.run("worker", &["--connect", "over there"]);
    assert_code(&output, 2);
    assert!(
        errors(&output).contains("over there"),
        "{}",
        errors(&output)
    );
}

/// Constraints that no design satisfies, and bounds that contain no gear pair.
#[test]
fn a_campaign_without_a_design_to_sample_is_not_called_valid() {
    let sandbox = Sandbox::new();
    let ruled_out = small_campaign(20, 8)
        .replace("contact_ratio_min = 1.25", "contact_ratio_min = 9.0")
        .replace("[sampling]\n", "[sampling]\nskip_violation = 0.1\n");
    let no_gear = small_campaign(20, 8).replace(
        "profile_shift = [-1.0, 2.0]",
        "profile_shift = [-1.0, -0.999]",
    );
    for (name, text, reason) in [
        ("ruled-out.toml", ruled_out, "because of ruled-out"),
        ("no-gear.toml", no_gear, "because of "),
    ] {
        sandbox.write(name, &text);
        let check = sandbox.coordinator(&["check", name]);
        assert_code(&check, 15);
        let said = printed(&check);
        assert!(said.contains("no design to sample"), "{said}");
        assert!(said.contains(reason), "{said}");
        assert!(!said.contains("valid"), "{said}");
        let db = format!("{name}.db");
        let out = name.trim_end_matches(".toml");
        let run = sandbox.run_with(
            "coordinator",
            &["run", name, "--db", &db, "--out", out],
            &[("PITCHLINE_LOG", "warn")],
        );
        assert_code(&run, 15);
        assert!(errors(&run).contains("no design got samples"));
        let status = sandbox.status(&db).expect("the store is there");
        assert_eq!(status["finished"], true, "{status}");
    }
}
