//! Opening and creating a store: the checks, the creation and the lock.
//!
//! Nothing is written to a file before it has passed every check, and a new store gets its name
//! only when it is complete. A coordinator that is killed at any moment leaves either no store or
//! one that can be opened.

use std::fs::{self, File};
use std::path::Path;
use std::sync::Arc;

use sqlx::ConnectOptions as _;
use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode, SqlitePoolOptions, SqliteSynchronous};

use crate::campaign::{self, CampaignRow};
use crate::connection::{Connection, Readers, waiting};
use crate::error::BUSY_TIMEOUT;
use crate::identity::{self, FileIdentity};
use crate::integrity::{self, Integrity, ReadOptions};
use crate::lock::{self, Lock};
use crate::paths::{beside, exists, resolve};
use crate::store::Store;
use crate::{Error, commits, schema, writer};

/// Maximum size of a file that is checked before it is opened for reading. The check takes about a tenth of a second.
const CHECK_BEFORE_READING: u64 = 4 << 20;

/// Maximum size of a file that is checked before it is opened for writing. SQLite's check takes 2 ms per MiB, the
/// comparison of the rows with their digests ten times as long.
const CHECK_BEFORE_WRITING: u64 = 64 << 20;

/// Locks the file for writing and writes nothing.
const TRY_TO_WRITE: &str = "BEGIN IMMEDIATE; UPDATE campaign SET one = one; ROLLBACK";

/// Number of reading connections: for a status page, an export and a report at once, and a spare
/// one.
const READERS: u32 = 4;

/// Number of rows that a reader fetches at a time. A round trip to SQLite's thread costs more than
/// a row, and a row of samples has up to 32 KiB.
const ROW_BUFFER: usize = 64;

impl Store {
    /// Opens the store at `path` for this campaign, or creates it if the file does not exist. Like
    /// [`create_or_open_with`](Store::create_or_open_with), but refuses every other campaign.
    ///
    /// # Errors
    ///
    /// As for [`create_or_open_with`](Store::create_or_open_with).
    pub async fn create_or_open(path: &Path, campaign: &CampaignRow) -> Result<Self, Error> {
        Self::create_or_open_with(path, campaign, |_| Err(Vec::new())).await
    }

    /// Opens the store at `path` for this campaign, or creates it if the file does not exist. A
    /// store of another campaign is refused unless `may_extend` accepts that campaign; the store is
    /// then opened unchanged, and the caller [extends](Store::extend) it. The differences that
    /// `may_extend` returns become part of the error.
    ///
    /// A large file is checked in the background. Reads are allowed meanwhile, and the first write
    /// waits for the check. [`Store::checked`] returns its result.
    ///
    /// Holds an exclusive lock on `path` + `.lock` until [`Store::close`], or until the last clone
    /// of the store and of its writers is dropped and their submissions are committed. Must be
    /// called within a Tokio runtime, which then runs the writer's task.
    ///
    /// # Errors
    ///
    /// [`Error::NotADatabase`], [`Error::NotAStore`], [`Error::Damaged`], [`Error::DamagedRows`],
    /// [`Error::MissingCommits`], [`Error::Linked`], [`Error::OtherSchema`] and [`Error::OtherCampaign`]
    /// for a file that is not a sound store of this campaign, which is then left unchanged;
    /// [`Error::Locked`] while another process, or another `Store`, writes to it;
    /// [`Error::DiskFull`], [`Error::Io`] and [`Error::Sqlite`].
    pub async fn create_or_open_with(
        path: &Path,
        campaign: &CampaignRow,
        may_extend: impl Fn(&CampaignRow) -> Result<(), Vec<String>>,
    ) -> Result<Self, Error> {
        Self::create_or_open_checking(path, campaign, may_extend, CHECK_BEFORE_WRITING).await
    }

