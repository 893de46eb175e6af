//! The worker processes that computed the rows.

use crate::Error;
use crate::connection::Connection;
use crate::row::{self, Columns, Row};

/// A worker process and its build. Rows without an origin were stored by the coordinator itself.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OriginRow {
    /// The worker's name, which is unique to its process.
    pub worker: String,
    /// The host that the worker reported, `MACHINE:PROCESS`.
    pub host: String,
    /// The build of the program.
    pub build: String,
}

/// An origin with its number.
struct NumberedOrigin<'a> {
    origin: i64,
    row: &'a OriginRow,
}

impl Row for NumberedOrigin<'_> {
    const TABLE: &'static str = "origin";

    fn key(&self) -> String {
        format!("origin {}", self.origin)
    }

    fn add_to(&self, columns: &mut Columns) {
        columns
            .bits(self.origin.cast_unsigned())
            .text(&self.row.worker)
            .text(&self.row.host)
            .text(&self.row.build);
    }
}

/// The number of an origin, which is stored if it is new.
pub(crate) async fn number(connection: &mut Connection<'_>, row: &OriginRow) -> Result<i64, Error> {
    let query = sqlx::query!(
        "SELECT origin FROM origin WHERE worker = ? AND host = ? AND build = ?",
        row.worker,
        row.host,
        row.build,
    );
    if let Some(known) = connection.optional(query).await? {
        return Ok(known.origin);
    }
    let last = sqlx::query!(r#"SELECT coalesce(max(origin), 0) AS "origin!: i64" FROM origin"#);
    let origin = connection.one(last).await?.origin + 1;
    let seal = row::seal(&NumberedOrigin { origin, row })?;
    let query = sqlx::query!(
        "INSERT INTO origin (origin, worker, host, build, seal) VALUES (?, ?, ?, ?, ?)",
        origin,
        row.worker,
        row.host,
        row.build,
        seal,
    );
    connection.execute(query).await?;
    Ok(origin)
}

/// All origins with their numbers.
pub(crate) async fn all(connection: &mut Connection<'_>) -> Result<Vec<(i64, OriginRow)>, Error> {
    let query =
        sqlx::query!("SELECT origin, worker, host, build, seal FROM origin ORDER BY origin");
    let rows = connection.all(query).await?;
    rows.into_iter()
        .map(|stored| {
            let origin = stored.origin;
            let row = OriginRow {
                worker: stored.worker,
                host: stored.host,
                build: stored.build,
            };
            connection.check(NumberedOrigin { origin, row: &row }, stored.seal)?;
            Ok((origin, row))
        })
        .collect()
}
