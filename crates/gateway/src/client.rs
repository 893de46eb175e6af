//! How workers and commands find their coordinator: the command-line options and the links they
//! describe.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use tracing::warn;

use crate::access::{self, Access, AccessError};
use crate::dial::Dial;
use crate::error::Error;
use crate::files::Credentials;
use crate::link::{self, Link};
use crate::token::Role;

/// Interval at which a waiting program checks for an access file.
const LOOKING_PERIOD: Duration = Duration::from_millis(100);
/// After how long such a program says that it waits.
const SILENCE: Duration = Duration::from_secs(10);

/// Options for reaching a coordinator, to be used with `#[command(flatten)]`.
#[derive(Debug, Clone, Default, clap::Args)]
pub struct Reach {
    /// The access file that `coordinator serve` wrote, or a copy of it [default: the one in
    /// ~/.local/state/pitchline, if there is one only]
    #[arg(long, value_name = "FILE", env = "PITCHLINE_ACCESS")]
    pub access: Option<PathBuf>,
    /// The coordinator's address, where it is not that in the access file
    #[arg(long, value_name = "URL", env = "PITCHLINE_CONNECT")]
    pub connect: Option<String>,
    /// Files for a coordinator that was given files of the site's own, instead of an access file.
    #[command(flatten)]
    pub credentials: Credentials,
}

impl Reach {
    /// Makes a link to the coordinator, without sending anything yet. Must be called within a Tokio
    /// runtime.
    ///
    /// An address that begins with `http://` belongs to a coordinator with `--insecure`, and the
    /// files of [`Credentials`] replace the access file. Otherwise the secrets come from an access
    /// file: the given one, the one that contains the given address, or the only one in the default
    /// folder.
    ///
    /// # Errors
    ///
    /// No access file is found, or there are several to choose from; or see [`link::connect`].
    pub fn link(&self, role: Role) -> Result<Link, Error> {
        let credentials = &self.credentials;
        let has_files = credentials.token_file.is_some() || credentials.tls_ca.is_some();
        match (&self.access, self.connect.as_deref()) {
            (None, Some(url)) if has_files || !url.starts_with("https://") => {
                link::connect(Dial::default(), url, credentials, role)
            }
            (Some(path), url) => link::follow(path, url, credentials, role),
            (None, Some(url)) => link::follow(&file_of(url)?, None, credentials, role),
            (None, None) => link::follow(&the_only_one()?, None, credentials, role),
        }
    }

    /// Like [`Reach::link`], but waits up to `patience` for a missing access file, for example when
    /// worker and coordinator are started together.
    ///
    /// # Errors
    ///
    /// See [`Reach::link`].
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
                    tokio::time::sleep(LOOKING_PERIOD).await;
                }
                result => return result,
            }
        }
    }
}

/// The access file in the default folder that contains the address of `url`.
fn file_of(url: &str) -> Result<PathBuf, Error> {
    let plain = |(host, port): (String, u16)| match host.as_str() {
        "localhost" | "::1" => ("127.0.0.1".to_owned(), port),
        _ => (host, port),
    };
    let wanted = plain(access::host_and_port(url).ok_or_else(|| Error::Address {
        url: url.to_owned(),
    })?);
    // An unusable file is not the one looked for.
    let names_it = |path: &PathBuf| {
        Access::read(path)
            .is_ok_and(|access| access.hosts().flatten().map(plain).any(|own| own == wanted))
    };
    access::all()?
        .into_iter()
        .find(names_it)
        .ok_or_else(|| Error::NoAccess {
            place: format!("for {url} in {}", folder()),
        })
}

fn the_only_one() -> Result<PathBuf, Error> {
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

/// Reads the access file at `path`. A missing file has an error variant of its own, because it may
/// appear later.
pub(crate) fn read(path: &Path) -> Result<Access, Error> {
    match Access::read(path) {
        Err(AccessError::File(crate::files::CredentialError::Unreadable { reason, .. }))
            if reason.kind() == std::io::ErrorKind::NotFound =>
        {
            Err(Error::NoAccess {
                place: format!("at {}", path.display()),
            })
        }
        other => other.map_err(Error::from),
    }
}
