//! The lock file: it admits one writer and records the number of acknowledged commits.
//!
//! SQLite cannot distinguish a log that was cut or removed from one that was never longer: a commit
//! whose end is missing counts as unfinished. Therefore the writer also records the number of
//! commits in the lock file, after each commit and before its acknowledgement. The record is never
//! synced: it survives the process, and after a power failure it may be behind the store, but not
//! ahead of it.

use std::fs::{self, File, TryLockError};
use std::io::{Read as _, Seek as _, Write as _};
use std::path::{Path, PathBuf};

use crate::Error;
use crate::identity;
use crate::own_file::open_own_file;
use crate::paths::beside;

/// An exclusive lock on a store, held while this value lives.
#[derive(Debug)]
pub(crate) struct Lock {
    store: PathBuf,
    path: PathBuf,
    file: File,
    /// The store's own file, locked.
    store_file: Option<File>,
}

impl Lock {
    /// Takes the lock. The lock file is never removed: otherwise two processes could lock two
    /// different files of the same name.
    pub(crate) fn take(store: &Path) -> Result<Self, Error> {
        let path = beside(store, ".lock");
        let file = open_own_file(&path, Some(store))
            .map_err(|e| Error::io("open the lock file", &path, e))?;
        restrict(&file);
        match file.try_lock() {
            Ok(()) => Ok(Self {
                store: store.to_owned(),
                path,
                file,
                store_file: None,
            }),
            Err(TryLockError::WouldBlock) => Err(Error::Locked {
                path: store.to_owned(),
            }),
            Err(TryLockError::Error(e)) => Err(Error::io("lock", &path, e)),
        }
    }

    /// Also locks the store's own file, because the lock file depends on the name, and a file can
    /// have several names.
    pub(crate) fn lock_store_file(&mut self) -> Result<(), Error> {
        identity::refuse_links(&self.store)?;
        self.store_file = identity::lock_file(&self.store)?;
        Ok(())
    }

    /// Records the number of commits.
    pub(crate) fn record(&mut self, commits: u64) -> Result<(), Error> {
        // The length is fixed, so that a shorter number leaves no digits of a longer one behind.
        let note = format!("{commits:020}\n");
        self.file
            .rewind()
            .and_then(|()| self.file.write_all(note.as_bytes()))
            .map_err(|e| Error::io("write to the lock file", &self.path, e))
    }

    /// Refuses a store that has fewer commits than were acknowledged.
    pub(crate) fn compare(&mut self, stored: u64) -> Result<(), Error> {
        let mut note = String::new();
        self.file
            .rewind()
            .and_then(|()| self.file.read_to_string(&mut note))
            .map_err(|e| Error::io("read the lock file", &self.path, e))?;
        refuse_fewer(&self.store, stored, number(&note))
    }
}

impl Drop for Lock {
    /// Unlocks the files. Closing them would not: a process that another thread starts at this moment has them open, too,
    /// until it runs its program.
    fn drop(&mut self) {
        for file in std::iter::once(&self.file).chain(&self.store_file) {
            // If that fails, the lock ends with the last process that has the file open.
            let _ = file.unlock();
        }
    }
}

/// The number of commits that a coordinator has acknowledged; 0 without a record, as beside a copy of a store.
pub(crate) fn acknowledged(store: &Path) -> u64 {
    fs::read_to_string(beside(store, ".lock")).map_or(0, |note| number(&note))
}

fn number(note: &str) -> u64 {
    // There is no record when the store was copied here.
    note.trim().parse().unwrap_or(0)
}

/// Refuses a store that has fewer commits than were acknowledged before they were counted.
pub(crate) fn refuse_fewer(store: &Path, stored: u64, acknowledged: u64) -> Result<(), Error> {
    if stored >= acknowledged {
        return Ok(());
    }
    Err(Error::MissingCommits {
        path: store.to_owned(),
        lock: beside(store, ".lock"),
        stored,
        acknowledged,
    })
}

/// Removes the permissions of other users: a user who can open the file can lock it.
fn restrict(file: &File) {
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        // A file system without permissions refuses this, and has no users to exclude.
        let _ = file.set_permissions(std::fs::Permissions::from_mode(0o600));
    }
    #[cfg(not(unix))]
    let _ = file;
}
