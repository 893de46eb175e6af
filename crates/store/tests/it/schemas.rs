//! Stores of earlier schemas are migrated with all their rows.
//!
//! The program whose newest schema was N made `tests/fixtures/schema-N.db`, with the rows below.
//! Before a migration is added, make the fixture of the present schema with
//! `cargo test --release --workspace --test it -- --ignored makes_the_fixture`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use sqlx::Connection as _;
use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection, SqliteJournalMode};
use store::{
    Batch, Derived, DesignRow, Error, FailureKind, FailureRow, JobTimeRow, ModelRow,
    OptimiserRunRow, OptimumRow, ResponseRow, SampleRow, StageTimeRow, Store, VerifyRow,
};

use crate::evaluations::{self, evaluation};
use crate::rounds::{new_round, round};
use crate::{
    beside, campaign, design, execute, feasible, folder, from, infeasible, newest_migration, open,
    optimum_of, read,
};

const DESIGNS: u64 = 12;

/// The samples: design 0 is refused, 1 has none, 2 has gaps, and design d from 3 on has `0..3 * d`.
fn all_samples() -> Vec<SampleRow> {
    let of = |design: u64| match design {
        0 | 1 => vec![],
        2 => vec![3, 5, 6, 41],
        _ => (0..design * 3).collect(),
    };
    (0..DESIGNS)
        .flat_map(|design| {
            of(design).into_iter().map(move |sample| SampleRow {
                design,
                sample,
                delta_ste_um: 0.5 + (design * 100 + sample) as f64 / 7.0,
            })
        })
        .collect()
}

fn all_rows() -> Batch {
    let approaches = ["deterministic", "kriging", "simulator"];
    Batch {
        criteria: (0..DESIGNS - 1)
            .map(|d| if d == 0 { infeasible(d) } else { feasible(d) })
            .collect(),
        samples: all_samples(),
        verify: (0..30)
            .map(|i| VerifyRow {
                approach: approaches[(i % 2) as usize].into(),
                sample: i / 2,
                delta_ste_um: 1.0 / (i + 1) as f64,
            })
            .collect(),
        runs: (0..6)
            .map(|i| OptimiserRunRow {
                approach: approaches[(i % 3) as usize].into(),
                start: i / 3,
                result_json: format!("{{\"run\":{i}}}"),
                simulator_calls: 100 * i,
                cpu_seconds: 0.125 * i as f64,
            })
            .collect(),
        times: (0..10)
            .map(|i| JobTimeRow {
                job: i << 60 | i,
                cpu_seconds: 0.5 * i as f64,
            })
            .collect(),
        failures: (0..4)
            .map(|i| FailureRow {
                job: format!("sample-{}", i / 2),
                attempt: i % 2 + 1,
                worker: format!("w{i}"),
                serial: None,
                kind: [
                    FailureKind::Crash,
                    FailureKind::Failure,
                    FailureKind::Quarantine,
                ][i as usize % 3],
                error: format!("no load path in sample {i}\nat mesh position 3"),
                at_unix_ms: (i > 0).then_some(1_700_000_000_000 + i64::from(i)),
            })
            .collect(),
        evaluations: vec![],
        derivations: vec![],
        only_for: None,
    }
}

fn all_designs() -> Vec<DesignRow> {
    (0..DESIGNS).map(design).collect()
}

fn all_responses() -> Vec<ResponseRow> {
    (3..DESIGNS)
        .map(|design| ResponseRow {
            design,
            mean_um: design as f64,
            sd_um: 0.25,
            p90_um: design as f64 + 0.5,
            p90_variance_um2: 0.01,
            lilliefors_p: (design % 2 == 0).then_some(0.3),
        })
        .collect()
}

fn the_model() -> ModelRow {
    ModelRow {
        name: "p90".into(),
        json: "{\"theta\":[1.5,0.25]}".into(),
        summary_json: "{\"points\":9}".into(),
    }
}

