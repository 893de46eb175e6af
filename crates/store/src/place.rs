//! Which file a store is, whatever names it has.
//!
//! SQLite finds a store's log by the name under which the file was opened. A file that is opened
//! under two names has two logs, of which each undoes what the other holds; one that is removed or
//! replaced while it is open takes rows that nobody finds again.

use std::fs::{self, File, Metadata, TryLockError};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::Error;
use crate::filesystem::network_file_system;
use crate::open::beside;

/// A file's device and its number there; always equal where the system has no such numbers.
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

/// The store's file and its log, as they were when they were opened.
#[derive(Debug)]
pub(crate) struct Place {
    path: Arc<Path>,
    log: PathBuf,
    file: Id,
    /// `None` until there is one.
    log_file: Option<Id>,
}

impl Place {
    pub(crate) fn of(path: &Arc<Path>) -> Result<Self, Error> {
        let file = fs::metadata(path).map_err(|e| Error::io("look at", path, e))?;
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

    /// Refuses when another file, or none, has the name of the store or of its log. Returns the
    /// length of the log. While the writer has no connection, SQLite may remove the log by itself.
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

/// Refuses a file that has several names, since only one of them leads to its log.
pub(crate) fn refuse_links(path: &Path) -> Result<(), Error> {
    let file = fs::metadata(path).map_err(|e| Error::io("look at", path, e))?;
    match links(&file) {
        0 | 1 => Ok(()),
        names => Err(Error::Linked {
            path: path.to_owned(),
            names,
        }),
    }
}

/// Locks the file itself, so that whoever opens it by another name finds it in use. `None` where
/// such a lock could be mixed up with SQLite's own: these are different things on Linux's local file
/// systems.
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

/// Refuses to read a file that a coordinator writes to under another name, with its log there.
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
