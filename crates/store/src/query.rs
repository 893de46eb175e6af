//! Statements that only read.

use std::collections::BTreeMap;
use std::ops::Range;

use ledger::StreamId;

use crate::Error;
use crate::cause::first_line;
use crate::connection::Connection;
use crate::keyed::{self, numbers};
use crate::rows::{
    CampaignRow, DesignRow, FailureGroup, FailureKind, FailureRow, MissingWork, Progress,
    StreamHistory,
};

/// The operation of finding missing work; completes "the database could not".
const LOOKING: &str = "look for missing work";

/// The applied migrations as version and checksum, oldest first.
pub(crate) async fn migrations(
    connection: &mut Connection<'_>,
) -> Result<Vec<(i64, Vec<u8>)>, Error> {
    let rows = connection.all("read the schema", sqlx::query!(
        r#"SELECT version AS "version!: i64", checksum FROM _sqlx_migrations ORDER BY version"#
    )).await?;
    Ok(rows.into_iter().map(|r| (r.version, r.checksum)).collect())
}

pub(crate) async fn campaign(connection: &mut Connection<'_>) -> Result<CampaignRow, Error> {
    let row = keyed::all(connection).await?.pop();
    // A store is created together with its campaign.
    row.ok_or_else(|| connection.damaged("it names no campaign"))
}

pub(crate) async fn sampled_counts(
    connection: &mut Connection<'_>,
) -> Result<Vec<(u64, u64)>, Error> {
    let rows = connection
        .all(
            "count samples",
            sqlx::query!(
                r#"SELECT design.design, coalesce(sample_tally.samples, 0) AS "held!: i64"
           FROM design LEFT JOIN sample_tally ON sample_tally.stream = design.design
           ORDER BY design.design"#
            ),
        )
        .await?;
    Ok(rows
        .into_iter()
        .map(|r| (index(r.design), index(r.held)))
        .collect())
}

/// The designs that lack criteria, or that are simulable, not ruled out, and lack samples below
/// `wanted` or below their larger number in `more`.
pub(crate) async fn missing_work(
    connection: &mut Connection<'_>,
    wanted: u64,
    more: &BTreeMap<u64, u64>,
) -> Result<Vec<MissingWork>, Error> {
    // No sample beyond `i64::MAX` can be stored, so none is missing there.
    let limit = i64::try_from(wanted).unwrap_or(i64::MAX);
    let mut missing = BTreeMap::new();
    // The query skips designs that have enough samples without gaps.
    let rows = connection
        .all(
            LOOKING,
            sqlx::query!(
                r#"SELECT design.design AS "design!: i64",
                  design.x AS "x!: Vec<u8>",
                  criteria.design IS NULL AS "without_criteria!: bool",
                  coalesce(sample_tally.samples, 0) AS "held!: i64",
                  coalesce(sample_tally.last_sample, -1) AS "last!: i64"
           FROM design
           LEFT JOIN criteria ON criteria.design = design.design
           LEFT JOIN sample_tally ON sample_tally.stream = design.design
           WHERE criteria.design IS NULL
              OR criteria.simulable = 1 AND criteria.reason IS NULL
                 AND (coalesce(sample_tally.samples, 0) < ?1
                      OR sample_tally.samples <= sample_tally.last_sample)
           ORDER BY design.design"#,
                limit,
            ),
        )
        .await?;

    for row in rows {
        let samples = if row.held > row.last {
            // Without gaps, the missing samples are known without reading any.
            gaps(std::iter::once(0..index(row.held)), wanted)
        } else {
            missing_samples(connection, row.design, limit).await?
        };
        if row.without_criteria || !samples.is_empty() {
            let x = numbers(&row.x).map_err(|e| connection.failed(LOOKING, e))?;
            let work = MissingWork {
                design: DesignRow {
                    design: index(row.design),
                    x,
                },
                criteria: row.without_criteria,
                samples,
            };
            missing.insert(work.design.design, work);
        }
    }
    for (&design, &wanted) in more {
        let limit = i64::try_from(wanted).unwrap_or(i64::MAX);
        let samples = missing_samples(connection, design.cast_signed(), limit).await?;
        match missing.get_mut(&design) {
            Some(work) => work.samples = samples,
            None if samples.is_empty() => {}
            None => {
                let row = design_row(connection, design.cast_signed()).await?;
                let work = MissingWork {
                    design: row,
                    criteria: false,
                    samples,
                };
                missing.insert(design, work);
            }
        }
    }
    Ok(missing.into_values().collect())
}

async fn design_row(connection: &mut Connection<'_>, design: i64) -> Result<DesignRow, Error> {
    let row = connection
        .one(
            "read a design",
            sqlx::query!(
                r#"SELECT x AS "x!: Vec<u8>" FROM design WHERE design = ?"#,
                design
            ),
        )
        .await?;
    let x = numbers(&row.x).map_err(|e| connection.failed(LOOKING, e))?;
    Ok(DesignRow {
        design: index(design),
        x,
    })
}