fn the_optimum() -> OptimumRow {
    OptimumRow {
        approach: "kriging".into(),
        x_json: "{\"x_p\":0.5}".into(),
        criterion_um: 0.8,
        feasible: true,
        criteria_json: "{}".into(),
        simulator_calls: 1200,
        cpu_seconds: 9.25,
        note: "at a bound".into(),
    }
}

pub(crate) fn fixture(schema: i64) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/fixtures/schema-{schema}.db"))
}

#[tokio::test]
async fn every_released_schema_is_brought_up_to_date() {
    for schema in 1..=newest_migration() {
        let (_folder, path) = folder();
        std::fs::copy(fixture(schema), &path).unwrap();
        let reader = Store::open_read_only(&path).await;
        if schema < newest_migration() {
            let error = reader.expect_err("a reader may not migrate");
            assert!(
                matches!(error, Error::OlderSchema { found, .. } if found == schema),
                "{error}"
            );
        }
        let store = open(&path).await;
        holds_every_row(&store).await;
        holds_rounds(&store, schema >= 3).await;
        holds_evaluations(&store, schema >= 10).await;
        holds_stage_times(&store, schema >= 11).await;
        holds_derivations(&store, schema >= 12).await;
        store.close().await.unwrap();
        // The store needs only one migration, and can now be opened for reading.
        let store = Store::open_read_only(&path).await.unwrap();
        holds_every_row(&store).await;
        holds_rounds(&store, schema >= 3).await;
        holds_evaluations(&store, schema >= 10).await;
    }
}

/// A store of a former schema does not know what its results were computed from.
async fn holds_derivations(store: &Store, has_any: bool) {
    let held = store.derivations().await.unwrap();
    let expected = [
        "model",
        "optimum kriging",
        "responses",
        "round 0",
        "round 1",
    ];
    let expected = if has_any { &expected[..] } else { &[] };
    assert_eq!(held.keys().collect::<Vec<_>>(), expected);
}

/// A store of a former schema has none, and takes them.
async fn holds_stage_times(store: &Store, has_any: bool) {
    let held = store.stage_times().await.unwrap();
    if has_any {
        assert_eq!(held, [stage_time(2.5)]);
    } else {
        assert_eq!(held, []);
        store.put_stage_time(&stage_time(1.0)).await.unwrap();
        store.put_stage_time(&stage_time(2.5)).await.unwrap();
        assert_eq!(store.stage_times().await.unwrap(), [stage_time(2.5)]);
    }
}

fn stage_time(wall_seconds: f64) -> StageTimeRow {
    StageTimeRow {
        stage: "sample".into(),
        wall_seconds,
    }
}

async fn holds_evaluations(store: &Store, has_any: bool) {
    let expected = evaluation(7);
    let held = store.evaluations(&expected.stream, 0).await.unwrap();
    let expected: Vec<_> = has_any.then_some(expected).into_iter().collect();
    assert_eq!(held, expected);
}

async fn holds_rounds(store: &Store, has_any: bool) {
    let rounds: Vec<_> = if has_any {
        (0..2).map(|round| new_round(round, &[])).collect()
    } else {
        Vec::new()
    };
    let rows: Vec<_> = rounds.iter().map(|round| round.row.clone()).collect();
    assert_eq!(store.rounds().await.unwrap(), rows);
    let points: Vec<_> = rounds.into_iter().flat_map(|round| round.infill).collect();
    assert_eq!(store.infill().await.unwrap(), points);
}

