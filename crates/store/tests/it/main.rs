//! The store on real files.

mod bits;
mod commits;
mod crashes;
mod damage;
mod digests;
mod discarding;
mod evaluations;
mod extending;
#[cfg(unix)]
mod fail_points;
mod place;
mod ranges;
mod reading;
mod refusal;
mod rounds;
mod writing;

use std::path::{Path, PathBuf};

use ledger::StreamId;
use sqlx::Connection as _;
use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection};
use store::{
    Batch, CampaignRow, CriteriaRow, Derivation, DerivedResult, DesignRow, Error, ModelRow,
    OptimumRow, Receipt, ResponseRow, SampleBlock, Store,
};
use tempfile::TempDir;

fn campaign() -> CampaignRow {
    CampaignRow {
        name: "paper".into(),
        file_text: "# a campaign\nname = \"paper\"\n".into(),
        digest: "00ff".into(),
        // The largest seed exceeds SQLite's signed integers.
        seed: u64::MAX,
        program_version: "0.1.0".into(),
        model_digest: None,
    }
}

fn folder() -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("campaign.db");
    (folder, path)
}

async fn open(path: &Path) -> Store {
    Store::create_or_open(path, &campaign()).await.unwrap()
}

/// Creates a store with the designs `0..designs`.
async fn store_with(path: &Path, designs: u64) -> Store {
    let store = open(path).await;
    let rows: Vec<DesignRow> = (0..designs).map(design).collect();
    store.put_designs(&rows).await.unwrap();
    store
}

/// The derivation of a result from some inputs.
fn from(of: &DerivedResult) -> Derivation {
    Derivation::new(of, "0123")
}

/// Stores responses and the model of them.
async fn put_fit(store: &Store, responses: &[ResponseRow], model: &ModelRow) {
    store
        .put_responses(responses, &from(&DerivedResult::Responses))
        .await
        .unwrap();
    store
        .put_models(std::slice::from_ref(model), &from(&DerivedResult::Model))
        .await
        .unwrap();
}

async fn put_optimum(store: &Store, row: &OptimumRow) {
    let derivation = from(&DerivedResult::Optimum(row.stream));
    store.put_optimum(row, &derivation).await.unwrap();
}

fn design(design: u64) -> DesignRow {
    let x = design as f64;
    DesignRow::new(design, [x, 0.1, 1.1, 1.2, 1.3, 1.4])
}

fn of(design: u64) -> StreamId {
    StreamId::design(design as u32)
}

/// Verification samples of an approach.
const POINT: StreamId = StreamId::point(3);

fn at(stream: StreamId, sample: u64, value: f64) -> SampleBlock {
    SampleBlock {
        stream,
        first_sample: sample,
        samples: vec![value].into(),
    }
}

/// The samples of one response that a stream has, with their indices.
async fn samples_of(store: &Store, stream: StreamId) -> Result<Vec<(u64, f64)>, Error> {
    let blocks = store.blocks_of(stream).await?;
    let samples = blocks.iter().flat_map(SampleBlock::indexed);
    Ok(samples
        .map(|(sample, values)| (sample, values[0]))
        .collect())
}

/// The values of the samples of one response that a stream has.
async fn values_of(store: &Store, stream: StreamId) -> Result<Vec<f64>, Error> {
    let samples = samples_of(store, stream).await?;
    Ok(samples.into_iter().map(|(_, value)| value).collect())
}

fn sample(design: u64, sample: u64, value: f64) -> SampleBlock {
    at(of(design), sample, value)
}

fn samples(rows: impl IntoIterator<Item = SampleBlock>) -> Batch {
    Batch {
        samples: rows.into_iter().collect(),
        ..Batch::default()
    }
}

/// The receipt of a batch of the wanted generation.
fn receipt(new_rows: u64, duplicate_rows: u64) -> Receipt {
    Receipt {
        new_rows,
        duplicate_rows,
        is_stale: false,
    }
}

fn feasible(design: u64) -> CriteriaRow {
    CriteriaRow {
        design,
        simulable: true,
        reason: None,
        responses: Some(vec![
            2.25, 1.5, 1100.0, 1050.0, 250.0, 0.5, 0.6, 0.01, 0.02, 1.7, 2.9,
        ]),
    }
}

fn infeasible(design: u64) -> CriteriaRow {
    CriteriaRow {
        design,
        reason: Some("undercut: the pinion's active flank begins below its root form".into()),
        ..CriteriaRow::default()
    }
}

fn read(path: &Path) -> Vec<u8> {
    std::fs::read(path).unwrap()
}

fn beside(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(suffix);
    name.into()
}

async fn execute(path: &Path, sql: &'static str) {
    let options = SqliteConnectOptions::new()
        .filename(path)
        .create_if_missing(true);
    let mut connection = SqliteConnection::connect_with(&options).await.unwrap();
    sqlx::raw_sql(sql).execute(&mut connection).await.unwrap();
    connection.close().await.unwrap();
}
