//! Opening a store: what is checked before, how a new one comes into being, and who may write.
//!
//! Nothing is written to a file before it has passed every check, and a new store appears under
//! its name only when it is complete: a coordinator killed at any moment leaves either no store
//! or one that opens.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::slice;
use std::sync::Arc;
use std::time::Duration;

use sqlx::ConnectOptions as _;
use sqlx::sqlite::{
    SqliteConnectOptions, SqliteJournalMode, SqlitePool, SqlitePoolOptions, SqliteSynchronous,
};

use crate::check::{self, Pending, Reading, Verdict};
use crate::connection::Connection;
use crate::keyed;
use crate::lock::Lock;
use crate::place::{self, Place};
use crate::rows::CampaignRow;
use crate::store::Store;
use crate::{Error, schema, writer};

/// What `PRAGMA quick_check` reads in about a quarter of a second.
const CHECK_AT_ONCE: u64 = 32 << 20;

/// Whose samples are read and compared with their digest in about a tenth of a second.
const COMPARE_AT_ONCE: u64 = 4 << 20;

const LEAVE_TO_WRITE: &str = "BEGIN IMMEDIATE; UPDATE campaign SET one = one; ROLLBACK";

/// Reading connections: a status page, an export and a report at once, and one to spare.
const READERS: u32 = 4;

/// How long a statement waits for a lock. Only foreign tools can hold one for long.
const BUSY_TIMEOUT: Duration = Duration::from_secs(10);

/// Rows that a reader takes at a time: a hop between SQLite's thread and ours costs more than a row, and
/// a row of samples has up to 32 KiB.
const ROW_BUFFER: usize = 64;

impl Store {
    /// Opens the store at `path` for this campaign, or creates it when there is no such file:
    /// [`create_or_open_with`](Store::create_or_open_with), no other campaign being accepted.
    ///
    /// # Errors
    ///
    /// As there.
    pub async fn create_or_open(path: &Path, campaign: &CampaignRow) -> Result<Self, Error> {
        Self::create_or_open_with(path, campaign, |_| Err(Vec::new())).await
    }

    /// Opens the store at `path` for this campaign, or creates it when there is no such file. A
    /// store of another campaign is refused unless `may_extend` accepts the campaign it holds; it
    /// is then opened as it is, and the caller [extends](Store::extend) it. What `may_extend` refuses
    /// it for, in words, is part of the error.
    ///
    /// A file too large to be checked in a moment is checked in the background: reads go on
    /// meanwhile, the first write waits for the check of the pages. [`Store::checked`] tells the
    /// verdict on these and on the samples.
    ///
    /// Holds an exclusive lock on `path` + `.lock` until [`Store::close`], or until the last clone
    /// of the store and of its writers is dropped and what they submitted is committed. Must be
    /// called within a Tokio runtime, on which the writer's task then runs.
    ///
    /// # Errors
    ///
    /// [`Error::NotADatabase`], [`Error::NotAStore`], [`Error::Damaged`], [`Error::DamagedRows`],
    /// [`Error::Behind`], [`Error::Linked`], [`Error::NewerSchema`] and [`Error::OtherCampaign`] for a file that is not this campaign's
    /// sound store, which is then left as it was; [`Error::Locked`] while another process, or
    /// another `Store`, writes to it; [`Error::Migration`], [`Error::DiskFull`], [`Error::Io`] and [`Error::Sqlite`].
    pub async fn create_or_open_with(
        path: &Path,
        campaign: &CampaignRow,
        may_extend: impl Fn(&CampaignRow) -> Result<(), Vec<String>>,
    ) -> Result<Self, Error> {
        Self::create_or_open_checking(path, campaign, may_extend, CHECK_AT_ONCE).await
    }