    /// Like [`Self::create_or_open_with`]; files of up to `check_at_once` bytes are checked first.
    async fn create_or_open_checking(
        path: &Path,
        campaign: &CampaignRow,
        may_extend: impl Fn(&CampaignRow) -> Result<(), Vec<String>>,
        check_at_once: u64,
    ) -> Result<Self, Error> {
        let path: Arc<Path> = resolve(path)?.into();
        // Before the lock is taken, so that a mistyped path leaves no lock file beside another
        // program's file.
        if exists(&path)? {
            schema::check_header(&path)?;
        }
        let mut lock = Lock::take(&path)?;
        if !exists(&path)? {
            create(&path, campaign, &mut lock).await?;
        }
        lock.lock_store_file()?;
        let identity = FileIdentity::of(&path)?;
        roll_back(&path).await?;
        let reading = reading(&path);
        let mut connection = schema::inspect(&reading).await?;
        let found = async {
            // A change of the journal mode writes to the file, so the file is checked first in that case, too.
            let at_once = size(&path)? <= check_at_once || !is_wal(&mut connection).await?;
            if at_once {
                integrity::check(&mut connection).await?;
            }
            let stored = campaign::read(&mut connection).await?;
            Ok((at_once, stored, commits::read(&mut connection).await?))
        }
        .await;
        let (at_once, stored, commits) = connection.closing(found).await?;
        lock.compare(commits)?;
        if stored.digest != campaign.digest
            && let Err(changes) = may_extend(&stored)
        {
            return Err(Error::other_campaign(
                &path,
                [&stored.name, &stored.digest],
                [&campaign.name, &campaign.digest],
                changes,
            ));
        }

        let options = writing(&path);
        let connection = if at_once {
            let mut connection = Connection::open(&options, &path).await?;
            // SQLite opens a file that is not writable and reports that only when a row is written.
            waiting(&path, connection.run(TRY_TO_WRITE)).await?;
            Some(connection)
        } else {
            None
        };
        let readers = readers(&reading).await?;
        let integrity = match &connection {
            Some(_) => Integrity::sound(),
            None => Integrity::in_background(reading),
        };
        let writer = writer::spawn(identity, options, connection, integrity.clone(), lock);
        Ok(Self {
            path,
            readers,
            writer: Some(writer),
            integrity,
        })
    }

    /// Opens an existing store for reading, without a lock and also while a coordinator writes to
    /// it.
    ///
    /// SQLite normally writes its index of the log (`-shm`) even then, unless it exists. In a
    /// folder that is not writable, such as an archive, the file is read without it. The log must
    /// then be empty or missing, as a coordinator leaves it at its end, and no coordinator may
    /// start meanwhile.
    ///
    /// A small store is checked first. A large one is checked when [`checked`](Store::checked) is
    /// called. Rows are compared with their digests whenever they are read.
    ///
    /// # Errors
    ///
    /// [`Error::NoStore`], [`Error::NotADatabase`], [`Error::NotAStore`], [`Error::Damaged`],
    /// [`Error::DamagedRows`], [`Error::OtherSchema`], [`Error::Linked`] while
    /// a coordinator writes to the file under another name, [`Error::UnreadLog`], [`Error::MissingCommits`], [`Error::Io`] and
    /// [`Error::Sqlite`].
    pub async fn open_read_only(path: &Path) -> Result<Self, Error> {
        if !exists(path)? {
            return Err(Error::NoStore {
                path: path.to_owned(),
            });
        }
        let path: Arc<Path> = resolve(path)?.into();
        schema::check_header(&path)?;
        identity::refuse_hidden_log(&path)?;
        // Before the commits are counted: a coordinator may add some meanwhile.
        let acknowledged = lock::acknowledged(&path);
        let mut reading = reading(&path);
        let mut connection = match schema::inspect(&reading).await {
            Err(error) if error.is_read_only_folder() => {
                let log = beside(&path, "-wal");
                if fs::metadata(&log).is_ok_and(|log| log.len() > 0) {
                    let path = path.to_path_buf();
                    return Err(Error::UnreadLog { path, log });
                }
                reading.sqlite = reading.sqlite.immutable(true);
                schema::inspect(&reading).await?
            }
            inspected => inspected?,
        };
        let is_small = size(&path)? <= CHECK_BEFORE_READING;
        let checked = match is_small {
            true => integrity::check(&mut connection).await,
            false => Ok(()),
        };
        let counted = match checked {
            Ok(()) => commits::read(&mut connection).await,
            Err(damaged) => Err(damaged),
        };
        let commits = connection.closing(counted).await?;
        lock::refuse_fewer(&path, commits, acknowledged)?;
        let integrity = match is_small {
            true => Integrity::sound(),
            false => Integrity::on_demand(reading.clone()),
        };
        let readers = readers(&reading).await?;
        Ok(Self {
            path,
            readers,
            writer: None,
            integrity,
        })
    }
}

