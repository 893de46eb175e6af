//! The only task that writes.
//!
//! The task takes the queued batches, up to a limit, commits them in one transaction and only then
//! acknowledges each of them. Under load many batches share one sync of the disk, and an idle store
//! answers at once. The queue is bounded, so submitters wait when the disk is the bottleneck. The
//! task is independent of its callers: a caller that is cancelled while it waits does not interrupt
//! a transaction.

use std::time::Duration;

use sqlx::sqlite::SqliteConnectOptions;
use tokio::sync::{mpsc, oneshot};

use crate::batch::Batch;
use crate::change::{self, Change};
use crate::connection::Connection;
use crate::identity::FileIdentity;
use crate::integrity::Integrity;
use crate::lock::Lock;
use crate::receipt::Receipt;
use crate::{Error, commits, fail_point};

/// Number of batches in the queue before `submit` waits.
const QUEUE: usize = 1024;

/// Number of rows that closes a group. It keeps transactions, and so acknowledgements, short.
const GROUP_ROWS: usize = 20_000;

/// Interval at which an idle writer checks that its files still exist.
const LOOK: Duration = Duration::from_secs(1);

/// Length of the log, in bytes, above which it is copied to the file: a thousand pages, SQLite's
/// own default.
const LONG_LOG: u64 = 4 << 20;

/// A handle to the writing task, which its clones share.
#[derive(Debug, Clone)]
pub struct Writer {
    queue: mpsc::Sender<Command>,
}

impl Writer {
    /// Stores a batch, all or nothing, and returns when it is on disk.
    ///
    /// The first write wins: rows that are stored already with the same value are counted as
    /// duplicates. A batch for a generation that is no longer wanted stores nothing, and its
    /// receipt says so. Dropping the future after the batch was queued does not withdraw it.
    ///
    /// # Errors
    ///
    /// - [`Error::Conflict`]: a row is stored with another value. [`Error::NotFinite`],
    ///   [`Error::TooLarge`], [`Error::Constraint`]: a row cannot be stored. Other batches are not
    ///   affected, and [`Error::is_refusal`] is true.
    /// - [`Error::DiskFull`], [`Error::Sqlite`]: not acknowledged. Submitting the batch again is
    ///   safe, even if it did reach the disk.
    /// - [`Error::Closed`] after [`Store::close`](crate::Store::close).
    pub async fn submit(&self, batch: Batch) -> Result<Receipt, Error> {
        self.put(Change::Batch(batch)).await
    }

    pub(crate) async fn put(&self, change: Change) -> Result<Receipt, Error> {
        let (ack, answer) = oneshot::channel();
        self.queue
            .send(Command::Write {
                change: Box::new(change),
                ack,
            })
            .await
            .map_err(|_| Error::Closed)?;
        answer.await.map_err(|_| Error::Closed)?
    }

    /// Waits until the task has committed everything that was queued before, and has ended.
    pub(crate) async fn close(&self) -> Result<(), Error> {
        let (ack, answer) = oneshot::channel();
        if self.queue.send(Command::Close { ack }).await.is_err() {
            // The writer was closed before.
            return Ok(());
        }
        answer.await.unwrap_or(Ok(()))
    }
}

#[derive(Debug)]
enum Command {
    Write {
        change: Box<Change>,
        ack: Ack,
    },
    Close {
        ack: oneshot::Sender<Result<(), Error>>,
    },
}

type Ack = oneshot::Sender<Result<Receipt, Error>>;

/// Starts the writing task. It owns the lock, so that the lock is held until after the last commit.
pub(crate) fn spawn(
    identity: FileIdentity,
    options: SqliteConnectOptions,
    connection: Option<Connection<'static>>,
    integrity: Integrity,
    lock: Lock,
) -> Writer {
    let (queue, commands) = mpsc::channel(QUEUE);
    let task = Task {
        identity,
        options,
        connection,
        integrity,
        lock,
    };
    tokio::spawn(task.run(commands));
    Writer { queue }
}

