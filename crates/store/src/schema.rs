//! Recognises stores and their schemas, and migrates earlier schemas.

use std::fs::File;
use std::io::Read as _;
use std::path::Path;
use std::pin::Pin;

use sqlx::migrate::{MigrateError, Migrator};

use crate::check::{self, Reading};
use crate::connection::Connection;
use crate::rows::CampaignRow;
use crate::{Error, columns, fail_point, query, samples, tally};

static MIGRATOR: Migrator = sqlx::migrate!("../../migrations");

/// "PTCH", as set by the first migration.
const APPLICATION_ID: i64 = 0x5054_4348;

/// The first bytes of every SQLite file, <https://www.sqlite.org/fileformat2.html> 1.3.
const SQLITE_MAGIC: &[u8; 16] = b"SQLite format 3\0";

/// The schema that introduced tallies. The program completes its migration.
const FIRST_WITH_TALLIES: i64 = 2;

/// The schema that introduced seals. The program completes its migration.
const FIRST_WITH_SEALS: i64 = 6;

/// The schema that packs the samples of the DoE. The program completes its migration.
const FIRST_WITH_RANGES: i64 = 7;

/// The schema that replaced columns by lists of numbers. The program completes its migration.
const FIRST_WITH_LISTS: i64 = 9;

/// The schema that introduced evaluations of optimiser runs.
const FIRST_WITH_EVALUATIONS: i64 = 10;

/// The schema that introduced derivations.
const FIRST_WITH_DERIVATIONS: i64 = 12;

pub(crate) fn check_header(path: &Path) -> Result<(), Error> {
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

/// Checks that the file is a store whose schema this program knows, and returns a reading
/// connection and the schema's version.
pub(crate) async fn inspect(reading: &Reading) -> Result<(Connection<'static>, i64), Error> {
    let path = &reading.path;
    let mut connection = Connection::open(&reading.options, path).await?;
    let application_id: Vec<i64> = connection
        .pragma("read the schema", "PRAGMA application_id")
        .await?;
    let application_id = application_id.first().copied().unwrap_or(0);
    if application_id != APPLICATION_ID {
        return Err(Error::NotAStore {
            path: path.to_path_buf(),
            application_id,
        });
    }
    let migrations = query::migrations(&mut connection).await?;
    let found = migrations.last().map_or(0, |(version, _)| *version);
    let known = known();
    if found > known {
        return Err(Error::NewerSchema {
            path: path.to_path_buf(),
            found,
            known,
        });
    }
    for (version, checksum) in &migrations {
        let ours = MIGRATOR.iter().find(|m| m.version == *version);
        if ours.is_none_or(|ours| *ours.checksum != **checksum) {
            return Err(Error::Migration {
                path: path.to_path_buf(),
                source: MigrateError::VersionMismatch(*version).into(),
            });
        }
    }
    Ok((connection, found))
}

/// The campaign of a store with a known schema, and its number of commits if the schema counts
/// them.
pub(crate) async fn read(
    connection: &mut Connection<'_>,
    found: i64,
) -> Result<(CampaignRow, Option<u64>), Error> {
    let held = if found >= FIRST_WITH_SEALS {
        query::campaign(connection).await?
    } else {
        query::campaign_before_seals(connection).await?
    };
    let commits = if found >= FIRST_WITH_TALLIES {
        Some(query::commits(connection).await?)
    } else {
        None
    };
    Ok((held, commits))
}

/// Checks the rows of a store with a known schema against their digests, if it has any.
pub(crate) async fn check_rows(connection: &mut Connection<'_>, found: i64) -> Result<(), Error> {
    if found >= FIRST_WITH_EVALUATIONS {
        check::evaluations(connection).await?;
    }
    if found >= FIRST_WITH_DERIVATIONS {
        check::derivations(connection).await?;
    }
    if found >= FIRST_WITH_LISTS {
        return check::rows(connection).await;
    }
    if found >= FIRST_WITH_RANGES {
        check::samples(connection).await?;
    } else if found >= FIRST_WITH_TALLIES {
        samples::check_unpacked(connection).await?;
    }
    if found >= FIRST_WITH_SEALS {
        check::lasting_rows(connection).await?;
        columns::check(connection).await?;
    }
    Ok(())
}

pub(crate) fn known() -> i64 {
    MIGRATOR.iter().map(|m| m.version).max().unwrap_or(0)
}

/// Migrates the schema in one transaction: after an interruption the store has either the old
/// schema or the new one.
pub(crate) async fn migrate(connection: &mut Connection<'_>, found: i64) -> Result<(), Error> {
    let mut transaction = connection.begin("BEGIN IMMEDIATE").await?;
    MIGRATOR.run(transaction.sql()).await.map_err(|e| match e {
        MigrateError::Execute(e) | MigrateError::ExecuteMigration(e, _) => {
            transaction.failed("bring the schema up to date", e)
        }
        other => Error::Migration {
            path: transaction.path().to_owned(),
            source: other.into(),
        },
    })?;
    convert(&mut transaction, found).await?;
    fail_point::at("migration");
    transaction.commit().await
}

/// Converts the rows of an earlier schema.
// A boxed future is compiled once, in this crate, not in each crate that opens a store.
fn convert<'a>(
    transaction: &'a mut Connection<'_>,
    found: i64,
) -> Pin<Box<dyn Future<Output = Result<(), Error>> + Send + 'a>> {
    Box::pin(async move {
        if found < FIRST_WITH_RANGES {
            samples::pack(transaction, found >= FIRST_WITH_TALLIES).await?;
        }
        if found < FIRST_WITH_TALLIES {
            tally::fill(transaction).await?;
        }
        if found < FIRST_WITH_SEALS {
            check::seal(transaction).await?;
            columns::seal(transaction).await?;
        }
        if found < FIRST_WITH_LISTS {
            columns::convert(transaction).await?;
        }
        Ok(())
    })
}
