//! The one task that writes.
//!
//! It takes what is queued, up to a limit, commits it in one transaction and only then
//! acknowledges each batch: under load many batches share one sync of the disk, and an idle store
//! answers at once. The queue is bounded, which makes whoever submits wait when the disk is the
//! bottleneck. The task is nobody's child: a caller that goes away while it waits does not stop a
//! transaction half-way.

use std::fs::File;
use std::path::PathBuf;

use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection};
use sqlx::{Connection as _, Executor as _};
use tokio::sync::{mpsc, oneshot};

use crate::rows::{Batch, DesignRow, ModelRow, OptimumRow, Receipt, ResponseRow};
use crate::{Error, insert, open};

/// Batches that wait for the writer before `submit` makes its callers wait.
const QUEUE: usize = 256;

/// A group is closed when it has this many rows: what keeps acknowledgements from waiting for
/// ever longer transactions.
const GROUP_ROWS: usize = 20_000;

/// A handle of the writing task; clones share it.
#[derive(Debug, Clone)]
pub struct Writer {
    queue: mpsc::Sender<Command>,
}

impl Writer {
    /// Stores a batch, all of it or nothing, and returns when it is on disk.
    ///
    /// First write wins: rows that are held already, with the same value, are counted as
    /// duplicates. Dropping the future once the batch is queued does not withdraw it.
    ///
    /// # Errors
    ///
    /// - [`Error::Conflict`], [`Error::VerifyConflict`], [`Error::CriteriaConflict`],
    ///   [`Error::RunConflict`]: held with another value. [`Error::NotFinite`],
    ///   [`Error::TooLarge`], [`Error::Constraint`]: cannot be stored. Other batches are not
    ///   concerned; [`Error::is_refusal`] is true.
    /// - [`Error::DiskFull`], [`Error::Sqlite`]: not acknowledged. Submitting the batch again is
    ///   safe, also when it did reach the disk after all.
    /// - [`Error::Closed`] after [`Store::close`](crate::Store::close).
    pub async fn submit(&self, batch: Batch) -> Result<Receipt, Error> {
        self.put(Rows::Batch(batch)).await
    }

    pub(crate) async fn put(&self, rows: Rows) -> Result<Receipt, Error> {
        let (ack, answer) = oneshot::channel();
        self.queue
            .send(Command::Write { rows, ack })
            .await
            .map_err(|_| Error::Closed)?;
        answer.await.map_err(|_| Error::Closed)?
    }

    /// Waits until the task has committed what was queued before, and has ended.
    pub(crate) async fn close(&self) -> Result<(), Error> {
        let (ack, answer) = oneshot::channel();
        if self.queue.send(Command::Close { ack }).await.is_err() {
            // Closed before: nothing left to do.
            return Ok(());
        }
        answer.await.unwrap_or(Ok(()))
    }
}

/// What one transaction may consist of.
#[derive(Debug)]
pub(crate) enum Rows {
    Batch(Batch),
    Designs(Vec<DesignRow>),
    Responses(Vec<ResponseRow>),
    Model(ModelRow),
    Optimum(OptimumRow),
    ModelDigest(String),
}

impl Rows {
    fn len(&self) -> usize {
        match self {
            Self::Batch(batch) => batch.len(),
            Self::Designs(rows) => rows.len(),
            Self::Responses(rows) => rows.len(),
            Self::Model(_) | Self::Optimum(_) | Self::ModelDigest(_) => 1,
        }
    }
}

#[derive(Debug)]
enum Command {
    Write {
        rows: Rows,
        ack: Ack,
    },
    Close {
        ack: oneshot::Sender<Result<(), Error>>,
    },
}

type Ack = oneshot::Sender<Result<Receipt, Error>>;

/// Starts the writing task. It owns the lock, so that the lock outlives the last commit.
pub(crate) fn spawn(
    path: PathBuf,
    options: SqliteConnectOptions,
    connection: SqliteConnection,
    lock: File,
) -> Writer {
    let (queue, commands) = mpsc::channel(QUEUE);
    let task = Task {
        path,
        options,
        connection: Some(connection),
    };
    tokio::spawn(task.run(commands, lock));
    Writer { queue }
}

struct Task {
    path: PathBuf,
    options: SqliteConnectOptions,
    /// `None` after a failed transaction, of whose state nothing is then assumed.
    connection: Option<SqliteConnection>,
}