struct Task {
    identity: FileIdentity,
    options: SqliteConnectOptions,
    /// `None` before the file was checked, and after a failed transaction, whose state is
    /// unknown.
    connection: Option<Connection<'static>>,
    integrity: Integrity,
    lock: Lock,
}

impl Task {
    async fn run(mut self, mut commands: mpsc::Receiver<Command>) {
        let mut closing = None;
        while closing.is_none() {
            let mut command = match tokio::time::timeout(LOOK, commands.recv()).await {
                Ok(Some(command)) => command,
                Ok(None) => break,
                Err(_) => {
                    // The error reaches the callers through the integrity.
                    let _ = self.check_identity();
                    continue;
                }
            };
            let mut group = Vec::new();
            let mut rows_in_group = 0;
            loop {
                match command {
                    Command::Write { change, ack } => {
                        rows_in_group += change.len();
                        group.push((*change, ack));
                    }
                    Command::Close { ack } => {
                        closing = Some(ack);
                        break;
                    }
                }
                if rows_in_group >= GROUP_ROWS {
                    break;
                }
                match commands.try_recv() {
                    Ok(next) => command = next,
                    Err(_) => break,
                }
            }
            if !group.is_empty() {
                self.commit(group, rows_in_group).await;
            }
        }
        let result = self.finish().await;
        drop(self.lock);
        if let Some(ack) = closing {
            // The caller of `close` may have stopped waiting.
            let _ = ack.send(result);
        }
    }

    async fn commit(&mut self, group: Vec<(Change, Ack)>, rows: usize) {
        let batches = group.len();
        let (group, acks): (Vec<Change>, Vec<Ack>) = group.into_iter().unzip();
        let answers = match self.transaction(&group).await {
            Ok(answers) => {
                tracing::debug!(batches, rows, "group committed");
                answers
            }
            Err(error) => {
                if let Some(connection) = self.connection.take() {
                    // Closing rolls back. Its error would only repeat the first one.
                    let _ = connection.close().await;
                }
                vec![Err(error); batches]
            }
        };
        for (ack, answer) in acks.into_iter().zip(answers) {
            // A caller that stopped waiting submits again, and its rows then count as duplicates.
            let _ = ack.send(answer);
        }
        self.shorten_log().await;
    }

    /// Copies the log to the file when it has grown long. No caller waits for this.
    async fn shorten_log(&mut self) {
        let long = self.identity.check(self.connection.is_some());
        let long = long.is_ok_and(|log| log > LONG_LOG);
        let Some(connection) = self.connection.as_mut().filter(|_| long) else {
            return;
        };
        fail_point::at("checkpoint");
        // Passive: the part that readers still need stays in the log until another time.
        let result = connection.run("PRAGMA wal_checkpoint(PASSIVE)").await;
        if let Err(error) = result {
            // Nothing is lost: the log still holds the rows.
            tracing::warn!(%error, "the log could not be moved into the store's file");
        }
    }

