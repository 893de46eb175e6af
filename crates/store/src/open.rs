//! Opening a store: which files are refused, how a new one comes into being, and who may write.
//!
//! Nothing is written to a file before it has passed every check, and a new store appears under
//! its name only when it is complete: a coordinator killed at any moment leaves either no store
//! or one that opens.

use std::fs::{self, File};
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

use sqlx::migrate::{MigrateError, Migrator};
use sqlx::sqlite::{
    SqliteConnectOptions, SqliteConnection, SqliteJournalMode, SqlitePool, SqlitePoolOptions,
    SqliteSynchronous,
};
use sqlx::{ConnectOptions as _, Connection as _, Executor as _};

use crate::check::{self, Pending, Verdict};
use crate::lock::Lock;
use crate::rows::CampaignRow;
use crate::store::Store;
use crate::{Error, failpoints, insert, query, tally, writer};

static MIGRATOR: Migrator = sqlx::migrate!("../../migrations");

/// "PTCH", as the first migration sets it.
const APPLICATION_ID: i64 = 0x5054_4348;

/// How every SQLite file begins, <https://www.sqlite.org/fileformat2.html> 1.3.
const SQLITE_MAGIC: &[u8; 16] = b"SQLite format 3\0";

/// What `PRAGMA quick_check` reads in about a quarter of a second.
const CHECK_AT_ONCE: u64 = 32 << 20;

/// Whose samples are read and compared with their digest in about a quarter of a second.
const COMPARE_AT_ONCE: u64 = 4 << 20;

/// The schema that brought tallies, which its migration leaves in part to the program.
const FIRST_WITH_TALLIES: i64 = 2;

/// Reading connections: a status page, an export and a report at once, and one to spare.
const READERS: u32 = 4;

/// How long a statement waits for a lock. Only foreign tools can hold one for long.
const BUSY_TIMEOUT: Duration = Duration::from_secs(10);

/// A sample's row is small, the hop between SQLite's thread and ours is not.
const ROW_BUFFER: usize = 1024;

impl Store {
    /// Opens the store at `path` for this campaign, or creates it when there is no such file:
    /// [`create_or_open_with`](Store::create_or_open_with), no other campaign being accepted.
    ///
    /// # Errors
    ///
    /// As there.
    pub async fn create_or_open(path: &Path, campaign: &CampaignRow) -> Result<Self, Error> {
        Self::create_or_open_with(path, campaign, |_| false).await
    }

    /// Opens the store at `path` for this campaign, or creates it when there is no such file. A
    /// store of another campaign is refused unless `may_extend` accepts the campaign it holds; it
    /// is then opened as it is, and the caller [extends](Store::extend) it.
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
    /// [`Error::NotADatabase`], [`Error::NotAStore`], [`Error::Damaged`], [`Error::Behind`],
    /// [`Error::NewerSchema`] and [`Error::OtherCampaign`] for a file that is not this campaign's
    /// sound store, which is then left as it was; [`Error::Locked`] while another process, or
    /// another `Store`, writes to it; [`Error::Migration`], [`Error::DiskFull`], [`Error::Io`] and [`Error::Sqlite`].
    pub async fn create_or_open_with(
        path: &Path,
        campaign: &CampaignRow,
        may_extend: impl Fn(&CampaignRow) -> bool,
    ) -> Result<Self, Error> {
        Self::create_or_open_checking(path, campaign, may_extend, CHECK_AT_ONCE).await
    }