/// Size of the file and its log, in bytes.
fn size(path: &Path) -> Result<u64, Error> {
    let file = fs::metadata(path).map_err(|e| Error::io("stat", path, e))?;
    let log = fs::metadata(beside(path, "-wal"));
    Ok(file.len() + log.map_or(0, |log| log.len()))
}

/// Builds the store under a temporary name and renames it when it is complete.
async fn create(path: &Path, campaign: &CampaignRow, lock: &mut Lock) -> Result<(), Error> {
    let log = beside(path, "-wal");
    // A reader may leave an empty log behind.
    if fs::metadata(&log).is_ok_and(|log| log.len() > 0) {
        // SQLite would replay the old log into the new file.
        return Err(Error::Damaged {
            path: path.to_owned(),
            detail: format!("its log {} is there, the file itself is not", log.display()),
        });
    }
    let draft = beside(path, ".creating");
    // Leftovers of a creation that was killed. The lock guarantees that no other process is
    // creating it.
    let companions = ["-journal", "-wal", "-shm"].map(|suffix| beside(&draft, suffix));
    for leftover in std::iter::once(&draft).chain(&companions) {
        match fs::remove_file(leftover) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => {
                return Err(Error::io("remove the unfinished store", leftover, e));
            }
            _ => {}
        }
    }
    // One file without a log, so that one rename suffices.
    let options = SqliteConnectOptions::new()
        .filename(&draft)
        .create_if_missing(true)
        .journal_mode(SqliteJournalMode::Delete)
        .synchronous(SqliteSynchronous::Full);
    let mut connection = Connection::open(&options, &draft.as_path().into()).await?;
    schema::create(&mut connection).await?;
    campaign::write(&mut connection, campaign).await?;
    // Before the rename, because a later switch creates a journal, which a kill would leave behind.
    connection.run("PRAGMA journal_mode = WAL").await?;
    connection.close().await?;
    if exists(&companions[1])? {
        return Err(Error::Damaged {
            path: draft,
            detail: "its log outlived the connection that wrote it".into(),
        });
    }
    // The record of an earlier store of this name does not apply to the new one.
    lock.record(0)?;
    fs::rename(&draft, path).map_err(|e| Error::io("move the new store to", path, e))?;
    sync_folder(path)
}

/// Syncs the folder: a rename is durable only after that.
fn sync_folder(path: &Path) -> Result<(), Error> {
    if cfg!(unix)
        && let Some(folder) = path.parent()
    {
        File::open(folder)
            .and_then(|f| f.sync_all())
            .map_err(|e| Error::io("sync the folder", folder, e))?;
    }
    Ok(())
}

/// Lets SQLite roll back a transaction that a killed process left in a rollback journal, for
/// example a switch to the write-ahead log. A reading connection cannot do that. Only stores of
/// this program are touched.
async fn roll_back(path: &Arc<Path>) -> Result<(), Error> {
    let journal = beside(path, "-journal");
    if !fs::metadata(&journal).is_ok_and(|journal| journal.len() > 0) || !schema::is_marked(path)? {
        return Ok(());
    }
    let mut connection = Connection::open(&writing(path), path).await?;
    connection
        .pragma::<i64>("SELECT count(*) FROM sqlite_schema")
        .await?;
    connection.close().await
}

async fn is_wal(connection: &mut Connection<'_>) -> Result<bool, Error> {
    let mode: Vec<String> = connection.pragma("PRAGMA journal_mode").await?;
    Ok(mode == ["wal"])
}

pub(crate) fn writing(path: &Path) -> SqliteConnectOptions {
    SqliteConnectOptions::new()
        .filename(path)
        .create_if_missing(false)
        .foreign_keys(true)
        .journal_mode(SqliteJournalMode::Wal)
        .synchronous(SqliteSynchronous::Full)
        .busy_timeout(BUSY_TIMEOUT)
        // The writer copies the log to the file itself, after the acknowledgement. With a size
        // limit of 0 the log is truncated when it restarts, so its length is the amount left to
        // copy.
        .pragma("wal_autocheckpoint", "0")
        .pragma("journal_size_limit", "0")
        .disable_statement_logging()
}

