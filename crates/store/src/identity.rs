//! The identity of a store's file, whatever names it has.
//!
//! SQLite derives the log's name from the name under which the file was opened. A file that is
//! opened under two names has two logs, each of which undoes the other's changes. A file that is
//! removed or replaced while it is open accepts rows that are never found again.

use std::fs::{self, File, Metadata, TryLockError};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::Error;
use crate::filesystem::network_file_system;
use crate::paths::beside;

/// A file's device and inode numbers. They are constant on systems without them.
type Id = (u64, u64);

#[cfg(unix)]
fn id(file: &Metadata) -> Id {
    use std::os::unix::fs::MetadataExt as _;
    (file.dev(), file.ino())
}

#[cfg(not(unix))]
fn id(_: &Metadata) -> Id {
    (0, 0)
}

#[cfg(unix)]
fn links(file: &Metadata) -> u64 {
    std::os::unix::fs::MetadataExt::nlink(file)
}

#[cfg(not(unix))]
fn links(_: &Metadata) -> u64 {
    1
}

/// The identities of the store's file and its log when they were opened.
#[derive(Debug)]
pub(crate) struct FileIdentity {
    path: Arc<Path>,
    log: PathBuf,
    file: Id,
    /// `None` until the log exists.
    log_file: Option<Id>,
}

impl FileIdentity {
    pub(crate) fn of(path: &Arc<Path>) -> Result<Self, Error> {
        let file = fs::metadata(path).map_err(|e| Error::io("stat", path, e))?;
        Ok(Self {
            path: Arc::clone(path),
            log: beside(path, "-wal"),
            file: id(&file),
            log_file: None,
        })
    }

    pub(crate) fn path(&self) -> &Arc<Path> {
        &self.path
    }

    /// Refuses the store if its file or its log was removed or replaced. Returns the length of the
    /// log. The log is checked only while the writer has a connection, because otherwise SQLite may
    /// remove it.
    pub(crate) fn check(&mut self, is_connected: bool) -> Result<u64, Error> {
        match fs::metadata(&self.path) {
            Ok(file) if id(&file) == self.file => {}
            Ok(_) => return Err(self.lost(&self.path, "replaced by another file")),
            Err(_) => return Err(self.lost(&self.path, "removed")),
        }
        if !is_connected {
            self.log_file = None;
            return Ok(0);
        }
        match (fs::metadata(&self.log), self.log_file) {
            (Ok(log), None) => {
                self.log_file = Some(id(&log));
                Ok(log.len())
            }
            (Ok(log), Some(known)) if id(&log) == known => Ok(log.len()),
            (Ok(_), Some(_)) => Err(self.lost(&self.log, "replaced by another file")),
            (Err(_), Some(_)) => Err(self.lost(&self.log, "removed")),
            (Err(_), None) => Ok(0),
        }
    }

    fn lost(&self, file: &Path, how: &'static str) -> Error {
        Error::Lost {
            path: self.path.to_path_buf(),
            file: file.to_owned(),
            how,
        }
    }
}

/// Refuses a file that has several names, because its log belongs to only one of them.
pub(crate) fn refuse_links(path: &Path) -> Result<(), Error> {
    let file = fs::metadata(path).map_err(|e| Error::io("stat", path, e))?;
    match links(&file) {
        0 | 1 => Ok(()),
        names => Err(Error::Linked {
            path: path.to_owned(),
            names,
        }),
    }
}

/// Locks the file itself, so that a process that opens it under another name finds it in use.
/// Returns `None` where such a lock could interfere with SQLite's own; on Linux's local file
/// systems the two are independent.
pub(crate) fn lock_file(path: &Path) -> Result<Option<File>, Error> {
    let mounts = fs::read_to_string("/proc/self/mountinfo");
    if !mounts.is_ok_and(|mounts| network_file_system(path, &mounts).is_none()) {
        return Ok(None);
    }
    let file = File::open(path).map_err(|e| Error::io("open", path, e))?;
    match file.try_lock() {
        Ok(()) => Ok(Some(file)),
        Err(TryLockError::WouldBlock) => Err(Error::Locked {
            path: path.to_owned(),
        }),
        Err(TryLockError::Error(e)) => Err(Error::io("lock", path, e)),
    }
}

/// Refuses to read a file that a coordinator is writing under another name, where the log is.
pub(crate) fn refuse_hidden_log(path: &Path) -> Result<(), Error> {
    let linked = refuse_links(path);
    if linked.is_ok() || beside(path, "-wal").exists() {
        return Ok(());
    }
    let file = File::open(path).map_err(|e| Error::io("open", path, e))?;
    match file.try_lock_shared() {
        Err(TryLockError::WouldBlock) => linked,
        _ => Ok(()),
    }
}
