//! The `coordinator` binary: see `coordinator --help`.

#![expect(
    clippy::disallowed_methods,
    reason = "commands measure time, date certificates and read the environment"
)]

mod arguments;
mod commands;
mod progress;

use std::process::ExitCode;

use clap::Parser as _;

fn main() -> ExitCode {
    let arguments = arguments::Arguments::parse();
    if let Some(point) = arguments.fail_point {
        point.set();
    }
    let threads = 2;
    runner::console::run(
        arguments.log_format,
        threads,
        commands::execute(arguments.command),
    )
}