fn reading(path: &Arc<Path>) -> ReadOptions {
    let options = SqliteConnectOptions::new()
        .filename(path)
        .read_only(true)
        .busy_timeout(BUSY_TIMEOUT)
        .row_buffer_size(ROW_BUFFER)
        // Visiting all samples takes as long as the visitor takes, so slow statements are not
        // logged.
        .disable_statement_logging();
    ReadOptions {
        path: Arc::clone(path),
        sqlite: options,
    }
}

async fn readers(reading: &ReadOptions) -> Result<Readers, Error> {
    SqlitePoolOptions::new()
        .max_connections(READERS)
        .connect_with(reading.sqlite.clone())
        .await
        .map(Readers::Pool)
        .map_err(|e| Error::sqlite(&reading.path, e))
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use ledger::StreamId;

    use crate::batch::Batch;
    use crate::blocks::SampleBlock;
    use crate::designs::DesignRow;

    pub(crate) fn campaign() -> CampaignRow {
        CampaignRow {
            name: "n".into(),
            file_text: String::new(),
            digest: "d".into(),
            seed: 1,
            program_version: "0".into(),
            model_digest: None,
        }
    }

    pub(crate) fn samples(range: std::ops::Range<u64>) -> Batch {
        let block = SampleBlock {
            stream: StreamId::design(0),
            first_sample: range.start,
            samples: range.map(|_| 1.0).collect::<Vec<f64>>().into(),
        };
        Batch {
            samples: vec![block],
            ..Batch::default()
        }
    }

    /// Creates a closed store of one design with `count` samples.
    pub(crate) async fn filled(path: &Path, count: u64) {
        let store = Store::create_or_open(path, &campaign()).await.unwrap();
        let design = DesignRow::new(0, [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        store.put_designs(&[design]).await.unwrap();
        let writer = store.writer().unwrap();
        writer.submit(samples(0..count)).await.unwrap();
        store.pin_model_digest("abc").await.unwrap();
        store.close().await.unwrap();
    }

    async fn open_as_if_large(path: &Path) -> Store {
        Store::create_or_open_checking(path, &campaign(), |_| Err(Vec::new()), 0)
            .await
            .unwrap()
    }

    #[tokio::test]
    async fn a_large_store_is_checked_while_it_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("campaign.db");
        filled(&path, 10_000).await;
        let store = open_as_if_large(&path).await;
        assert_eq!(store.progress().await.unwrap().samples, 10_000);
        store.checked().await.unwrap();
        let writer = store.writer().unwrap();
        let receipt = writer.submit(samples(9_000..11_000)).await.unwrap();
        assert_eq!((receipt.new_rows, receipt.duplicate_rows), (1000, 1000));
        store.close().await.unwrap();
        assert!(!beside(&path, "-wal").exists());
    }

    #[tokio::test]
    async fn nothing_is_written_to_a_damaged_large_store() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("campaign.db");
        filled(&path, 40_000).await;
        let mut bytes = fs::read(&path).unwrap();
        // A page of samples, which opening does not read.
        let page = bytes.len() / 4096 - 20;
        bytes[page * 4096..(page + 1) * 4096].fill(0xa5);
        fs::write(&path, &bytes).unwrap();

        let store = open_as_if_large(&path).await;
        assert_eq!(store.campaign().await.unwrap().digest, "d");
        // Values that are stored already need no write.
        store.pin_model_digest("abc").await.unwrap();
        let error = store
            .writer()
            .unwrap()
            .submit(samples(50_000..50_001))
            .await
            .unwrap_err();
        assert!(matches!(error, Error::Damaged { .. }), "{error}");
        assert!(!error.is_refusal());
        let error = store.checked().await.unwrap_err();
        assert!(matches!(error, Error::Damaged { .. }), "{error}");
        store.close().await.unwrap();
        assert_eq!(fs::read(&path).unwrap(), bytes, "the file was changed");
    }

    #[tokio::test]
    async fn a_small_store_has_been_checked_when_it_is_open() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("campaign.db");
        filled(&path, 10_000).await;
        let store = Store::create_or_open(&path, &campaign()).await.unwrap();
        let checked = store.checked();
        drop(store);
        checked.await.unwrap();
    }
}
