//! Opening a store: which files are refused, how a new one comes into being, and who may write.
//!
//! Nothing is written to a file before it has passed every check, and a new store appears under
//! its name only when it is complete: a coordinator killed at any moment leaves either no store
//! or one that opens.

use std::fs::{self, File, TryLockError};
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

use sqlx::Connection as _;
use sqlx::migrate::Migrator;
use sqlx::sqlite::{
    SqliteConnectOptions, SqliteConnection, SqliteJournalMode, SqlitePool, SqlitePoolOptions,
    SqliteSynchronous,
};

use crate::rows::CampaignRow;
use crate::store::Store;
use crate::{Error, insert, query, writer};

static MIGRATOR: Migrator = sqlx::migrate!("../../migrations");

/// "PTCH", as the first migration sets it.
const APPLICATION_ID: i64 = 0x5054_4348;

/// How every SQLite file begins, <https://www.sqlite.org/fileformat2.html> 1.3.
const SQLITE_MAGIC: &[u8; 16] = b"SQLite format 3\0";

/// Reading connections: a status page, an export and a report at once, and one to spare.
const READERS: u32 = 4;

/// How long a statement waits for a lock. Only foreign tools can hold one for long.
const BUSY_TIMEOUT: Duration = Duration::from_secs(10);

/// A sample's row is small, the hop between SQLite's thread and ours is not.
const ROW_BUFFER: usize = 1024;

impl Store {
    /// Opens the store at `path` for this campaign, or creates it when there is no such file.
    ///
    /// Holds an exclusive lock on `path` + `.lock` until [`Store::close`], or until the last clone
    /// of the store and of its writers is dropped and what they submitted is committed. Must be
    /// called within a Tokio runtime, on which the writer's task then runs.
    ///
    /// # Errors
    ///
    /// [`Error::NotADatabase`], [`Error::NotAStore`], [`Error::Damaged`], [`Error::NewerSchema`]
    /// and [`Error::OtherCampaign`] for a file that is not this campaign's sound store, which is
    /// then left as it was; [`Error::Locked`] while another process, or another `Store`, writes to
    /// it; [`Error::Migration`], [`Error::DiskFull`], [`Error::Io`] and [`Error::Sqlite`].
    pub async fn create_or_open(path: &Path, campaign: &CampaignRow) -> Result<Self, Error> {
        let path = resolve(path)?;
        // Before the lock, so that a mistyped path does not leave a lock file beside a stranger.
        if exists(&path)? {
            check_header(&path)?;
        }
        let lock = lock(&path)?;
        if !exists(&path)? {
            create(&path, campaign).await?;
        }
        let (mut connection, _) = inspect(&path).await?;
        quick_check(&mut connection, &path).await?;
        let held = query::campaign(&mut connection, &path).await?;
        close(connection, &path).await?;
        if held.digest != campaign.digest {
            return Err(Error::OtherCampaign {
                path,
                held_name: held.name,
                held_digest: held.digest,
                offered_name: campaign.name.clone(),
                offered_digest: campaign.digest.clone(),
            });
        }

        let options = writing(&path);
        let mut connection = connect(&options, &path).await?;
        migrate(&mut connection, &path).await?;
        let readers = readers(&path).await?;
        let writer = writer::spawn(path.clone(), options, connection, lock);
        Ok(Self {
            path,
            readers,
            writer: Some(writer),
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

/// `path` with `suffix` appended to its name, as SQLite names its own companions.
fn beside(path: &Path, suffix: &str) -> PathBuf {
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

/// The lock file stays behind when the lock goes: removing it would let two processes lock two
/// different files of one name.
fn lock(path: &Path) -> Result<File, Error> {
    let lock_path = beside(path, ".lock");
    let file = File::options()
        .create(true)
        .truncate(false)
        .write(true)
        .open(&lock_path)
        .map_err(|e| Error::io("open the lock file", &lock_path, e))?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => Err(Error::Locked {
            path: path.to_owned(),
        }),
        Err(TryLockError::Error(e)) => Err(Error::io("lock", &lock_path, e)),
    }
}

/// Builds the store under another name and moves it into place when it is complete.
async fn create(path: &Path, campaign: &CampaignRow) -> Result<(), Error> {
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
    for leftover in [draft.clone(), beside(&draft, "-journal")] {
        match fs::remove_file(&leftover) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => {
                return Err(Error::io("remove the unfinished store", &leftover, e));
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
    migrate(&mut connection, &draft).await?;
    insert::campaign(&mut connection, &draft, campaign).await?;
    close(connection, &draft).await?;
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
    let found = query::schema_version(&mut connection)
        .await
        .map_err(failed)?;
    let known = known_schema();
    if found > known {
        return Err(Error::NewerSchema {
            path: path.to_owned(),
            found,
            known,
        });
    }
    Ok((connection, found))
}

fn known_schema() -> i64 {
    MIGRATOR.iter().map(|m| m.version).max().unwrap_or(0)
}

async fn quick_check(connection: &mut SqliteConnection, path: &Path) -> Result<(), Error> {
    let findings: Vec<String> = sqlx::query_scalar("PRAGMA quick_check(1)")
        .fetch_all(connection)
        .await
        .map_err(|e| Error::sqlite("check its file", path, e))?;
    if findings != ["ok"] {
        return Err(Error::Damaged {
            path: path.to_owned(),
            detail: findings.join("; "),
        });
    }
    Ok(())
}

async fn migrate(connection: &mut SqliteConnection, path: &Path) -> Result<(), Error> {
    use sqlx::migrate::MigrateError;
    MIGRATOR.run(connection).await.map_err(|e| match e {
        MigrateError::Execute(e) | MigrateError::ExecuteMigration(e, _) => {
            Error::sqlite("bring the schema up to date", path, e)
        }
        other => Error::Migration {
            path: path.to_owned(),
            source: other.into(),
        },
    })
}

pub(crate) fn writing(path: &Path) -> SqliteConnectOptions {
    SqliteConnectOptions::new()
        .filename(path)
        .create_if_missing(false)
        .foreign_keys(true)
        .journal_mode(SqliteJournalMode::Wal)
        .synchronous(SqliteSynchronous::Full)
        .busy_timeout(BUSY_TIMEOUT)
}

fn reading(path: &Path) -> SqliteConnectOptions {
    SqliteConnectOptions::new()
        .filename(path)
        .read_only(true)
        .busy_timeout(BUSY_TIMEOUT)
        .row_buffer_size(ROW_BUFFER)
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
