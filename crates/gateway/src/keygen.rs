//! Makes the files of an encrypted, protected coordinator: an authority, two certificates, two
//! tokens.
//!
//! The authority signs one certificate for the coordinator and one for all clients (for
//! `--client-ca`). Each is valid only for its own purpose, so a client cannot pose as the
//! coordinator. The random bits of tokens and keys come from the operating system.

use std::fs::{self, DirBuilder, OpenOptions};
use std::io::{self, Write as _};
use std::net::IpAddr;
use std::os::unix::fs::{DirBuilderExt as _, MetadataExt as _, OpenOptionsExt as _};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use rand::TryRng as _;
use rand::rngs::SysRng;
use rcgen::{
    BasicConstraints, CertificateParams, CertifiedIssuer, DnType, ExtendedKeyUsagePurpose, IsCa,
    KeyPair, KeyUsagePurpose, date_time_ymd,
};

use crate::token::{Role, TOKEN_BYTES, Token};

/// Default validity of certificates, in days.
pub const DAYS: u32 = 825;
/// Maximum time by which another machine's clock may be behind.
const CLOCK_DIFFERENCE: Duration = Duration::from_secs(3600);

const SECRET: u32 = 0o600;
const PUBLIC: u32 = 0o644;

/// The names of the files, in the order in which they are listed.
pub const FILES: [&str; 9] = [
    CA,
    CA_KEY,
    SERVER,
    SERVER_KEY,
    CLIENT,
    CLIENT_KEY,
    TOKENS,
    WORKER_TOKEN,
    CLIENT_TOKEN,
];
const CA: &str = "ca.pem";
const CA_KEY: &str = "ca.key";
const SERVER: &str = "server.pem";
const SERVER_KEY: &str = "server.key";
const CLIENT: &str = "client.pem";
const CLIENT_KEY: &str = "client.key";
const TOKENS: &str = "coordinator.tokens";
const WORKER_TOKEN: &str = "worker.token";
const CLIENT_TOKEN: &str = "client.token";

/// The errors of making the files. Files written before the error are removed.
#[derive(Debug, thiserror::Error)]
pub enum KeygenError {
    /// One of the files exists.
    #[error(
        "{} exists, and nothing is overwritten: name a new folder, or remove it first",
        path.display()
    )]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// Others can list or change the contents of the folder.
    #[error(
        "others have access to {}: name a new folder, or chmod 700 {}",
        path.display(), path.display()
    )]
    Exposed {
        /// The folder.
        path: PathBuf,
    },
    /// The file or folder cannot be written.
    #[error("cannot write {}", path.display())]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// The name cannot be used in a certificate.
    #[error("{host:?} is no name of a host: give one such as head.example.org or 192.0.2.7")]
    Host {
        /// The given name.
        host: String,
    },
    /// The operating system provides no random bits.
    #[error("the system gives no random numbers: {0}")]
    Random(String),
    /// A certificate could not be made.
    #[error("cannot make a certificate")]
    Certificate(#[from] rcgen::Error),
}

/// Makes all files in `folder`, which is created if it does not exist. The coordinator's
/// certificate is for this machine's name, the loopback addresses and `hosts`, and is valid for
/// `days` days from `now`.
///
/// # Errors
///
/// See [`KeygenError`]; no file is left behind.
pub fn make(
    folder: &Path,
    hosts: &[String],
    days: u32,
    now: SystemTime,
) -> Result<(), KeygenError> {
    for host in hosts {
        if !is_host(host) {
            return Err(KeygenError::Host { host: host.clone() });
        }
    }
    let files = contents(hosts, days, now)?;
    let made_folder = private_folder(folder)?;
    let mut written = Vec::new();
    for (name, text, mode) in &files {
        let path = folder.join(name);
        if let Err(error) = write_new(&path, text, *mode) {
            for path in written {
                // A file that cannot be removed is used by nothing.
                let _ = fs::remove_file(path);
            }
            if made_folder {
                let _ = fs::remove_dir(folder);
            }
            return Err(error);
        }
        written.push(path);
    }
    Ok(())
}