    /// Files of up to `check_at_once` bytes are checked before anything else.
    async fn create_or_open_checking(
        path: &Path,
        campaign: &CampaignRow,
        may_extend: impl Fn(&CampaignRow) -> Result<(), Vec<String>>,
        check_at_once: u64,
    ) -> Result<Self, Error> {
        let path: Arc<Path> = resolve(path)?.into();
        // Before the lock, so that a mistyped path does not leave a lock file beside a stranger.
        if exists(&path)? {
            schema::check_header(&path)?;
        }
        let mut lock = Lock::take(&path)?;
        if !exists(&path)? {
            create(&path, campaign, &mut lock).await?;
        }
        lock.hold_file()?;
        let place = Place::of(&path)?;
        roll_back(&path).await?;
        let reading = reading(&path);
        let (mut connection, found) = schema::inspect(&reading).await?;
        let size = size(&path)?;
        let small = size <= check_at_once;
        let compare_at_once = size <= check_at_once.min(COMPARE_AT_ONCE);
        // An upgrade writes, and so does a change of the journal's mode.
        let at_once = small || found < schema::known() || !is_wal(&mut connection).await?;
        if at_once {
            check::quick_check(&mut connection).await?;
        }
        if compare_at_once {
            schema::check_rows(&mut connection, found).await?;
        }
        let (held, commits) = schema::read(&mut connection, found).await?;
        // The connection is closed before a refusal: the caller may replace the file after one.
        connection.close().await?;
        if let Some(commits) = commits {
            lock.compare(commits)?;
        }
        if held.digest != campaign.digest
            && let Err(changes) = may_extend(&held)
        {
            return Err(Error::other_campaign(
                &path,
                [&held.name, &held.digest],
                [&campaign.name, &campaign.digest],
                changes,
            ));
        }

        let options = writing(&path);
        let (connection, pending) = if at_once {
            let mut connection = Connection::open(&options, &path).await?;
            // SQLite opens a file that it may not write to, and complains only when a row is written.
            connection
                .run("get leave to write to its file", LEAVE_TO_WRITE)
                .await?;
            if found < schema::known() {
                schema::migrate(&mut connection, found).await?;
            }
            let pending = if compare_at_once {
                Pending::Nothing
            } else {
                Pending::Rows
            };
            (Some(connection), pending)
        } else {
            (None, Pending::PagesAndRows)
        };
        let readers = readers(&reading).await?;
        let verdict = Verdict::of(reading, pending);
        let writer = writer::spawn(place, options, connection, verdict.clone(), lock);
        Ok(Self {
            path,
            readers,
            writer: Some(writer),
            verdict,
        })
    }

    /// Opens an existing store for reading, without a lock: also while a coordinator writes to it.
    ///
    /// SQLite writes its index of the log (`-shm`) even so, unless one is there. In a folder that may
    /// not be written to, as an archive is, the file is read without it; its log must then be empty or
    /// missing, as a coordinator that ended leaves it, and no coordinator may begin meanwhile.
    ///
    /// A small store is checked first; for a large one, the check is made when
    /// [`checked`](Store::checked) is called. Rows other than samples are compared with their digests
    /// whenever they are read.
    ///
    /// # Errors
    ///
    /// [`Error::NoStore`], [`Error::NotADatabase`], [`Error::NotAStore`], [`Error::Damaged`],
    /// [`Error::DamagedRows`], [`Error::NewerSchema`], [`Error::OlderSchema`], [`Error::Linked`] while
    /// a coordinator writes to the file under another name, [`Error::UnreadLog`], [`Error::Io`] and
    /// [`Error::Sqlite`].
    pub async fn open_read_only(path: &Path) -> Result<Self, Error> {
        if !exists(path)? {
            return Err(Error::NoStore {
                path: path.to_owned(),
            });
        }
        let path: Arc<Path> = resolve(path)?.into();
        schema::check_header(&path)?;
        place::refuse_hidden_log(&path)?;
        let mut reading = reading(&path);
        let (mut connection, found) = match schema::inspect(&reading).await {
            Err(error) if error.is_read_only_folder() => {
                let log = beside(&path, "-wal");
                if fs::metadata(&log).is_ok_and(|log| log.len() > 0) {
                    let path = path.to_path_buf();
                    return Err(Error::UnreadLog { path, log });
                }
                reading.options = reading.options.immutable(true);
                schema::inspect(&reading).await?
            }
            inspected => inspected?,
        };
        let known = schema::known();
        if found < known {
            let path = path.to_path_buf();
            return Err(Error::OlderSchema { path, found, known });
        }
        let verdict = if size(&path)? <= COMPARE_AT_ONCE {
            check::quick_check(&mut connection).await?;
            check::rows(&mut connection).await?;
            check::evaluations(&mut connection).await?;
            Verdict::sound()
        } else {
            Verdict::on_demand(reading.clone())
        };
        connection.close().await?;
        let readers = readers(&reading).await?;
        Ok(Self {
            path,
            readers,
            writer: None,
            verdict,
        })
    }
}

/// One name per file, whichever symbolic links it was given by: the log goes by the name.
fn resolve(path: &Path) -> Result<PathBuf, Error> {
    let failed = |e| Error::io("find", path, e);
    if exists(path)? {
        return fs::canonicalize(path).map_err(failed);
    }
    let name = path.file_name().ok_or_else(|| {
        failed(std::io::Error::new(
            std::io::ErrorKind::InvalidInput,
            "the path has no file name: give the store's file, not a folder",
        ))
    })?;
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    Ok(fs::canonicalize(folder).map_err(failed)?.join(name))
}

fn exists(path: &Path) -> Result<bool, Error> {
    path.try_exists()
        .map_err(|e| Error::io("look for", path, e))
}

/// Of the file and of its log, in bytes.
fn size(path: &Path) -> Result<u64, Error> {
    let file = fs::metadata(path).map_err(|e| Error::io("look at", path, e))?;
    let log = fs::metadata(beside(path, "-wal"));
    Ok(file.len() + log.map_or(0, |log| log.len()))
}