    /// Files of up to `check_at_once` bytes are checked before anything else.
    async fn create_or_open_checking(
        path: &Path,
        campaign: &CampaignRow,
        may_extend: impl Fn(&CampaignRow) -> bool,
        check_at_once: u64,
    ) -> Result<Self, Error> {
        let path = resolve(path)?;
        // Before the lock, so that a mistyped path does not leave a lock file beside a stranger.
        if exists(&path)? {
            check_header(&path)?;
        }
        let mut lock = Lock::take(&path)?;
        if !exists(&path)? {
            create(&path, campaign, &mut lock).await?;
        }
        roll_back(&path).await?;
        let (mut connection, found) = inspect(&path).await?;
        let size = size(&path)?;
        let small = size <= check_at_once;
        let compare_at_once = size <= check_at_once.min(COMPARE_AT_ONCE);
        // An upgrade writes, and so does a change of the journal's mode.
        let at_once = small || found < known_schema() || !is_wal(&mut connection, &path).await?;
        if at_once {
            check::quick_check(&mut connection, &path).await?;
        }
        if found >= FIRST_WITH_TALLIES && compare_at_once {
            check::samples(&mut connection, &path).await?;
        }
        let held = query::campaign(&mut connection, &path).await?;
        if found >= FIRST_WITH_TALLIES {
            lock.compare(query::commits(&mut connection, &path).await?)?;
        }
        close(connection, &path).await?;
        if held.digest != campaign.digest && !may_extend(&held) {
            return Err(Error::OtherCampaign {
                path,
                held_name: held.name,
                held_digest: held.digest,
                offered_name: campaign.name.clone(),
                offered_digest: campaign.digest.clone(),
            });
        }

        let options = writing(&path);
        let (connection, pending) = if at_once {
            let mut connection = connect(&options, &path).await?;
            // SQLite opens a file that it may not write to, and complains only later.
            connection
                .execute("BEGIN IMMEDIATE; ROLLBACK")
                .await
                .map_err(|e| Error::sqlite("get leave to write to its file", &path, e))?;
            if found < known_schema() {
                migrate(&mut connection, &path, found).await?;
            }
            let pending = if compare_at_once {
                Pending::Nothing
            } else {
                Pending::Samples
            };
            (Some(connection), pending)
        } else {
            (None, Pending::PagesAndSamples)
        };
        let verdict = Verdict::of(path.clone(), pending);
        let readers = readers(&path).await?;
        let writer = writer::spawn(path.clone(), options, connection, verdict.clone(), lock);
        Ok(Self {
            path,
            readers,
            writer: Some(writer),
            verdict,
        })
    }

    /// Opens an existing store for reading, without a lock: also while a coordinator writes to it.
    ///
    /// SQLite needs to write its index of the log (`-shm`) even so, unless one is there: the
    /// folder has to be writable when no coordinator runs.
    ///
    /// # Errors
    ///
    /// [`Error::NoStore`], [`Error::NotADatabase`], [`Error::NotAStore`], [`Error::Damaged`],
    /// [`Error::NewerSchema`], [`Error::OlderSchema`], [`Error::Io`] and [`Error::Sqlite`].
    /// Damage that is not on the way to the first rows shows only when it is read.
    pub async fn open_read_only(path: &Path) -> Result<Self, Error> {
        if !exists(path)? {
            return Err(Error::NoStore {
                path: path.to_owned(),
            });
        }
        let path = resolve(path)?;
        check_header(&path)?;
        let (connection, found) = inspect(&path).await?;
        close(connection, &path).await?;
        let known = known_schema();
        if found < known {
            return Err(Error::OlderSchema { path, found, known });
        }
        let readers = readers(&path).await?;
        Ok(Self {
            path,
            readers,
            writer: None,
            verdict: Verdict::sound(),
        })
    }
}

/// One name per file, whichever way it was given: the lock goes by the name.
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

