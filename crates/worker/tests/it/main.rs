//! The `worker` binary on its own, without a coordinator.

use std::process::{Command, Output};

fn worker(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_worker"))
        .args(arguments)
        .output()
        .expect("the binary starts")
}

#[test]
fn help_lists_every_exit_code() {
    let output = worker(&["--help"]);
    assert!(output.status.success());
    let help = String::from_utf8(output.stdout).unwrap();
    for (code, meaning) in runner::exit::TABLE {
        // Long lines are wrapped at the terminal's width, so only the first words are compared.
        let words: Vec<&str> = meaning.split(' ').take(3).collect();
        let line = format!("{code:>2}  {}", words.join(" "));
        assert!(help.contains(&line), "no {line:?} in\n{help}");
    }
}

#[test]
fn an_address_that_is_none_is_a_usage_error() {
    for address in ["nowhere", "127.0.0.1:", "https://127.0.0.1:1", ":7400"] {
        let output = worker(&["--connect", address]);
        assert_eq!(
            output.status.code(),
            Some(i32::from(runner::exit::USAGE)),
            "{address}"
        );
        let message = String::from_utf8(output.stderr).unwrap();
        assert!(
            message.contains(address) && message.contains("HOST:PORT, such as 127.0.0.1:7400"),
            "{message}"
        );
    }
}

#[test]
fn no_slots_are_a_usage_error() {
    let output = worker(&["--connect", "127.0.0.1:1", "--slots", "0"]);
    assert_eq!(output.status.code(), Some(i32::from(runner::exit::USAGE)));
}
