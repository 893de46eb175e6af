//! The command-line options by which workers and commands find their coordinator, and the choice of the
//! access file.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use tracing::warn;

use crate::gateway::access::{self, Access};
use crate::gateway::address::Address;
use crate::gateway::error::Error;
use crate::gateway::link::Link;
use crate::gateway::token::Role;

/// Interval at which a waiting program checks for an access file.
const POLL_PERIOD: Duration = Duration::from_millis(100);
/// Time after which a waiting program says so.
const SILENCE: Duration = Duration::from_secs(10);

/// Options for reaching a coordinator, to be used with `#[command(flatten)]`.
#[derive(Debug, Clone, Default, clap::Args)]
pub struct ConnectArguments {
    /// The access file that `coordinator serve` wrote, or a copy of it [default: the one in
    /// ~/.local/state/pitchline, if there is one only]
    #[arg(long, value_name = "FILE", env = "PITCHLINE_ACCESS")]
    pub access: Option<PathBuf>,
    /// The coordinator's address, if it differs from those in the access file; without --access
    /// also the choice among several files
    #[arg(long, value_name = "HOST:PORT", env = "PITCHLINE_CONNECT")]
    pub connect: Option<Address>,
}

impl ConnectArguments {
    /// Makes a link to the coordinator, without sending anything yet. Must be called within a Tokio
    /// runtime.
    ///
    /// Its secrets come from an access file: the given one, the one that contains the given
    /// address, or the only one in the default folder.
    pub fn link(&self, role: Role) -> Result<Link, Error> {
        let file = match (&self.access, &self.connect) {
            (Some(path), connect) => return Link::new(path.clone(), connect.clone(), role),
            (None, Some(address)) => file_with(address)?,
            (None, None) => only_file()?,
        };
        Link::new(file, None, role)
    }

    /// Like [`ConnectArguments::link`], but waits up to `patience` for a missing access file, for
    /// example when worker and coordinator are started together.
    pub async fn link_within(&self, role: Role, patience: Duration) -> Result<Link, Error> {
        let since = Instant::now();
        let mut has_complained = false;
        loop {
            match self.link(role) {
                Err(Error::NoAccess { place }) if since.elapsed() < patience => {
                    if since.elapsed() > SILENCE && !has_complained {
                        has_complained = true;
                        let leaving_in = patience.saturating_sub(since.elapsed()).as_secs();
                        warn!(
                            leaving_in,
                            "waiting for a coordinator's access file {place}"
                        );
                    }
                    tokio::time::sleep(POLL_PERIOD).await;
                }
                result => return result,
            }
        }
    }
}

/// The access file in the default folder that contains this address.
fn file_with(address: &Address) -> Result<PathBuf, Error> {
    let canonical = |address: &Address| match address.host.as_str() {
        "localhost" | "::1" => ("127.0.0.1".to_owned(), address.port),
        host => (host.to_owned(), address.port),
    };
    let wanted = canonical(address);
    // An unusable file is not the one looked for.
    let contains_it = |path: &PathBuf| {
        Access::read(path).is_ok_and(|access| {
            access
                .addresses
                .iter()
                .map(canonical)
                .any(|own| own == wanted)
        })
    };
    access::all()?
        .into_iter()
        .find(contains_it)
        .ok_or_else(|| Error::NoAccess {
            place: format!("for {address} in {}", folder()),
        })
}

/// The access file in the default folder, if there is only one.
fn only_file() -> Result<PathBuf, Error> {
    let mut files = access::all()?;
    match files.len() {
        0 => Err(Error::NoAccess {
            place: format!("in {}", folder()),
        }),
        1 => Ok(files.remove(0)),
        _ => Err(Error::SeveralCoordinators {
            files: files
                .iter()
                .map(|path| path.display().to_string())
                .collect::<Vec<_>>()
                .join(", "),
        }),
    }
}

/// The default folder as text, for messages.
fn folder() -> String {
    access::folder().map_or_else(|error| error.to_string(), |path| path.display().to_string())
}
