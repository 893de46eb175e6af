//! Programs that write other text than answers to their standard output, or answer late.

use std::time::Duration;

use super::*;

/// A backend whose script has `changes` and half a second for an answer.
fn hasty(changes: &str) -> Backend {
    let command = format!("{PREAMBLE}\n{changes}\n{LOOP}");
    backend_of(command, Duration::from_millis(500))
}

/// `before` and `after` run before and after each answer.
fn around(before: &str, after: &str) -> Backend {
    let answer = r#"printf '{"id":%s,%s}\n' "$id" "$1""#;
    backend(&format!("answer() {{ {before}\n{answer}\n{after}\n}}"))
}

#[test]
fn other_lines_are_skipped_up_to_the_answer() {
    let quiet = run(&backend(""), THREE).unwrap();
    let banner = "echo 'Loading licence ... OK'";
    for (before, after) in [
        (banner, ""),
        ("", banner),
        (banner, banner),
        // Without an end of line, as a progress bar, and as a prompt.
        ("printf 'Loading ... '", ""),
        ("printf '10 %%\\r20 %%\\r'", ""),
        ("", "printf '> '"),
        // Objects without an id, with another one, and with the id of something else.
        ("echo '{\"level\":\"info\"}'", ""),
        (
            "echo '{\"id\":\"solver\",\"delta_ste_um\":9}'",
            "echo '{\"id\":0}'",
        ),
        // The request itself, for the user.
        ("echo \"$line\"", "echo \"got $line\""),
        ("printf '\\357\\273\\277'", "printf '\\r\\n\\n  \\t\\n'"),
        ("printf '\\377\\376\\n'", ""),
        (
            "awk 'BEGIN { for (i = 0; i < 9000; i++) printf \"a long line \"; print \"\" }'",
            "",
        ),
        (
            "awk 'BEGIN { for (i = 0; i < 3000; i++) print \"residual \" i }'",
            "",
        ),
    ] {
        let output = run(&around(before, after), THREE);
        assert_eq!(output.as_ref(), Ok(&quiet), "{before} | {after}");
    }
}

/// Each job asks one question. The second copy of an answer may arrive before the next question or
/// after it.
#[test]
fn an_answer_that_comes_twice_is_not_the_answer_to_the_next_job() {
    let samples = |backend: &Backend| -> Vec<f64> {
        let problem = problem();
        let design = problem.design(&X, problem.base());
        let sample = |number| {
            let ask = |simulator: &dyn Simulator| {
                let mut rng = stats::streams::stream(1, stats::streams::Purpose::Wear, 0, number);
                Ok::<_, NoAnswer>(simulator.prepare(&design).unwrap().sample(&mut rng)?[0])
            };
            backend.with(&problem, ask).0.unwrap()
        };
        (0..8).map(sample).collect()
    };
    let once = samples(&backend(""));
    assert!(once.windows(2).any(|pair| pair[0] != pair[1]));
    let repeat = r#"printf '{"id":%s,%s}\n' "$id" "$1""#;
    let late = format!("sleep 0.02; {repeat}");
    for again in [repeat, &late] {
        assert_eq!(samples(&around("", again)), once, "{again}");
    }
}

#[test]
fn ids_are_never_used_again_within_a_process() {
    let twice_asked = r#"on_sample() {
        case "$seen" in *" $id "*) exit 9;; esac
        seen="$seen $id "; answer '"delta_ste_um":1'
    }"#;
    let backend = backend(twice_asked);
    for _ in 0..3 {
        assert_eq!(values(&run(&backend, THREE).unwrap()), [1.0; 3]);
    }
}

#[test]
fn output_without_end_is_an_error() {
    for babble in ["yes", "awk 'BEGIN { for (;;) printf \"0123456789\" }'"] {
        let error = run(&backend(&format!("on_sample() {{ {babble}; }}")), THREE).unwrap_err();
        assert!(
            error.contains(
                "wrote more than 16777216 bytes to its standard output without an answer"
            ),
            "{error}"
        );
    }
}

#[test]
fn a_missing_answer_hints_at_flushing_and_names_what_was_skipped() {
    let flush = "flush standard output after every line (python -u";
    for (missing, parts) in [
        (":", &["gave no answer within 0.5 s", flush][..]),
        (
            "echo hello; echo '{\"delta_ste_um\":1}'",
            &[
                flush,
                "2 lines without the \"id\" of the request are not answers and were skipped, the last of them: \
                 {\"delta_ste_um\":1}",
            ],
        ),
        (
            "printf '{\"id\":%s,\"delta' \"$id\"",
            &["its last line has no newline: {\"id\":4,\"delta", flush],
        ),
    ] {
        let error = run(&hasty(&format!("on_sample() {{ {missing}; }}")), THREE).unwrap_err();
        for part in parts {
            assert!(error.contains(part), "no {part:?} in: {error}");
        }
    }
    // A program whose output is in a buffer until it ends.
    let buffered = format!(
        "{PREAMBLE}\non_sample() {{ late=$(answer '\"delta_ste_um\":1'); }}\n{LOOP}\necho \"$late\"\n"
    );
    let error = run(&backend_of(buffered, Duration::from_millis(500)), THREE).unwrap_err();
    assert!(
        error.contains("only when its input was closed, after its 0.5 s") && error.contains(flush),
        "{error}"
    );
}

#[test]
fn the_last_answer_of_a_process_may_lack_its_newline() {
    let last = r#"n=0
        on_sample() {
            n=$((n + 1))
            [ $n -lt 3 ] || { printf '{"id":%s,"delta_ste_um":1}' "$id"; exit 0; }
            answer '"delta_ste_um":1'
        }"#;
    let backend = backend(last);
    for _ in 0..2 {
        assert_eq!(values(&run(&backend, THREE).unwrap()), [1.0; 3]);
    }
}
