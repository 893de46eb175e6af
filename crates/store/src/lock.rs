//! The lock file: who may write, and how many commits were acknowledged.
//!
//! SQLite cannot tell a log that was cut or removed from one that never was any longer: a commit
//! whose end is missing counts as never finished. So the writer notes its commits in the lock
//! file, too. The note is written after the commit and before the acknowledgement, and is never
//! synced: it outlives the process, and when the machine goes down it may be behind the store, but
//! not ahead of it.

use std::fs::{File, TryLockError};
use std::io::{Read as _, Seek as _, Write as _};
use std::path::{Path, PathBuf};

use crate::Error;
use crate::open::beside;
use crate::place;

/// Held for as long as this lives.
#[derive(Debug)]
pub(crate) struct Lock {
    store: PathBuf,
    path: PathBuf,
    file: File,
    /// The store's own file, locked.
    held: Option<File>,
}

impl Lock {
    /// Takes the lock. Its file stays behind when the lock goes: removing it would let two
    /// processes lock two different files of one name.
    pub(crate) fn take(store: &Path) -> Result<Self, Error> {
        let path = beside(store, ".lock");
        let file = File::options()
            .create(true)
            .truncate(false)
            .read(true)
            .write(true)
            .open(&path)
            .map_err(|e| Error::io("open the lock file", &path, e))?;
        match file.try_lock() {
            Ok(()) => Ok(Self {
                store: store.to_owned(),
                path,
                file,
                held: None,
            }),
            Err(TryLockError::WouldBlock) => Err(Error::Locked {
                path: store.to_owned(),
            }),
            Err(TryLockError::Error(e)) => Err(Error::io("lock", &path, e)),
        }
    }

    /// Locks the store's file, too: the lock file goes by the name, and a file can have several.
    pub(crate) fn hold_file(&mut self) -> Result<(), Error> {
        place::refuse_links(&self.store)?;
        self.held = place::lock_file(&self.store)?;
        Ok(())
    }

    /// Notes how many commits there are.
    pub(crate) fn record(&mut self, commits: u64) -> Result<(), Error> {
        // Always of one length, so that a shorter number leaves no digits of a longer one.
        let note = format!("{commits:020}\n");
        self.file
            .rewind()
            .and_then(|()| self.file.write_all(note.as_bytes()))
            .map_err(|e| Error::io("write to the lock file", &self.path, e))
    }

    /// Refuses a store that holds fewer commits than were acknowledged.
    pub(crate) fn compare(&mut self, held: u64) -> Result<(), Error> {
        let mut note = String::new();
        self.file
            .rewind()
            .and_then(|()| self.file.read_to_string(&mut note))
            .map_err(|e| Error::io("read the lock file", &self.path, e))?;
        // There is none when the store came from elsewhere, or from an older program.
        let acknowledged: u64 = note.trim().parse().unwrap_or(0);
        if held < acknowledged {
            return Err(Error::Behind {
                path: self.store.clone(),
                lock: self.path.clone(),
                held,
                acknowledged,
            });
        }
        Ok(())
    }
}
