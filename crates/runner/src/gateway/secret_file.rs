//! Files that only their owner can read.
//!
//! Secrets come only from such files. Everybody on a machine can see a command line, and every child
//! process inherits the environment, so both contain only the files' names.

use std::fs::{self, File};
use std::io::{self, Read as _, Write as _};
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};

use crate::gateway::error::Error;

/// Maximum size of a file, in bytes.
const LARGEST: u64 = 1 << 20;

/// Reads the file at `path`.
pub(crate) fn read(path: &Path) -> Result<String, Error> {
    let unreadable = |reason: io::Error| match reason.kind() {
        io::ErrorKind::NotFound => Error::NoAccess {
            place: format!("at {}", path.display()),
        },
        _ => Error::Unreadable {
            path: path.to_owned(),
            reason,
        },
    };
    let file = File::open(path).map_err(unreadable)?;
    // The mode is that of the open file, since its name may refer to another file a moment later.
    let mode = file.metadata().map_err(unreadable)?.mode() & 0o777;
    if mode & 0o077 != 0 {
        return Err(Error::Exposed {
            path: path.to_owned(),
            mode,
        });
    }
    let mut text = String::new();
    file.take(LARGEST)
        .read_to_string(&mut text)
        .map_err(unreadable)?;
    Ok(text)
}

/// Opens the file at `path` for a lock; creates it if it does not exist.
pub(crate) fn open(path: &Path) -> Result<File, Error> {
    store::open_own_file(path, None).map_err(|reason| write_error(path, reason))
}

/// Rewrites the file at `path` in place, so that a lock on it stays. The file is not emptied in between: if the process
/// is killed, the old or the new text remains, provided that both have the same length.
pub(crate) fn write(path: &Path, text: &str) -> Result<(), Error> {
    let mut file = open(path)?;
    file.write_all(text.as_bytes())
        .and_then(|()| file.set_len(text.len() as u64))
        .and_then(|()| file.sync_all())
        .map_err(|reason| write_error(path, reason))
}

/// Replaces the file at `path`, so that a reader finds the old text or the new one.
pub(crate) fn replace(path: &Path, text: &str) -> Result<(), Error> {
    let draft: PathBuf = path.with_extension("part");
    // A leftover of a killed coordinator, or a name that somebody else prepared.
    let _ = fs::remove_file(&draft);
    write(&draft, text)?;
    fs::rename(&draft, path).map_err(|reason| write_error(path, reason))
}

pub(crate) fn write_error(path: &Path, reason: io::Error) -> Error {
    Error::Write {
        path: path.to_owned(),
        reason,
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt as _;

    use super::*;

    #[test]
    fn a_file_that_others_can_read_is_refused_with_the_remedy() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("c.access");
        write(&path, "hunter2").unwrap();
        let chmod = |mode| fs::set_permissions(&path, fs::Permissions::from_mode(mode)).unwrap();
        for mode in [0o640, 0o604, 0o660, 0o644, 0o610, 0o601] {
            chmod(mode);
            let error = read(&path).unwrap_err();
            let text = format!("{error} {error:?}");
            assert!(text.contains(&format!("{mode:03o}")), "{text}");
            assert!(
                error
                    .to_string()
                    .ends_with(&format!("chmod 600 {}", path.display()))
            );
            assert!(!text.contains("hunter2"), "{text}");
        }
        for mode in [0o600, 0o400] {
            chmod(mode);
            assert_eq!(read(&path).unwrap(), "hunter2");
        }
    }

    #[test]
    fn a_written_file_is_the_owners_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("c.access");
        for (write, text) in [(write as fn(&Path, &str) -> _, "a"), (replace, "b")] {
            write(&path, text).unwrap();
            assert_eq!(fs::metadata(&path).unwrap().mode() & 0o777, 0o600);
            assert_eq!(read(&path).unwrap(), text);
        }
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    /// In a folder that others can write to.
    #[test]
    fn a_secret_is_not_written_into_a_file_that_was_prepared() {
        let folder = tempfile::tempdir().unwrap();
        let [path, draft, other] =
            ["c.access", "c.part", "other"].map(|name| folder.path().join(name));
        fs::write(&other, "").unwrap();
        fs::set_permissions(&other, fs::Permissions::from_mode(0o666)).unwrap();
        std::os::unix::fs::symlink(&other, &draft).unwrap();
        replace(&path, "hunter2").unwrap();
        assert_eq!(read(&path).unwrap(), "hunter2");
        fs::remove_file(&path).unwrap();
        std::os::unix::fs::symlink(&other, &path).unwrap();
        let error = write(&path, "hunter2").unwrap_err().to_string();
        assert!(error.contains("symbolic link"), "{error}");
        assert_eq!(fs::read(&other).unwrap(), b"");
    }
}