impl Task {
    async fn run(mut self, mut commands: mpsc::Receiver<Command>, lock: File) {
        let mut closing = None;
        while closing.is_none() {
            let Some(mut command) = commands.recv().await else {
                break;
            };
            let mut group = Vec::new();
            let mut rows_in_group = 0;
            loop {
                match command {
                    Command::Write { rows, ack } => {
                        rows_in_group += rows.len();
                        group.push((rows, ack));
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
        drop(lock);
        if let Some(ack) = closing {
            // Whoever closed may have stopped waiting.
            let _ = ack.send(result);
        }
    }

    async fn commit(&mut self, group: Vec<(Rows, Ack)>, rows: usize) {
        let batches = group.len();
        let (group, acks): (Vec<Rows>, Vec<Ack>) = group.into_iter().unzip();
        let answers = match self.transaction(&group).await {
            Ok(answers) => answers,
            Err(error) => {
                if let Some(connection) = self.connection.take() {
                    // Rolls back. Its error would only repeat the one at hand.
                    let _ = connection.close().await;
                }
                vec![Err(error); batches]
            }
        };
        tracing::debug!(batches, rows, "group committed");
        for (ack, answer) in acks.into_iter().zip(answers) {
            // A caller that stopped waiting asks again, and is then told of duplicates.
            let _ = ack.send(answer);
        }
    }

    /// One transaction. The outer error means that nothing was stored; an inner one that one
    /// batch was refused and the others were stored.
    async fn transaction(&mut self, group: &[Rows]) -> Result<Vec<Result<Receipt, Error>>, Error> {
        let path = &self.path;
        let failed = |doing| move |e| Error::sqlite(doing, path, e);
        let connection = match &mut self.connection {
            Some(connection) => connection,
            none => none.insert(open::connect(&self.options, path).await?),
        };
        // Immediate: a deferred transaction that turns into a writing one can fail with
        // SQLITE_BUSY_SNAPSHOT, for which the busy timeout does not wait.
        connection
            .execute("BEGIN IMMEDIATE")
            .await
            .map_err(failed("begin a transaction"))?;
        let mut answers = Vec::with_capacity(group.len());
        for rows in group {
            connection
                .execute("SAVEPOINT batch")
                .await
                .map_err(failed("set a savepoint"))?;
            let answer = match rows {
                Rows::Batch(batch) => insert::batch(connection, path, batch).await,
                Rows::Designs(rows) => insert::designs(connection, path, rows).await,
                Rows::Responses(rows) => insert::responses(connection, path, rows).await,
                Rows::Model(row) => insert::model(connection, path, row).await,
                Rows::Optimum(row) => insert::optimum(connection, path, row).await,
                Rows::ModelDigest(digest) => insert::model_digest(connection, path, digest).await,
            };
            match &answer {
                Ok(_) => {}
                Err(error) if error.is_refusal() => {
                    connection
                        .execute("ROLLBACK TO batch")
                        .await
                        .map_err(failed("go back to a savepoint"))?;
                }
                Err(error) => return Err(error.clone()),
            }
            connection
                .execute("RELEASE batch")
                .await
                .map_err(failed("release a savepoint"))?;
            answers.push(answer);
        }
        connection
            .execute("COMMIT")
            .await
            .map_err(failed("commit"))?;
        Ok(answers)
    }

    async fn finish(&mut self) -> Result<(), Error> {
        // After a failed transaction the log is left to the next opening.
        let Some(mut connection) = self.connection.take() else {
            return Ok(());
        };
        // A reader elsewhere may keep part of the log in use: that is reported in the
        // statement's row, not as an error, and costs nothing but the log's size.
        connection
            .execute("PRAGMA wal_checkpoint(TRUNCATE)")
            .await
            .map_err(|e| Error::sqlite("move the log into its file", &self.path, e))?;
        connection
            .close()
            .await
            .map_err(|e| Error::sqlite("close its file", &self.path, e))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rows::{CampaignRow, SampleRow};
    use crate::store::Store;

    fn samples(range: std::ops::Range<u64>) -> Batch {
        let samples = range
            .map(|sample| SampleRow {
                design: 0,
                sample,
                delta_ste_um: 1.0,
            })
            .collect();
        Batch {
            samples,
            ..Batch::default()
        }
    }

    #[tokio::test]
    async fn a_full_disk_loses_nothing_that_was_acknowledged() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("campaign.db");
        let campaign = CampaignRow {
            name: "n".into(),
            file_text: String::new(),
            digest: "d".into(),
            seed: 1,
            program_version: "0".into(),
            model_digest: None,
        };
        let store = Store::create_or_open(&path, &campaign).await.unwrap();
        let design = DesignRow {
            design: 0,
            x_p: 0.0,
            x_r: 0.0,
            ha0_p: 0.0,
            ha0_r: 0.0,
            hf0_p: 0.0,
            hf0_r: 0.0,
        };
        store.put_designs(&[design]).await.unwrap();
        store
            .writer()
            .unwrap()
            .submit(samples(0..100))
            .await
            .unwrap();
        store.close().await.unwrap();

        // Room for ten more pages of 4096 bytes: some 2000 samples.
        let pages = std::fs::metadata(&path).unwrap().len() / 4096 + 10;
        let options = open::writing(&path).pragma("max_page_count", pages.to_string());
        let connection = open::connect(&options, &path).await.unwrap();
        let lock = File::create(folder.path().join("lock")).unwrap();
        let writer = spawn(path.clone(), options, connection, lock);
        let error = writer.submit(samples(100..20_000)).await.unwrap_err();
        assert!(matches!(error, Error::DiskFull { .. }), "{error}");
        assert!(!error.is_refusal(), "the batch may be submitted again");
        assert_eq!(
            writer.submit(samples(100..200)).await.unwrap().new_rows,
            100
        );
        writer.close().await.unwrap();

        let store = Store::create_or_open(&path, &campaign).await.unwrap();
        assert_eq!(store.samples_of(0).await.unwrap().len(), 200);
    }
}
