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
use runner::exit;

fn main() -> ExitCode {
    let arguments = arguments::Arguments::parse();
    if let Some(point) = arguments.fail_point {
        point.set();
    }
    if let Err(error) = runner::console::start_log(arguments.log_format) {
        runner::console::complain(&error.to_string());
        return ExitCode::from(exit::USAGE);
    }
    let runtime = match tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
    {
        Ok(runtime) => runtime,
        Err(error) => {
            runner::console::complain(&format!("cannot start: {error}"));
            return ExitCode::from(exit::FAILURE);
        }
    };
    let result = runtime.block_on(commands::execute(arguments.command));
    runtime.shutdown_background();
    match result {
        Ok(code) => ExitCode::from(code),
        Err(error) => {
            runner::console::complain(&format!("{error:#}"));
            ExitCode::from(error.code())
        }
    }
}