/// The missing samples of one design in `0..limit`.
async fn missing_samples(
    connection: &mut Connection<'_>,
    design: i64,
    limit: i64,
) -> Result<Vec<Range<u64>>, Error> {
    let held = connection
        .all(
            LOOKING,
            sqlx::query!(
                r#"SELECT first_sample, length(samples) / 8 AS "samples!: i64"
                   FROM sample_block WHERE stream = ? AND first_sample < ? ORDER BY first_sample"#,
                design,
                limit,
            ),
        )
        .await?;
    let held = held.into_iter().map(|r| {
        let first = index(r.first_sample);
        first..first + index(r.samples)
    });
    Ok(gaps(held, index(limit)))
}

/// The parts of `0..wanted` that the ascending ranges `held` leave out.
fn gaps(held: impl IntoIterator<Item = Range<u64>>, wanted: u64) -> Vec<Range<u64>> {
    let mut gaps = Vec::new();
    let mut next = 0;
    for range in held {
        if range.start.min(wanted) > next {
            gaps.push(next..range.start.min(wanted));
        }
        next = range.end;
    }
    if next < wanted {
        gaps.push(next..wanted);
    }
    gaps
}

/// The number of commits in the store.
pub(crate) async fn commits(connection: &mut Connection<'_>) -> Result<u64, Error> {
    connection
        .one(
            "read the tally",
            sqlx::query!("SELECT commits FROM commit_tally"),
        )
        .await
        .map(|r| index(r.commits))
}

/// The digest of all criteria: their number and the sums of the halves of their seals.
pub(crate) async fn criteria_digest(connection: &mut Connection<'_>) -> Result<String, Error> {
    let query = sqlx::query!(
        r#"SELECT count(*) AS "count!: i64", coalesce(sum(seal & 4294967295), 0) AS "low!: i64",
                  coalesce(sum((seal >> 32) & 4294967295), 0) AS "high!: i64" FROM criteria"#
    );
    let r = connection.one("read criteria", query).await?;
    Ok(format!("{:x}-{:x}-{:x}", r.count, r.low, r.high))
}

/// The number and the digest of the evaluations of each stream that has any.
pub(crate) async fn evaluated(
    connection: &mut Connection<'_>,
) -> Result<BTreeMap<StreamId, (u64, String)>, Error> {
    let query = sqlx::query!(
        r#"SELECT stream AS "stream!: i64", count(*) AS "count!: i64",
                  sum(seal & 4294967295) AS "low!: i64",
                  sum((seal >> 32) & 4294967295) AS "high!: i64"
           FROM evaluation GROUP BY stream"#
    );
    let rows = connection.all("read evaluations", query).await?;
    rows.into_iter()
        .map(|r| {
            let digest = format!("{:x}-{:x}-{:x}", r.count, r.low, r.high);
            Ok((stream(r.stream)?, (index(r.count), digest)))
        })
        .collect()
}

pub(crate) async fn failures(connection: &mut Connection<'_>) -> Result<Vec<FailureRow>, Error> {
    let rows = connection
        .all(
            "read failures",
            sqlx::query!(
                r#"SELECT stream, shared AS "shared: bool", lease AS "lease: u32", worker, serial, kind, error, at_unix_ms
           FROM failure ORDER BY failure"#
            ),
        )
        .await?;
    rows.into_iter()
        .map(|r| {
            Ok(FailureRow {
                stream: stream(r.stream)?,
                shared: r.shared,
                lease: r.lease,
                worker: r.worker,
                serial: r.serial.map(i64::cast_unsigned),
                kind: kind(r.kind)?,
                error: r.error,
                at_unix_ms: r.at_unix_ms,
            })
        })
        .collect()
}

pub(crate) async fn knows_failure(
    connection: &mut Connection<'_>,
    worker: &str,
    serial: u64,
) -> Result<bool, Error> {
    let serial = serial.cast_signed();
    let found = connection.one("look for a failure", sqlx::query!(
        r#"SELECT EXISTS (SELECT 1 FROM failure WHERE worker = ? AND serial = ?) AS "known!: bool""#,
        worker,
        serial,
    )).await?;
    Ok(found.known)
}

pub(crate) async fn generations(
    connection: &mut Connection<'_>,
) -> Result<BTreeMap<StreamId, u64>, Error> {
    let rows = connection
        .all(
            "read what is wanted",
            sqlx::query!("SELECT stream, generation FROM stream_generation"),
        )
        .await?;
    rows.into_iter()
        .map(|r| Ok((stream(r.stream)?, r.generation.cast_unsigned())))
        .collect()
}

