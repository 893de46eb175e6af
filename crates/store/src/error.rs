//! The errors of a store, with their remedies.

use std::fmt::Debug;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// An error of the store.
///
/// It can be cloned because one failed commit is reported to every batch of its group.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// There is no file to read.
    #[error("there is no store at {}: run the campaign first, or check the path", path.display())]
    NoStore {
        /// The file that was looked for.
        path: PathBuf,
    },
    /// The file does not begin as SQLite files do.
    #[error(
        "{} is not an SQLite database and was left as it is: choose another file for the store",
        path.display()
    )]
    NotADatabase {
        /// The refused file.
        path: PathBuf,
    },
    /// An SQLite file of another program.
    #[error(
        "{} is a database of another program (application id {application_id:#x}) and was left as \
         it is: choose another file for the store",
        path.display()
    )]
    NotAStore {
        /// The refused file.
        path: PathBuf,
        /// The `application_id` in its header.
        application_id: i64,
    },
    /// The file fails SQLite's own checks.
    #[error(
        "the store {} is damaged ({detail}): restore a copy, or move it away to start again",
        path.display()
    )]
    Damaged {
        /// The damaged file.
        path: PathBuf,
        /// The finding of SQLite, or of the check of the files.
        detail: String,
    },
    /// Rows differ from those that were stored, or are missing or additional.
    #[error(
        "the store {} is damaged in table {table}, row {row}: {detail}; restore a copy, or move it \
         away to start again",
        path.display()
    )]
    DamagedRows {
        /// The damaged file.
        path: PathBuf,
        /// The table.
        table: &'static str,
        /// The row's key, or a description of the rows that include it.
        row: String,
        /// The difference.
        detail: String,
    },
    /// The file and its log have fewer commits than were acknowledged.
    #[error(
        "the store {} has {stored} of {acknowledged} acknowledged commits: its log (-wal) was cut \
         or removed, or an older copy was put in its place; put the newer files back, or remove {} \
         to go on with the rows that are left",
        path.display(),
        lock.display()
    )]
    MissingCommits {
        /// The refused file.
        path: PathBuf,
        /// Its lock file, which records the number of acknowledged commits.
        lock: PathBuf,
        /// Commits in the store.
        stored: u64,
        /// Commits that were acknowledged.
        acknowledged: u64,
    },
    /// Another version of the program wrote the store.
    #[error(
        "the store {} has the tables of another version of this program: use the version that made it \
         (`campaign.program_version` in the file), or start a new store",
        path.display()
    )]
    OtherSchema {
        /// The refused file.
        path: PathBuf,
    },
    /// The store belongs to another campaign.
    #[error(
        "the store {} belongs to campaign {stored}, not to {offered}{}: choose another file, or the \
         campaign file it was started with",
        path.display(),
        in_words(changes)
    )]
    OtherCampaign {
        /// The refused file.
        path: PathBuf,
        /// Name and digest of the campaign in the store.
        stored: String,
        /// Name and digest of the campaign to be run.
        offered: String,
        /// The differences between the two, if known.
        changes: Vec<String>,
    },
    /// Another process writes to the store.
    #[error("the store {} is in use by another coordinator: stop that one first", path.display())]
    Locked {
        /// The store, not its lock file.
        path: PathBuf,
    },
    /// A program that is not a coordinator holds a lock on the store's file.
    #[error(
        "the store {} has been locked by another program for {} s: close that program or end its \
         transaction; an SQLite shell or a database browser may hold one",
        path.display(),
        BUSY_TIMEOUT.as_secs()
    )]
    Busy {
        /// The store.
        path: PathBuf,
    },
    /// The store's file has several names (hard links).
    #[error(
        "the store {} is one file with {names} names (hard links), and its log belongs only to the name under \
         which it was last written: remove the other names, or copy the file and use the copy",
        path.display()
    )]
    Linked {
        /// The refused name.
        path: PathBuf,
        /// Number of names of the file.
        names: u64,
    },
    /// A file of an open store was removed or replaced.
    #[error(
        "{} was {how} while the store {} was in use: nothing more is acknowledged; put it back if \
         you moved it, else start again from a copy",
        file.display(),
        path.display()
    )]
    Lost {
        /// The store.
        path: PathBuf,
        /// The store's file or its log.
        file: PathBuf,
        /// What happened to it, as a past participle.
        how: &'static str,
    },
    /// The store has an unread log and lies in a folder that is not writable.
    #[error(
        "the store {} cannot be read where it is: {} has rows that were not moved into it, and \
         their folder may not be written to; copy both to a folder of your own and read the copy",
        path.display(),
        log.display()
    )]
    UnreadLog {
        /// The store.
        path: PathBuf,
        /// Its log.
        log: PathBuf,
    },
    /// A row or a sample was submitted again with a different value.
    #[error(
        "{row} of table {table} is stored as {stored} and was offered as {offered}: results must not depend on the \
         worker that computes them"
    )]
    Conflict {
        /// The table.
        table: &'static str,
        /// The row's key, such as "sample 3 of design-17".
        row: String,
        /// The value in the store.
        stored: String,
        /// The value that was refused.
        offered: String,
        /// The worker that computed the stored value, if the store names it.
        worker: Option<String>,
    },
    /// A sample was submitted of a design that is not in the store.
    #[error("design {design} is not in the store: store the design before its samples")]
    UnknownDesign {
        /// The design's index.
        design: u64,
    },
    /// The store was filled with another gear model.
    #[error(
        "the store was filled with model {stored}, this program has model {offered}: use the program \
         it was started with, or another store"
    )]
    ModelDigestConflict {
        /// The digest in the store.
        stored: String,
        /// The digest that was refused.
        offered: String,
    },
    /// The extended campaign has another seed, and therefore other samples.
    #[error(
        "the store's campaign has seed {stored}, the extended one has {offered}: keep the seed"
    )]
    OtherSeed {
        /// The seed in the store.
        stored: u64,
        /// The seed that was refused.
        offered: u64,
    },
    /// A number is not finite and cannot be stored.
    #[error("{column} of {key} is {value}: only finite numbers can be stored")]
    NotFinite {
        /// Table and column.
        column: String,
        /// The row's key.
        key: String,
        /// The refused value.
        value: f64,
    },
    /// A number exceeds the range of SQLite's signed integers.
    #[error(
        "{column} is {value}: the largest number that can be stored is {}",
        i64::MAX
    )]
    TooLarge {
        /// Table and column.
        column: String,
        /// The refused value.
        value: u64,
    },
    /// A row contradicts the rows it refers to, such as a sample of an unknown design.
    #[error("rows violate the schema: store the rows that they refer to first, and each row once")]
    Constraint {
        /// The error of SQLite.
        #[source]
        source: Arc<sqlx::Error>,
    },
    /// The disk is full. Nothing of the batch was stored; it can be submitted again when there is
    /// space.
    #[error("the disk is full: make room, nothing that was acknowledged is lost")]
    DiskFull {
        /// The error of SQLite.
        #[source]
        source: Arc<sqlx::Error>,
    },
    /// The store was opened for reading.
    #[error("the store was opened for reading only")]
    ReadOnly,
    /// The store was closed before the request was carried out.
    #[error("the store is closed")]
    Closed,
    /// A file operation failed.
    #[error("cannot {doing} {}", path.display())]
    Io {
        /// The operation, as a verb.
        doing: &'static str,
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        #[source]
        source: Arc<std::io::Error>,
    },
    /// Any other SQLite error.
    #[error("SQLite cannot read or write the store {}", path.display())]
    Sqlite {
        /// The store.
        path: PathBuf,
        /// The error of SQLite.
        #[source]
        source: Arc<sqlx::Error>,
    },
}