    /// Runs one transaction. The outer error means that nothing was stored, an inner one that a
    /// batch was refused and the others were stored.
    async fn transaction(
        &mut self,
        group: &[Change],
    ) -> Result<Vec<Result<Receipt, Error>>, Error> {
        self.integrity.clone().checked().await?;
        // Before a connection is opened under the name.
        self.check_identity()?;
        let connection = match &mut self.connection {
            Some(connection) => connection,
            none => none.insert(Connection::open(&self.options, self.identity.path()).await?),
        };
        // Immediate: a deferred transaction that starts to write can fail with
        // SQLITE_BUSY_SNAPSHOT, to which the busy timeout does not apply.
        let mut transaction = connection.begin("BEGIN IMMEDIATE").await?;
        let mut answers = Vec::with_capacity(group.len());
        for run in group.chunk_by(|a, b| a.is_batch() && b.is_batch()) {
            // All rows are stored together first; if that is refused, each batch is stored
            // separately.
            let mut pieces = vec![run];
            while let Some(changes) = pieces.pop() {
                match change::make(&mut transaction, changes).await? {
                    Ok(receipts) => answers.extend(receipts.into_iter().map(Ok)),
                    Err(_) if changes.len() > 1 => pieces.extend(changes.chunks(1).rev()),
                    Err(refusal) => answers.push(Err(refusal)),
                }
            }
        }
        let commits = commits::count(&mut transaction).await?;
        fail_point::at("before_commit");
        transaction.commit().await?;
        // The files are checked again before the rows are acknowledged.
        self.check_identity()?;
        if let Err(error) = self.lock.record(commits) {
            // The rows are stored; only a later check for a cut log misses this commit.
            tracing::warn!(%error, "the number of commits could not be written to the lock file");
        }
        fail_point::at("after_commit");
        Ok(answers)
    }

    fn check_identity(&mut self) -> Result<(), Error> {
        let result = self.identity.check(self.connection.is_some()).map(drop);
        if let Err(lost) = &result {
            self.integrity.conclude(Err(lost.clone()));
        }
        result
    }

    async fn finish(&mut self) -> Result<(), Error> {
        // Nothing was written, or a transaction failed: the next opening replays the log.
        let Some(mut connection) = self.connection.take() else {
            return Ok(());
        };
        fail_point::at("checkpoint");
        // A reader elsewhere may keep part of the log in use. The statement reports that in its
        // row, not as an error, and the only cost is the log's size: not worth a long wait.
        connection
            .run("PRAGMA busy_timeout = 10000; PRAGMA wal_checkpoint(TRUNCATE)")
            .await?;
        connection.close().await
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::sync::Arc;

    use super::*;
    use crate::open;
    use crate::open::tests::{campaign, filled, samples};
    use crate::store::Store;

    #[tokio::test]
    async fn a_full_disk_loses_nothing_that_was_acknowledged() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("campaign.db");
        filled(&path, 100).await;
        let path: Arc<Path> = path.into();

        // Space for ten more pages of 4096 bytes, or some 5000 samples.
        let pages = std::fs::metadata(&path).unwrap().len() / 4096 + 10;
        let options = open::writing(&path).pragma("max_page_count", pages.to_string());
        let connection = Connection::open(&options, &path).await.unwrap();
        let lock = Lock::take(&path).unwrap();
        let writer = spawn(
            FileIdentity::of(&path).unwrap(),
            options,
            Some(connection),
            Integrity::sound(),
            lock,
        );
        let error = writer.submit(samples(100..20_000)).await.unwrap_err();
        assert!(matches!(error, Error::DiskFull { .. }), "{error}");
        assert!(!error.is_refusal(), "the batch may be submitted again");
        assert_eq!(
            writer.submit(samples(100..200)).await.unwrap().new_rows,
            100
        );
        writer.close().await.unwrap();

        let store = Store::create_or_open(&path, &campaign()).await.unwrap();
        let stored = store.first_samples_of(ledger::StreamId::design(0), 1).await;
        assert_eq!(stored.unwrap().len(), 200);
    }

    #[tokio::test]
    async fn a_lock_of_another_program_that_is_not_released_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("campaign.db");
        filled(&path, 1).await;
        let path: Arc<Path> = path.into();
        let options = open::writing(&path).busy_timeout(Duration::ZERO);
        let mut other = Connection::open(&options, &path).await.unwrap();
        let lock = other.begin("BEGIN EXCLUSIVE").await.unwrap();
        let mut own = Connection::open(&options, &path).await.unwrap();
        let error = own.begin("BEGIN IMMEDIATE").await.unwrap_err();
        assert!(matches!(error, Error::Busy { .. }), "{error}");
        lock.commit().await.unwrap();
        own.begin("BEGIN IMMEDIATE").await.unwrap();
    }
}