pub(crate) async fn holds_every_row(store: &Store) {
    let rows = all_rows();
    let held = store.campaign().await.unwrap();
    assert_eq!(held.model_digest.as_deref(), Some("abc"));
    assert_eq!((held.seed, held.name), (u64::MAX, campaign().name));
    assert_eq!(store.designs().await.unwrap(), all_designs());
    assert_eq!(store.criteria().await.unwrap(), rows.criteria);
    let mut visited = Vec::new();
    store
        .visit_samples(|row| {
            visited.push(row);
            Ok::<(), Error>(())
        })
        .await
        .unwrap();
    assert_eq!(visited, rows.samples);
    for approach in ["deterministic", "kriging"] {
        let expected: Vec<&VerifyRow> = rows
            .verify
            .iter()
            .filter(|row| row.approach == approach)
            .collect();
        let held = store.verify_samples(approach).await.unwrap();
        assert_eq!(held.iter().collect::<Vec<_>>(), expected);
    }
    assert_eq!(store.responses().await.unwrap(), all_responses());
    assert_eq!(store.models().await.unwrap(), [the_model()]);
    assert_eq!(store.optima().await.unwrap(), [the_optimum()]);
    let mut runs = rows.runs;
    runs.sort_by(|a, b| (&a.approach, a.start).cmp(&(&b.approach, b.start)));
    assert_eq!(store.optimiser_runs().await.unwrap(), runs);
    let mut times = store.job_times().await.unwrap();
    times.sort_by_key(|time| time.job);
    assert_eq!(times, rows.times);
    assert_eq!(store.failures().await.unwrap(), rows.failures);

    // Compares the tallies with the rows.
    let counts: Vec<(u64, u64)> = (0..DESIGNS)
        .map(|design| {
            let of = rows.samples.iter().filter(|row| row.design == design);
            (design, of.count() as u64)
        })
        .collect();
    assert_eq!(store.sampled_counts().await.unwrap(), counts);
    assert_eq!(
        store.verify_counts().await.unwrap(),
        [("deterministic".to_owned(), 15), ("kriging".to_owned(), 15)]
    );
    let progress = store.progress().await.unwrap();
    assert_eq!(progress.samples, rows.samples.len() as u64);
    assert_eq!(progress.verify_samples, 30);
    assert_eq!(progress.failures, 4);
    let groups: Vec<_> = store
        .failure_groups()
        .await
        .unwrap()
        .into_iter()
        .map(|group| (group.kind, group.cause, group.count, group.last_worker))
        .collect();
    let group = |kind, count, worker: &str| {
        let cause = "no load path in sample #".to_owned();
        (kind, cause, count, worker.to_owned())
    };
    assert_eq!(
        groups,
        [
            group(FailureKind::Crash, 2, "w3"),
            group(FailureKind::Failure, 1, "w1"),
            group(FailureKind::Quarantine, 1, "w2"),
        ]
    );
    assert_eq!(
        store.samples_digest().await.unwrap(),
        store.recompute_samples_digest().await.unwrap()
    );
    let missing = store.missing_work(9, &BTreeMap::new()).await.unwrap();
    let gaps: Vec<(u64, Vec<(u64, u64)>)> = missing
        .iter()
        .map(|work| {
            let ranges = work.samples.iter().map(|gap| (gap.start, gap.end));
            (work.design.design, ranges.collect())
        })
        .collect();
    assert_eq!(
        gaps,
        [
            (1, vec![(0, 9)]),
            (2, vec![(0, 3), (4, 5), (7, 9)]),
            // A design without criteria.
            (11, vec![]),
        ]
    );
}

#[tokio::test]
async fn an_upgrade_that_fails_leaves_the_store_as_it_was() {
    let (_folder, path) = folder();
    std::fs::copy(fixture(1), &path).unwrap();
    // The table conflicts with the last statement of the second migration.
    execute(&path, "CREATE TABLE failure_tally (kind)").await;
    let error = Store::create_or_open(&path, &campaign()).await.unwrap_err();
    assert!(error.to_string().contains("up to date"), "{error}");
    let reader = Store::open_read_only(&path).await.unwrap_err();
    assert!(
        matches!(reader, Error::OlderSchema { found: 1, .. }),
        "{reader}"
    );
    execute(&path, "DROP TABLE failure_tally").await;
    holds_every_row(&open(&path).await).await;
}