pub(crate) async fn stream_histories(
    connection: &mut Connection<'_>,
) -> Result<Vec<StreamHistory>, Error> {
    let rows = connection
        .all(
            "read what went wrong with streams",
            sqlx::query!(
                r#"WITH quarantined AS (
               SELECT stream, max(failure) AS last FROM failure WHERE kind = 'quarantine' GROUP BY stream
           )
           SELECT failure.stream AS "stream!",
                  max(lease) AS "last_lease!: u32",
                  count(DISTINCT CASE WHEN kind = 'crash' AND failure > coalesce(last, 0)
                                      THEN worker END) AS "crashes!: u32",
                  sum(kind = 'failure' AND failure > coalesce(last, 0)) AS "failures!: u32"
           FROM failure LEFT JOIN quarantined ON quarantined.stream = failure.stream
           WHERE NOT shared
           GROUP BY failure.stream ORDER BY failure.stream"#
            ),
        )
        .await?;
    rows.into_iter()
        .map(|r| {
            Ok(StreamHistory {
                stream: stream(r.stream)?,
                last_lease: r.last_lease,
                crashes: r.crashes,
                failures: r.failures,
            })
        })
        .collect()
}

pub(crate) async fn failure_groups(
    connection: &mut Connection<'_>,
) -> Result<Vec<FailureGroup>, Error> {
    let rows = connection
        .all(
            "read the causes of failures",
            sqlx::query!(
                r#"SELECT failure_tally.kind, cause, failures, stream, worker, error
           FROM failure_tally JOIN failure ON failure = last_failure
           ORDER BY failure_tally.kind, cause"#
            ),
        )
        .await?;
    rows.into_iter()
        .map(|r| {
            Ok(FailureGroup {
                kind: kind(r.kind)?,
                cause: r.cause,
                count: index(r.failures),
                last_error: first_line(&r.error).to_owned(),
                last_stream: stream(r.stream)?,
                last_worker: r.worker,
            })
        })
        .collect()
}

fn stream(key: i64) -> Result<StreamId, Error> {
    StreamId::from_key(index(key)).ok_or_else(|| Error::UnknownValue {
        column: "stream",
        value: key.to_string(),
    })
}

fn kind(text: String) -> Result<FailureKind, Error> {
    FailureKind::parse(&text).ok_or(Error::UnknownValue {
        column: "failure.kind",
        value: text,
    })
}

pub(crate) async fn progress(connection: &mut Connection<'_>) -> Result<Progress, Error> {
    let first_point = StreamId::point(0).key().cast_signed();
    // A single statement, so that all counts are of the same moment.
    let r = connection
        .one(
            "count rows",
            sqlx::query!(
                r#"SELECT (SELECT count(*) FROM design) AS "designs!: i64",
                  (SELECT count(*) FROM criteria) AS "criteria_done!: i64",
                  (SELECT count(*) FROM criteria WHERE simulable = 1) AS "simulable!: i64",
                  (SELECT count(*) FROM criteria WHERE simulable = 1 AND reason IS NOT NULL)
                      AS "ruled_out!: i64",
                  (SELECT coalesce(sum(samples), 0) FROM sample_tally WHERE stream < ?1) AS "samples!: i64",
                  (SELECT count(*) FROM response) AS "responses!: i64",
                  (SELECT count(*) FROM model) AS "models!: i64",
                  (SELECT count(*) FROM optimiser_run) AS "optimiser_runs!: i64",
                  (SELECT count(*) FROM optimum) AS "optima!: i64",
                  (SELECT coalesce(sum(samples), 0) FROM sample_tally WHERE stream >= ?1)
                      AS "point_samples!: i64",
                  (SELECT coalesce(sum(failures), 0) FROM failure_tally) AS "failures!: i64""#,
                first_point,
            ),
        )
        .await?;
    Ok(Progress {
        designs: index(r.designs),
        criteria_done: index(r.criteria_done),
        simulable: index(r.simulable),
        ruled_out: index(r.ruled_out),
        samples: index(r.samples),
        responses: index(r.responses),
        models: index(r.models),
        optimiser_runs: index(r.optimiser_runs),
        optima: index(r.optima),
        point_samples: index(r.point_samples),
        failures: index(r.failures),
    })
}

/// Converts an index or count, which the schema keeps from being negative.
pub(crate) fn index(value: i64) -> u64 {
    value.cast_unsigned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_are_what_is_not_held() {
        let gaps = |held: &[(u64, u64)], wanted| {
            gaps(held.iter().map(|&(start, end)| start..end), wanted)
                .into_iter()
                .map(|gap| (gap.start, gap.end))
                .collect::<Vec<_>>()
        };
        assert_eq!(gaps(&[], 0), []);
        assert_eq!(gaps(&[], 3), [(0, 3)]);
        assert_eq!(gaps(&[(0, 2), (2, 3)], 3), []);
        assert_eq!(gaps(&[(0, 9)], 3), []);
        assert_eq!(gaps(&[(1, 3), (5, 6)], 8), [(0, 1), (3, 5), (6, 8)]);
        assert_eq!(gaps(&[(0, 1), (7, 20)], 8), [(1, 7)]);
        assert_eq!(gaps(&[(0, 1), (7, 20), (30, 31)], 5), [(1, 5)]);
    }
}
