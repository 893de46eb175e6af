//! External programs whose samples do not follow from their seeds.

use acceptance::Sandbox;

use crate::other_output::{bowl, run};

/// The place in the program where the random part of a sample is made.
const NOISE: &str =
    "y+.1*random.Random(sum(w<<(32*i) for i,w in enumerate(r[\"seed\"]))).gauss(0,1)";

/// The exit code and the log of a campaign whose program has `noise`, and its status.
fn campaign_with(noise: &str) -> (Option<i32>, String, Option<serde_json::Value>, Sandbox) {
    let sandbox = Sandbox::new();
    let (file, exec) = bowl(&sandbox, &[(NOISE, noise)]);
    let arguments = [
        "run",
        &file,
        "--db",
        "x.db",
        "--out",
        "r",
        "--workers",
        "1",
        "--exec",
        &exec,
    ];
    let (code, said) = run(&sandbox, &arguments);
    let status = sandbox.status("x.db");
    (code, said, status, sandbox)
}

#[test]
fn a_program_that_ignores_its_seed_is_named_at_the_start_and_at_the_end() {
    let (code, said, status, sandbox) = campaign_with("y+.1*random.Random(1).gauss(0,1)");
    assert_eq!(code, Some(0), "{said}");
    assert!(
        said.contains("WARN the simulator seems to ignore its seed"),
        "{said}"
    );
    let status = status.expect("a store");
    let warning = "The program seems to ignore its seed: in each of 10 designs, all samples of depth are equal, as of";
    assert!(
        status["warnings"][0]
            .as_str()
            .unwrap_or_default()
            .starts_with(warning),
        "{status}"
    );
    let report = std::fs::read_to_string(sandbox.path("r/report.html")).unwrap();
    assert!(report.contains(warning));
}

/// In half of the box the response has no random effects, which is no fault.
#[test]
fn a_response_that_is_constant_in_some_designs_is_no_warning() {
    let (code, said, status, _) = campaign_with(&format!("{NOISE} if d['x']>0 else 1.0+y"));
    assert_eq!(code, Some(0), "{said}");
    let status = status.expect("a store");
    assert!(status.get("warnings").is_none(), "{status}");
}

/// Regression test: the answers of a single worker were not compared with any others.
#[test]
fn a_program_with_random_effects_of_its_own_is_refused() {
    let (code, said, _, _) = campaign_with("y+.1*random.Random().gauss(0,1)");
    assert_eq!(code, Some(1), "{said}");
    assert!(
        said.contains("one sample, asked for twice with the same seed, was"),
        "{said}"
    );
}
