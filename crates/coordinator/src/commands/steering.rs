//! `status`, `explain`, `drain` and `retry`: watching and steering a running campaign.

use std::io::IsTerminal as _;
use std::time::{Duration, Instant};

use results::describing::describe;
use results::status::{self, Status};
use results::table::SCHEMA_VERSION;
use runner::exit::{self, HasExitCode, ProgramError};
use runner::gateway::client::ConnectArguments;
use runner::gateway::{Link, Role};
use runner::protocol::v1::{DrainRequest, ExplainRequest, RetryRequest, WatchRequest};
use store::Store;

use super::{print, print_either};
use crate::arguments;

/// Interval at which `--watch` reads a store.
const PERIOD: Duration = Duration::from_secs(1);

/// How long `--watch` waits for a coordinator that stopped answering, for example during a restart.
const AWAY: Duration = Duration::from_secs(60);

/// Terminal codes that move the cursor home and clear the screen below.
const CLEAR: &str = "\x1b[H\x1b[J";

/// `coordinator status`.
pub(super) async fn status(arguments: arguments::Status) -> Result<u8, ProgramError> {
    let mut source = match &arguments.db {
        Some(db) => Source::Store(Box::new(Store::open_read_only(db).await?)),
        None => Source::Coordinator {
            link: link(&arguments.connect)?,
            seen: 0,
        },
    };
    if let (Source::Store(store), true) = (&source, arguments.check) {
        store.checked().await?;
    }
    let mut away_since: Option<Instant> = None;
    loop {
        let status = match source.next().await {
            Ok(status) => status,
            Err(error) if arguments.watch && source.may_come_back(&error) => {
                let since = *away_since.get_or_insert_with(|| {
                    runner::console::complain(&format!("{error}; asking again"));
                    Instant::now()
                });
                if since.elapsed() > AWAY {
                    return Err(error);
                }
                tokio::time::sleep(PERIOD).await;
                continue;
            }
            Err(error) => return Err(error),
        };
        away_since = None;
        let text = if arguments.json {
            serde_json::to_string(&status)? + "\n"
        } else {
            describe(&status)
        };
        let clear = arguments.watch && !arguments.json && std::io::stdout().is_terminal();
        print(&format!("{}{text}", if clear { CLEAR } else { "" }))?;
        if !arguments.watch || status.finished {
            return Ok(exit::OK);
        }
        tokio::time::sleep(PERIOD).await;
    }
}

/// The source of the status.
enum Source {
    Store(Box<Store>),
    Coordinator { link: Link, seen: u64 },
}

impl Source {
    /// Whether the error means that a coordinator that has answered before is unreachable.
    fn may_come_back(&self, error: &ProgramError) -> bool {
        error.code() == exit::UNREACHABLE
            && matches!(self, Self::Coordinator { seen, .. } if *seen > 0)
    }

    async fn next(&mut self) -> Result<Status, ProgramError> {
        match self {
            Self::Store(store) => Ok(status::read(store).await?),
            Self::Coordinator { link, seen } => {
                let request = WatchRequest {
                    seen: *seen,
                    wait_ms: 10_000,
                };
                let answer = link.client().watch(request).await;
                let answer = answer.map_err(|status| link.error(&status))?.into_inner();
                *seen = answer.revision;
                Ok(serde_json::from_str(&answer.status_json)?)
            }
        }
    }
}

/// There is no access file, perhaps because the campaign has no port.
#[derive(Debug, thiserror::Error)]
#[error(
    "{0}; a campaign of `coordinator run` has no port: `coordinator status --db FILE` reads its store, and Ctrl-C \
     stops it"
)]
struct NoPort(runner::gateway::Error);

impl HasExitCode for NoPort {
    fn exit_code(&self) -> u8 {
        self.0.exit_code()
    }
}

fn link(connect: &ConnectArguments) -> Result<Link, ProgramError> {
    Ok(match connect.link(Role::Client) {
        Err(missing @ runner::gateway::Error::NoAccess { .. }) => {
            return Err(NoPort(missing).into());
        }
        link => link?,
    })
}

/// `coordinator explain`.
pub(super) async fn explain(arguments: &arguments::Explain) -> Result<u8, ProgramError> {
    let link = link(&arguments.connect)?;
    let answer = link.client().explain(ExplainRequest {}).await;
    let answer = answer.map_err(|status| link.error(&status))?.into_inner();
    let sentences = answer.sentences;
    let result = serde_json::json!({ "schema_version": SCHEMA_VERSION, "sentences": sentences });
    print_either(arguments.json, &result, || sentences.join("\n") + "\n")?;
    Ok(exit::OK)
}

/// `coordinator drain`.
pub(super) async fn drain(arguments: &arguments::Drain) -> Result<u8, ProgramError> {
    let link = link(&arguments.connect)?;
    let request = DrainRequest {
        resume: arguments.resume,
    };
    let answer = link.client().drain(request).await;
    let leased = answer
        .map_err(|status| link.error(&status))?
        .into_inner()
        .leased;
    print(&if arguments.resume {
        "leasing again\n".to_owned()
    } else {
        format!("draining: the coordinator ends once the {leased} open leases are reported\n")
    })?;
    Ok(exit::OK)
}

/// `coordinator retry`.
pub(super) async fn retry(arguments: &arguments::Retry) -> Result<u8, ProgramError> {
    let link = link(&arguments.connect)?;
    let answer = link.client().retry(RetryRequest {}).await;
    let answer = answer.map_err(|status| link.error(&status))?;
    let retried = answer.into_inner().retried;
    print(&if retried.is_empty() {
        "nothing was quarantined\n".to_owned()
    } else {
        retried.join("\n") + "\n"
    })?;
    Ok(exit::OK)
}