/// Time that a statement waits for a lock. The lock file keeps other coordinators out, so only another program can hold
/// a lock for long.
pub(crate) const BUSY_TIMEOUT: Duration = Duration::from_secs(120);

/// Characters of a value in a message.
const LONGEST_VALUE: usize = 1000;

// Primary result codes, https://www.sqlite.org/rescode.html
const SQLITE_ERROR: i32 = 1;
const SQLITE_BUSY: i32 = 5;
const SQLITE_READONLY: i32 = 8;
const SQLITE_CORRUPT: i32 = 11;
const SQLITE_FULL: i32 = 13;
const SQLITE_CANTOPEN: i32 = 14;
const SQLITE_CONSTRAINT: i32 = 19;
const SQLITE_NOTADB: i32 = 26;

impl Error {
    /// True when the rows themselves were refused. Submitting them again would fail in the same
    /// way, and the other batches of the group are not affected.
    pub fn is_refusal(&self) -> bool {
        matches!(
            self,
            Self::Conflict { .. }
                | Self::UnknownDesign { .. }
                | Self::ModelDigestConflict { .. }
                | Self::OtherSeed { .. }
                | Self::NotFinite { .. }
                | Self::TooLarge { .. }
                | Self::Constraint { .. }
        )
    }

    /// Whether SQLite tried to write in a place that is not writable.
    pub(crate) fn is_read_only_folder(&self) -> bool {
        matches!(
            self,
            Self::Sqlite { source, .. }
                if matches!(primary_code(source), Some(SQLITE_READONLY | SQLITE_CANTOPEN))
        )
    }