fn check_header(path: &Path) -> Result<(), Error> {
    let mut file = File::open(path).map_err(|e| Error::io("open", path, e))?;
    let mut head = Vec::with_capacity(SQLITE_MAGIC.len());
    file.by_ref()
        .take(SQLITE_MAGIC.len() as u64)
        .read_to_end(&mut head)
        .map_err(|e| Error::io("read", path, e))?;
    if head.is_empty() {
        // SQLite takes an empty file for an empty database. A store is never empty, so this is
        // what is left of one: starting afresh would hide the loss.
        return Err(Error::Damaged {
            path: path.to_owned(),
            detail: "the file is empty".into(),
        });
    }
    if head != SQLITE_MAGIC {
        return Err(Error::NotADatabase {
            path: path.to_owned(),
        });
    }
    Ok(())
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
    let mut connection = connect(&options, &draft).await?;
    migrate(&mut connection, &draft, 0).await?;
    insert::campaign(&mut connection, &draft, campaign).await?;
    // Before it has its name: switching later takes a journal, which a kill would leave behind.
    sqlx::query("PRAGMA journal_mode = WAL")
        .execute(&mut connection)
        .await
        .map_err(|e| Error::sqlite("switch to a write-ahead log", &draft, e))?;
    close(connection, &draft).await?;
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
async fn roll_back(path: &Path) -> Result<(), Error> {
    let journal = beside(path, "-journal");
    if !fs::metadata(&journal).is_ok_and(|journal| journal.len() > 0) || !is_marked(path)? {
        return Ok(());
    }
    let mut connection = connect(&writing(path), path).await?;
    sqlx::query_scalar::<_, i64>("SELECT count(*) FROM sqlite_schema")
        .fetch_one(&mut connection)
        .await
        .map_err(|e| Error::sqlite("undo what was begun", path, e))?;
    close(connection, path).await
}

/// Whether the file's header names it a store.
fn is_marked(path: &Path) -> Result<bool, Error> {
    // <https://www.sqlite.org/fileformat2.html> 1.3: a big-endian number at offset 68.
    let mut header = Vec::with_capacity(72);
    File::open(path)
        .and_then(|file| file.take(72).read_to_end(&mut header))
        .map_err(|e| Error::io("read", path, e))?;
    Ok(header
        .get(68..72)
        .is_some_and(|id| id == (APPLICATION_ID as u32).to_be_bytes()))
}

/// Checks that the file is a store whose schema this program knows, and returns a reading
/// connection and the schema's version.
async fn inspect(path: &Path) -> Result<(SqliteConnection, i64), Error> {
    let mut connection = connect(&reading(path), path).await?;
    let failed = |e| Error::sqlite("read the schema", path, e);
    let application_id: i64 = sqlx::query_scalar("PRAGMA application_id")
        .fetch_one(&mut connection)
        .await
        .map_err(failed)?;
    if application_id != APPLICATION_ID {
        return Err(Error::NotAStore {
            path: path.to_owned(),
            application_id,
        });
    }
    let migrations = query::migrations(&mut connection).await.map_err(failed)?;
    let found = migrations.last().map_or(0, |(version, _)| *version);
    let known = known_schema();
    if found > known {
        return Err(Error::NewerSchema {
            path: path.to_owned(),
            found,
            known,
        });
    }
    for (version, checksum) in &migrations {
        let ours = MIGRATOR.iter().find(|m| m.version == *version);
        if ours.is_none_or(|ours| *ours.checksum != **checksum) {
            return Err(Error::Migration {
                path: path.to_owned(),
                source: MigrateError::VersionMismatch(*version).into(),
            });
        }
    }
    Ok((connection, found))
}

async fn is_wal(connection: &mut SqliteConnection, path: &Path) -> Result<bool, Error> {
    let mode: String = sqlx::query_scalar("PRAGMA journal_mode")
        .fetch_one(connection)
        .await
        .map_err(|e| Error::sqlite("read the journal's mode", path, e))?;
    Ok(mode == "wal")
}

fn known_schema() -> i64 {
    MIGRATOR.iter().map(|m| m.version).max().unwrap_or(0)
}

/// Brings the schema up to date, in one transaction: whatever happens meanwhile, the store has
/// either its old schema or the new one.
async fn migrate(connection: &mut SqliteConnection, path: &Path, found: i64) -> Result<(), Error> {
    let failed = |e| Error::sqlite("bring the schema up to date", path, e);
    let mut transaction = connection
        .begin_with("BEGIN IMMEDIATE")
        .await
        .map_err(failed)?;
    MIGRATOR.run(&mut *transaction).await.map_err(|e| match e {
        MigrateError::Execute(e) | MigrateError::ExecuteMigration(e, _) => failed(e),
        other => Error::Migration {
            path: path.to_owned(),
            source: other.into(),
        },
    })?;
    if found < FIRST_WITH_TALLIES {
        tally::fill(&mut transaction, path).await?;
    }
    failpoints::at("store::migration");
    transaction.commit().await.map_err(failed)
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

pub(crate) fn reading(path: &Path) -> SqliteConnectOptions {
    SqliteConnectOptions::new()
        .filename(path)
        .read_only(true)
        .busy_timeout(BUSY_TIMEOUT)
        .row_buffer_size(ROW_BUFFER)
        // A visit of all samples takes as long as its visitor, which is no statement's fault.
        .disable_statement_logging()
}

async fn readers(path: &Path) -> Result<SqlitePool, Error> {
    SqlitePoolOptions::new()
        .max_connections(READERS)
        .connect_with(reading(path))
        .await
        .map_err(|e| Error::sqlite("open its file for reading", path, e))
}

pub(crate) async fn connect(
    options: &SqliteConnectOptions,
    path: &Path,
) -> Result<SqliteConnection, Error> {
    SqliteConnection::connect_with(options)
        .await
        .map_err(|e| Error::sqlite("open its file", path, e))
}

async fn close(connection: SqliteConnection, path: &Path) -> Result<(), Error> {
    connection
        .close()
        .await
        .map_err(|e| Error::sqlite("close its file", path, e))
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
        Store::create_or_open_checking(path, &campaign(), |_| false, 0)
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
        filled(&path, 10_000).await;
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
            .submit(samples(20_000..20_001))
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
