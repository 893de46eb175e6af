//! The `coordinator` binary: see `coordinator --help`.

mod arguments;
mod commands;

use std::process::ExitCode;

use clap::Parser as _;
use protocol::exit;
use tracing_subscriber::EnvFilter;

fn main() -> ExitCode {
    let arguments = arguments::Arguments::parse();
    let filter =
        EnvFilter::try_from_env("PITCHLINE_LOG").unwrap_or_else(|_| EnvFilter::new("info"));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .init();
    let runtime = match tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
    {
        Ok(runtime) => runtime,
        Err(error) => {
            tracing::error!(%error, "cannot start");
            return ExitCode::from(exit::FAILURE);
        }
    };
    let result = runtime.block_on(commands::execute(arguments.command));
    runtime.shutdown_background();
    match result {
        Ok(code) => ExitCode::from(code),
        Err(error) => {
            tracing::error!("{error:#}");
            ExitCode::from(commands::exit_code(&error))
        }
    }
}