    pub(crate) fn io(doing: &'static str, path: &Path, source: std::io::Error) -> Self {
        Self::Io {
            doing,
            path: path.to_owned(),
            source: Arc::new(source),
        }
    }

    pub(crate) fn conflict(table: &'static str, row: String, values: [&dyn Debug; 2]) -> Self {
        // The result of a run can be long.
        let [stored, offered] = values.map(|value| {
            let text = format!("{value:?}");
            match text.char_indices().nth(LONGEST_VALUE) {
                Some((end, _)) => format!("{}…", &text[..end]),
                None => text,
            }
        });
        Self::Conflict {
            table,
            row,
            stored,
            offered,
            worker: None,
        }
    }

    pub(crate) fn damaged_rows(
        path: &Path,
        table: &'static str,
        row: String,
        detail: &str,
    ) -> Self {
        Self::DamagedRows {
            path: path.to_owned(),
            table,
            row,
            detail: detail.to_owned(),
        }
    }

    /// Converts an SQLite error to its variant.
    pub(crate) fn sqlite(path: &Path, source: sqlx::Error) -> Self {
        let path = path.to_owned();
        match (&source, primary_code(&source)) {
            (sqlx::Error::PoolClosed, _) => Self::Closed,
            // A value that its column cannot have, such as a negative count, cannot be decoded. The statements fit the
            // schema, so SQLite fails to understand one only if a table or a column is missing.
            (sqlx::Error::ColumnDecode { .. } | sqlx::Error::RowNotFound, _)
            | (_, Some(SQLITE_ERROR | SQLITE_CORRUPT | SQLITE_NOTADB)) => Self::Damaged {
                path,
                detail: source.to_string(),
            },
            (_, Some(SQLITE_BUSY)) => Self::Busy { path },
            (_, Some(SQLITE_FULL)) => Self::DiskFull {
                source: Arc::new(source),
            },
            (_, Some(SQLITE_CONSTRAINT)) => Self::Constraint {
                source: Arc::new(source),
            },
            _ => Self::Sqlite {
                path,
                source: Arc::new(source),
            },
        }
    }
}

fn primary_code(error: &sqlx::Error) -> Option<i32> {
    let extended: i32 = error.as_database_error()?.code()?.parse().ok()?;
    Some(extended & 0xff)
}

impl Error {
    /// The error for a store at `path` whose campaign, `stored`, is not the one `offered`; both are
    /// given as name and digest. `changes` lists the differences, if they are known.
    #[must_use]
    pub fn other_campaign(
        path: &Path,
        stored: [&str; 2],
        offered: [&str; 2],
        changes: Vec<String>,
    ) -> Self {
        let named = |[name, digest]: [&str; 2]| format!("\"{name}\" ({digest})");
        Self::OtherCampaign {
            path: path.to_path_buf(),
            stored: named(stored),
            offered: named(offered),
            changes,
        }
    }
}

/// The differences between two campaigns, as the middle of a sentence.
fn in_words(changes: &[String]) -> String {
    if changes.is_empty() {
        return String::new();
    }
    format!("; they differ in {}", changes.join("; "))
}