/// A text that lists where each file belongs, and the commands that use them.
#[must_use]
pub fn describe(folder: &Path, hosts: &[String]) -> String {
    use std::fmt::Write as _;
    let mut text = String::new();
    let rows = [
        (
            CA,
            "coordinator, workers, clients",
            "the authority that they trust",
        ),
        (
            CA_KEY,
            "nowhere: keep it away",
            "secret; signs further certificates",
        ),
        (SERVER, "coordinator", "its certificate"),
        (SERVER_KEY, "coordinator", "secret; its key"),
        (TOKENS, "coordinator", "secret; the tokens that it accepts"),
        (
            WORKER_TOKEN,
            "workers",
            "secret; may lease jobs and report results",
        ),
        (
            CLIENT_TOKEN,
            "clients",
            "secret; may ask for the status and control the campaign",
        ),
        (
            CLIENT,
            "workers, clients",
            "their certificate, for --client-ca",
        ),
        (CLIENT_KEY, "workers, clients", "secret; its key"),
    ];
    for (name, place, what) in rows {
        let path = folder.join(name).display().to_string();
        // Writing to a string does not fail.
        let _ = writeln!(text, "{path:<32}  {place:<30}  {what}");
    }
    let file = |name: &str| folder.join(name).display().to_string();
    let host = hosts.first().cloned().unwrap_or_else(host_name);
    let host = if host.contains(':') {
        format!("[{host}]")
    } else {
        host
    };
    let _ = write!(
        text,
        "\nOn this machine:\n    coordinator serve CAMPAIGN.toml --db FILE --listen 0.0.0.0:7400 \
         --tls-cert {} --tls-key {} --token-file {}\n\
         On each of the others, with its files in the same place:\n    worker --connect \
         https://{host}:7400 --tls-ca {} --token-file {}\n\
         To demand certificates of them, too:\n    coordinator serve … --client-ca {}\n    \
         worker … --tls-cert {} --tls-key {}\n",
        file(SERVER),
        file(SERVER_KEY),
        file(TOKENS),
        file(CA),
        file(WORKER_TOKEN),
        file(CA),
        file(CLIENT),
        file(CLIENT_KEY),
    );
    text
}

/// The name, text and permission bits of each file.
fn contents(
    hosts: &[String],
    days: u32,
    now: SystemTime,
) -> Result<Vec<(&'static str, String, u32)>, KeygenError> {
    let worker = token(Role::Worker)?;
    let client = token(Role::Client)?;

    let mut params = certificate("Pitchline authority", &[], days, now)?;
    params.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
    params.key_usages = vec![KeyUsagePurpose::KeyCertSign, KeyUsagePurpose::CrlSign];
    let authority = CertifiedIssuer::self_signed(params, KeyPair::generate()?)?;

    let mut names = vec![
        "localhost".to_owned(),
        "127.0.0.1".to_owned(),
        "::1".to_owned(),
    ];
    for name in std::iter::once(host_name()).chain(hosts.iter().cloned()) {
        if is_host(&name) && !names.contains(&name) {
            names.push(name);
        }
    }
    let mut params = certificate("Pitchline coordinator", &names, days, now)?;
    params.extended_key_usages = vec![ExtendedKeyUsagePurpose::ServerAuth];
    let server_key = KeyPair::generate()?;
    let server = params.signed_by(&server_key, &authority)?;

    let mut params = certificate("Pitchline worker or client", &[], days, now)?;
    params.extended_key_usages = vec![ExtendedKeyUsagePurpose::ClientAuth];
    let client_key = KeyPair::generate()?;
    let client_certificate = params.signed_by(&client_key, &authority)?;

    Ok(vec![
        (CA, authority.pem(), PUBLIC),
        (CA_KEY, authority.key().serialize_pem(), SECRET),
        (SERVER, server.pem(), PUBLIC),
        (SERVER_KEY, server_key.serialize_pem(), SECRET),
        (CLIENT, client_certificate.pem(), PUBLIC),
        (CLIENT_KEY, client_key.serialize_pem(), SECRET),
        (
            TOKENS,
            format!(
                "# What the coordinator lets in: a worker's token and a client's.\n{}\n{}\n",
                worker.reveal(),
                client.reveal()
            ),
            SECRET,
        ),
        (WORKER_TOKEN, format!("{}\n", worker.reveal()), SECRET),
        (CLIENT_TOKEN, format!("{}\n", client.reveal()), SECRET),
    ])
}

