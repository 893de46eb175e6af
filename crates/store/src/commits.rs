//! The number of commits, which the lock file records, too.

use crate::Error;
use crate::connection::Connection;

pub(crate) async fn read(connection: &mut Connection<'_>) -> Result<u64, Error> {
    let query = sqlx::query!(r#"SELECT commits AS "commits: u64" FROM commit_tally"#);
    let row = connection.one(query).await?;
    Ok(row.commits)
}

/// Counts a commit, in the commit's own transaction.
pub(crate) async fn count(connection: &mut Connection<'_>) -> Result<u64, Error> {
    let query = sqlx::query!(
        r#"UPDATE commit_tally SET commits = commits + 1 RETURNING commits AS "commits: u64""#
    );
    let row = connection.one(query).await?;
    Ok(row.commits)
}
