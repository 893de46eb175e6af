//! Recognises stores and their schema, and makes the tables of a new one.

use std::fs::{self, File};
use std::io::Read as _;
use std::path::Path;

use sqlx::migrate::{MigrateError, Migrator};

use crate::connection::{Connection, waiting};
use crate::integrity::ReadOptions;
use crate::{Error, fail_point};

static MIGRATOR: Migrator = sqlx::migrate!("../../migrations");

/// "PTCH", as set by the schema.
const APPLICATION_ID: i64 = 0x5054_4348;

/// The first bytes of every SQLite file, <https://www.sqlite.org/fileformat2.html> 1.3.
const SQLITE_MAGIC: &[u8; 16] = b"SQLite format 3\0";

pub(crate) fn check_header(path: &Path) -> Result<(), Error> {
    // Opening a pipe waits for its other end, and opening a device may do anything.
    let file = fs::metadata(path).map_err(|e| Error::io("stat", path, e))?;
    if !file.is_file() && !file.is_dir() {
        return Err(Error::NotADatabase {
            path: path.to_owned(),
        });
    }
    let mut file = File::open(path).map_err(|e| Error::io("open", path, e))?;
    let mut head = Vec::with_capacity(SQLITE_MAGIC.len());
    file.by_ref()
        .take(SQLITE_MAGIC.len() as u64)
        .read_to_end(&mut head)
        .map_err(|e| Error::io("read", path, e))?;
    if head.is_empty() {
        // SQLite accepts an empty file as an empty database. A store is never empty, so its content
        // was lost, and starting again would hide the loss.
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

/// Whether the application id in the file's header is that of a store.
pub(crate) fn is_marked(path: &Path) -> Result<bool, Error> {
    // <https://www.sqlite.org/fileformat2.html> 1.3: a big-endian number at offset 68.
    let mut header = Vec::with_capacity(72);
    File::open(path)
        .and_then(|file| file.take(72).read_to_end(&mut header))
        .map_err(|e| Error::io("read", path, e))?;
    Ok(header
        .get(68..72)
        .is_some_and(|id| id == (APPLICATION_ID as u32).to_be_bytes()))
}

/// Checks that the file is a store with this program's schema, and returns a reading connection.
pub(crate) async fn inspect(file: &ReadOptions) -> Result<Connection<'static>, Error> {
    let mut connection = file.connect().await?;
    match recognise(&mut connection, &file.path).await {
        Ok(()) => Ok(connection),
        Err(error) => connection.closing(Err(error)).await,
    }
}

async fn recognise(connection: &mut Connection<'_>, path: &Path) -> Result<(), Error> {
    let first_read = connection.pragma("PRAGMA application_id");
    let application_id: Vec<i64> = waiting(path, first_read).await?;
    let application_id = application_id.first().copied().unwrap_or(0);
    if application_id != APPLICATION_ID {
        return Err(Error::NotAStore {
            path: path.to_path_buf(),
            application_id,
        });
    }
    let query = sqlx::query!("SELECT version, checksum FROM _sqlx_migrations ORDER BY version");
    let applied = connection.all(query).await?;
    let ours = MIGRATOR.iter().map(|m| (Some(m.version), &*m.checksum));
    if !ours.eq(applied.iter().map(|row| (row.version, &*row.checksum))) {
        return Err(Error::OtherSchema {
            path: path.to_path_buf(),
        });
    }
    Ok(())
}

/// Makes the tables of a new store, in one transaction.
pub(crate) async fn create(connection: &mut Connection<'_>) -> Result<(), Error> {
    let mut transaction = connection.begin("BEGIN IMMEDIATE").await?;
    let made = MIGRATOR.run(transaction.sql()).await;
    made.map_err(|error| match error {
        MigrateError::Execute(error) | MigrateError::ExecuteMigration(error, _) => {
            transaction.failed(error)
        }
        other => transaction.failed(other.into()),
    })?;
    fail_point::at("creation");
    transaction.commit().await
}