pub(crate) fn token(role: Role) -> Result<Token, KeygenError> {
    let mut random = [0; TOKEN_BYTES];
    SysRng
        .try_fill_bytes(&mut random)
        .map_err(|error| KeygenError::Random(error.to_string()))?;
    Ok(Token::new(role, random))
}

/// The parameters common to all certificates.
pub(crate) fn certificate(
    name: &str,
    names: &[String],
    days: u32,
    now: SystemTime,
) -> Result<CertificateParams, KeygenError> {
    let mut params = CertificateParams::new(names.to_vec())?;
    params.distinguished_name.remove(DnType::CommonName);
    params.distinguished_name.push(DnType::CommonName, name);
    params.use_authority_key_identifier_extension = true;
    params.key_usages = vec![KeyUsagePurpose::DigitalSignature];
    // A clock before 1970 is wrong, and a certificate of that time is harmless.
    let since_1970 = now
        .duration_since(SystemTime::UNIX_EPOCH)
        .unwrap_or_default();
    let now = date_time_ymd(1970, 1, 1) + since_1970;
    params.not_before = now - CLOCK_DIFFERENCE;
    params.not_after = now + Duration::from_secs(24 * 3600) * days;
    Ok(params)
}

/// Whether a certificate can be issued for this name: an IP address, or letters, digits and hyphens
/// between dots (RFC 1123, section 2.1).
fn is_host(name: &str) -> bool {
    let label = |label: &str| {
        (1..=63).contains(&label.len())
            && label
                .bytes()
                .all(|byte| byte.is_ascii_alphanumeric() || byte == b'-')
            && !label.starts_with('-')
            && !label.ends_with('-')
    };
    name.parse::<IpAddr>().is_ok() || (name.len() <= 253 && name.split('.').all(label))
}

pub(crate) fn host_name() -> String {
    rustix::system::uname()
        .nodename()
        .to_str()
        .map_or_else(|_| "localhost".to_owned(), str::to_owned)
}

/// Creates the folder, or checks that an existing one is accessible only to its owner and has none
/// of the files. Returns whether it was created.
fn private_folder(folder: &Path) -> Result<bool, KeygenError> {
    let path = || folder.to_owned();
    match DirBuilder::new().mode(0o700).create(folder) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
            for name in FILES {
                let path = folder.join(name);
                // A dangling link counts as existing, too.
                if path.symlink_metadata().is_ok() {
                    return Err(KeygenError::Exists { path });
                }
            }
            let metadata = fs::metadata(folder).map_err(|source| KeygenError::Write {
                path: path(),
                source,
            })?;
            if metadata.mode() & 0o077 != 0 {
                return Err(KeygenError::Exposed { path: path() });
            }
            Ok(false)
        }
        Err(source) => Err(KeygenError::Write {
            path: path(),
            source,
        }),
    }
}

