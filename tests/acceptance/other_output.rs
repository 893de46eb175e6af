//! External programs that write other text than answers to their standard output, or do not flush
//! it.

use acceptance::{Sandbox, changed, python, root};

use crate::example::path;

/// The campaign, and the command of its program with `changes`.
pub(crate) fn bowl(sandbox: &Sandbox, changes: &[(&str, &str)]) -> (String, String) {
    let case = |name| {
        let file = root()
            .join("tests/acceptance/cases/stdout-and-buffering")
            .join(name);
        std::fs::read_to_string(file).expect("the case's files")
    };
    (
        path(&sandbox.write("bowl.toml", &case("bowl.toml"))),
        python(&sandbox.write("bowl.py", &changed(&case("bowl.py"), changes))),
    )
}

/// The exit code and the log.
pub(crate) fn run(sandbox: &Sandbox, arguments: &[&str]) -> (Option<i32>, String) {
    let log = [("PITCHLINE_LOG", "info"), ("NO_COLOR", "1")];
    let (status, said) = sandbox.start_with("coordinator", arguments, &log).finish();
    (status.code(), said)
}

/// A second copy of an answer was stored as the answer to a later request, and a banner ended the
/// campaign.
#[test]
fn messages_and_former_answers_are_skipped_with_one_warning() {
    let sandbox = Sandbox::new();
    let (file, exec) = bowl(&sandbox, &[]);
    let mut quiet = None;
    for (mode, line) in [
        ("", None),
        ("banner", Some("Loading licence ... OK")),
        ("chatty", Some("iteration 1 residual 1e-3")),
        ("once", Some("WARNING: deprecated option")),
        (
            "twice",
            Some("{\"protocol\": 2, \"version\": \"bowl 1\", \"id\": 1}"),
        ),
        ("after", Some("done in 0.1 s")),
    ] {
        let (db, exec) = (format!("x{mode}.db"), format!("{exec} {mode}"));
        let (code, said) = run(
            &sandbox,
            &["run", &file, "--db", &db, "--workers", "1", "--exec", &exec],
        );
        assert_eq!(code, Some(0), "{mode}: {said}");
        let status = sandbox.status(&db).expect("a store");
        assert_eq!(status["failures"], 0, "{mode}: {status}");
        let results = (status["samples_digest"].clone(), status["optima"].clone());
        assert_eq!(*quiet.get_or_insert(results.clone()), results, "{mode}");
        let warnings = said.matches("write messages to standard error").count();
        assert_eq!(warnings, usize::from(line.is_some()), "{mode}: {said}");
        assert!(
            line.is_none_or(|line| said.replace('\\', "").contains(line)),
            "{mode}: {said}"
        );
    }
}

#[test]
fn a_program_that_does_not_flush_is_told_to() {
    let sandbox = Sandbox::new();
    let (file, exec) = bowl(
        &sandbox,
        &[(
            "a[\"id\"]=r[\"id\"]; print(json.dumps(a),flush=True)",
            "a[\"id\"]=r[\"id\"]; print(json.dumps(a))",
        )],
    );
    let exec = format!("unset PYTHONUNBUFFERED; {exec}");
    let limit = ["--exec-timeout", "5"];
    let run_it = [
        "run",
        &file,
        "--db",
        "x.db",
        "--workers",
        "1",
        "--exec",
        &exec,
    ];
    let (code, said) = run(&sandbox, &[&run_it[..], &limit].concat());
    assert_ne!(code, Some(0), "{said}");
    for part in [
        "has not answered its first request for 10 s",
        "gave its answer only when its input was closed",
        "flush standard output after every line (python -u",
    ] {
        assert!(said.contains(part), "no {part:?} in: {said}");
    }
}