/// The samples of an earlier schema are compared with their digest before they are packed.
#[tokio::test]
async fn a_store_of_an_earlier_schema_that_was_edited_is_left_as_it_was() {
    let edits = [
        (
            "one of all",
            "UPDATE sample SET delta_ste_um = 1.25 WHERE design = 5 AND sample = 7",
        ),
        (
            "design 5",
            "DELETE FROM sample WHERE design = 5 AND sample = 7",
        ),
        (
            "design 5",
            "UPDATE sample SET design = 1 WHERE design = 5 AND sample = 7",
        ),
    ];
    for schema in 2..=6 {
        for (row, edit) in edits {
            let (_folder, path) = folder();
            std::fs::copy(fixture(schema), &path).unwrap();
            execute(&path, edit).await;
            let before = read(&path);
            let error = Store::create_or_open(&path, &campaign()).await.unwrap_err();
            let place = format!("table sample, row {row}");
            assert!(error.to_string().contains(&place), "{error}");
            assert_eq!(read(&path), before);
        }
    }
}

#[tokio::test]
async fn an_upgrade_that_was_killed_is_begun_anew() {
    let (folder, path) = folder();
    std::fs::copy(fixture(1), &path).unwrap();
    // Part of the store is in the log, with pages written there before any commit, as in a large
    // upgrade.
    let options = SqliteConnectOptions::new()
        .filename(&path)
        .journal_mode(SqliteJournalMode::Wal)
        .pragma("cache_size", "1");
    let mut connection = SqliteConnection::connect_with(&options).await.unwrap();
    let begun = format!(
        "BEGIN IMMEDIATE; {} UPDATE sample SET delta_ste_um = 0; UPDATE campaign SET digest = 'x';",
        include_str!("../../../../migrations/0002_tallies.sql")
    );
    sqlx::raw_sql(sqlx::AssertSqlSafe(begun))
        .execute(&mut connection)
        .await
        .unwrap();
    let killed = folder.path().join("killed.db");
    std::fs::copy(&path, &killed).unwrap();
    std::fs::copy(beside(&path, "-wal"), beside(&killed, "-wal")).unwrap();
    let log = std::fs::metadata(beside(&killed, "-wal")).unwrap();
    assert!(log.len() > 4096, "the log has nothing of the upgrade");
    holds_every_row(&open(&killed).await).await;
}

#[tokio::test]
async fn a_migration_that_was_edited_is_noticed() {
    let (_folder, path) = folder();
    std::fs::copy(fixture(1), &path).unwrap();
    execute(
        &path,
        "UPDATE _sqlx_migrations SET checksum = x'00' WHERE version = 1",
    )
    .await;
    let before = read(&path);
    let error = Store::create_or_open(&path, &campaign()).await.unwrap_err();
    assert!(matches!(error, Error::Migration { .. }), "{error}");
    assert_eq!(read(&path), before);
}

#[tokio::test]
#[ignore = "once per schema, with the command at the top of this file"]
async fn makes_the_fixture() {
    let (_folder, path) = folder();
    let store = open(&path).await;
    store.put_designs(&all_designs()).await.unwrap();
    store.writer().unwrap().submit(all_rows()).await.unwrap();
    store
        .put_responses(&all_responses(), &from(&Derived::Responses))
        .await
        .unwrap();
    store
        .put_model(Some(&the_model()), &from(&Derived::Model))
        .await
        .unwrap();
    store
        .put_optimum(&the_optimum(), &optimum_of("kriging"))
        .await
        .unwrap();
    for number in 0..2 {
        store
            .put_round(&new_round(number, &[]), &round(number))
            .await
            .unwrap();
    }
    evaluations::want(&store, 7).await;
    evaluations::put(&store, 7, vec![evaluation(7)])
        .await
        .unwrap();
    store.put_stage_time(&stage_time(2.5)).await.unwrap();
    store.pin_model_digest("abc").await.unwrap();
    store.close().await.unwrap();
    std::fs::copy(&path, fixture(newest_migration())).unwrap();
}