/// `path` with `suffix` appended to its name, as SQLite names its own companions.
pub(crate) fn beside(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(suffix);
    PathBuf::from(name)
}

/// Builds the store under another name and moves it into place when it is complete.
async fn create(path: &Path, campaign: &CampaignRow, lock: &mut Lock) -> Result<(), Error> {
    let log = beside(path, "-wal");
    // A reader may leave an empty one behind.
    if fs::metadata(&log).is_ok_and(|log| log.len() > 0) {
        // SQLite would replay the old log into the new file.
        return Err(Error::Damaged {
            path: path.to_owned(),
            detail: format!("its log {} is there, the file itself is not", log.display()),
        });
    }
    let draft = beside(path, ".creating");
    // What a creation that was killed left behind; the lock says that nobody else is at it.
    let companions = ["-journal", "-wal", "-shm"].map(|suffix| beside(&draft, suffix));
    for leftover in std::iter::once(&draft).chain(&companions) {
        match fs::remove_file(leftover) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => {
                return Err(Error::io("remove the unfinished store", leftover, e));
            }
            _ => {}
        }
    }
    // One file, no log: renaming it is enough.
    let options = SqliteConnectOptions::new()
        .filename(&draft)
        .create_if_missing(true)
        .journal_mode(SqliteJournalMode::Delete)
        .synchronous(SqliteSynchronous::Full);
    let mut connection = Connection::open(&options, &draft.as_path().into()).await?;
    schema::migrate(&mut connection, 0).await?;
    keyed::replace(&mut connection, slice::from_ref(campaign)).await?;
    // Before it has its name: switching later takes a journal, which a kill would leave behind.
    connection
        .run("switch to a write-ahead log", "PRAGMA journal_mode = WAL")
        .await?;
    connection.close().await?;
    if exists(&companions[1])? {
        return Err(Error::Damaged {
            path: draft,
            detail: "its log outlived the connection that wrote it".into(),
        });
    }
    // What an earlier store of this name had acknowledged does not concern the new one.
    lock.record(0)?;
    fs::rename(&draft, path).map_err(|e| Error::io("move the new store to", path, e))?;
    sync_folder(path)
}

/// A rename is on disk when its folder is.
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

/// Lets SQLite undo what a process that was killed had begun under a rollback journal, as a switch to
/// the write-ahead log is: a reading connection may not. Only a store of ours is touched.
async fn roll_back(path: &Arc<Path>) -> Result<(), Error> {
    let journal = beside(path, "-journal");
    if !fs::metadata(&journal).is_ok_and(|journal| journal.len() > 0) || !schema::is_marked(path)? {
        return Ok(());
    }
    let mut connection = Connection::open(&writing(path), path).await?;
    connection
        .pragma::<i64>("undo what was begun", "SELECT count(*) FROM sqlite_schema")
        .await?;
    connection.close().await
}

async fn is_wal(connection: &mut Connection<'_>) -> Result<bool, Error> {
    let mode: Vec<String> = connection
        .pragma("read the journal's mode", "PRAGMA journal_mode")
        .await?;
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
        // The writer moves the log into the file itself, after it has acknowledged; that it
        // begins anew at no length lets its length tell how much there is to move.
        .pragma("wal_autocheckpoint", "0")
        .pragma("journal_size_limit", "0")
        .disable_statement_logging()
}

fn reading(path: &Arc<Path>) -> Reading {
    let options = SqliteConnectOptions::new()
        .filename(path)
        .read_only(true)
        .busy_timeout(BUSY_TIMEOUT)
        .row_buffer_size(ROW_BUFFER)
        // A visit of all samples takes as long as its visitor, which is no statement's fault.
        .disable_statement_logging();
    Reading {
        path: Arc::clone(path),
        options,
    }
}

async fn readers(reading: &Reading) -> Result<SqlitePool, Error> {
    SqlitePoolOptions::new()
        .max_connections(READERS)
        .connect_with(reading.options.clone())
        .await
        .map_err(|e| Error::sqlite("open its file for reading", &reading.path, e))
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::rows::{Batch, DesignRow, SampleRow};

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
        let row = |sample| SampleRow {
            design: 0,
            sample,
            delta_ste_um: 1.0,
        };
        Batch {
            samples: range.map(row).collect(),
            ..Batch::default()
        }
    }

    /// A closed store of one design with so many samples.
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
        // A page of samples: nothing on the way to opening.
        let page = bytes.len() / 4096 - 20;
        bytes[page * 4096..(page + 1) * 4096].fill(0xa5);
        fs::write(&path, &bytes).unwrap();

        let store = open_as_if_large(&path).await;
        assert_eq!(store.campaign().await.unwrap().digest, "d");
        // What is held already need not be written.
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