fn write_new(path: &Path, text: &str, mode: u32) -> Result<(), KeygenError> {
    let failed = |source: io::Error| match source.kind() {
        io::ErrorKind::AlreadyExists => KeygenError::Exists {
            path: path.to_owned(),
        },
        _ => KeygenError::Write {
            path: path.to_owned(),
            source,
        },
    };
    let mut file = OpenOptions::new()
        .write(true)
        .create_new(true)
        .mode(mode)
        .open(path)
        .map_err(failed)?;
    file.write_all(text.as_bytes())
        .and_then(|()| file.sync_all())
        .map_err(failed)
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt as _;

    use super::*;

    fn mode(path: &Path) -> u32 {
        fs::metadata(path).unwrap().mode() & 0o777
    }

    #[test]
    fn secrets_are_their_owners_alone_and_nothing_is_overwritten() {
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("keys");
        make(&folder, &[], DAYS, SystemTime::now()).unwrap();
        assert_eq!(mode(&folder), 0o700);
        let mut listed: Vec<String> = fs::read_dir(&folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        listed.sort_unstable();
        let mut expected = FILES;
        expected.sort_unstable();
        assert_eq!(listed, expected);
        for name in FILES {
            let path = folder.join(name);
            assert_eq!(mode(&path) & !PUBLIC, 0, "{name}");
            let text = fs::read_to_string(&path).unwrap();
            if text.contains("PRIVATE KEY") || text.contains("pitchline-") {
                assert_eq!(mode(&path), SECRET, "{name}");
            }
        }
        let before = fs::read(folder.join(TOKENS)).unwrap();
        let again = make(&folder, &[], DAYS, SystemTime::now()).unwrap_err();
        assert!(matches!(again, KeygenError::Exists { .. }), "{again}");
        assert_eq!(fs::read(folder.join(TOKENS)).unwrap(), before);
    }

    #[test]
    fn a_single_file_in_the_way_stops_it_and_nothing_is_left() {
        let folder = tempfile::tempdir().unwrap();
        fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o700)).unwrap();
        std::os::unix::fs::symlink("nowhere", folder.path().join(CLIENT_TOKEN)).unwrap();
        make(folder.path(), &[], DAYS, SystemTime::now()).unwrap_err();
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
        fs::remove_file(folder.path().join(CLIENT_TOKEN)).unwrap();

        fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o755)).unwrap();
        let error = make(folder.path(), &[], DAYS, SystemTime::now()).unwrap_err();
        assert!(matches!(error, KeygenError::Exposed { .. }), "{error}");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[test]
    fn two_runs_share_no_secret_and_no_secret_is_described() {
        let parent = tempfile::tempdir().unwrap();
        let folders = ["a", "b"].map(|name| parent.path().join(name));
        for folder in &folders {
            make(folder, &[], DAYS, SystemTime::now()).unwrap();
        }
        for name in FILES {
            let [a, b] = folders
                .each_ref()
                .map(|folder| fs::read_to_string(folder.join(name)).unwrap());
            assert_ne!(a, b, "{name}");
        }
        let described = describe(&folders[0], &["head.example.org".to_owned()]);
        assert!(described.contains("https://head.example.org:7400"));
        for name in FILES {
            assert!(described.contains(&folders[0].join(name).display().to_string()));
            let text = fs::read_to_string(folders[0].join(name)).unwrap();
            for line in text.lines().filter(|line| line.len() > 32) {
                assert!(!described.contains(line), "{name}");
            }
        }
    }

    #[test]
    fn only_names_of_hosts_are_taken() {
        for good in [
            "head",
            "head.example.org",
            "192.0.2.7",
            "2001:db8::1",
            "n-1",
        ] {
            assert!(is_host(good), "{good}");
        }
        for bad in [
            "",
            "a b",
            "-a",
            "a-",
            "a..b",
            "https://head",
            "head:7400",
            "*.x",
        ] {
            assert!(!is_host(bad), "{bad}");
            let parent = tempfile::tempdir().unwrap();
            let folder = parent.path().join("keys");
            let error = make(&folder, &[bad.to_owned()], DAYS, SystemTime::now()).unwrap_err();
            assert!(matches!(error, KeygenError::Host { .. }), "{error}");
            assert!(!folder.exists());
        }
    }
}
