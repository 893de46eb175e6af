//! The progress of a campaign.

use crate::Error;
use crate::blocks::Streams;
use crate::connection::Connection;

/// The progress of a campaign, with all counts of the same moment.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Progress {
    /// Number of designs.
    pub designs: u64,
    /// Designs whose criteria are known.
    pub criteria_done: u64,
    /// Simulable designs.
    pub simulable: u64,
    /// Simulable designs that get no samples, for a reason recorded with them.
    pub ruled_out: u64,
    /// Samples of designs.
    pub samples: u64,
    /// Designs with a response.
    pub responses: u64,
    /// Fitted models.
    pub models: u64,
    /// Finished optimiser runs.
    pub optimiser_runs: u64,
    /// Optima.
    pub optima: u64,
    /// Samples at optima.
    pub point_samples: u64,
    /// Evaluations of candidates by an external program.
    pub evaluations: u64,
    /// Sample values in these evaluations.
    pub evaluation_values: u64,
    /// Recorded crashes, failures and quarantines.
    pub failures: u64,
}

pub(crate) async fn read(connection: &mut Connection<'_>) -> Result<Progress, Error> {
    let (_, last_design) = Streams::Designs.keys();
    // A single statement, so that all counts are of the same moment.
    let query = sqlx::query_as!(
        Progress,
        r#"SELECT (SELECT count(*) FROM design) AS "designs!: u64",
                  (SELECT count(*) FROM criteria) AS "criteria_done!: u64",
                  (SELECT count(*) FROM criteria WHERE simulable = 1) AS "simulable!: u64",
                  (SELECT count(*) FROM criteria WHERE simulable = 1 AND reason IS NOT NULL)
                      AS "ruled_out!: u64",
                  (SELECT coalesce(sum(samples), 0) FROM sample_tally WHERE stream <= ?1)
                      AS "samples!: u64",
                  (SELECT count(*) FROM response WHERE number = 0) AS "responses!: u64",
                  (SELECT count(*) FROM model WHERE number = 0) AS "models!: u64",
                  (SELECT count(*) FROM optimiser_run) AS "optimiser_runs!: u64",
                  (SELECT count(*) FROM optimum) AS "optima!: u64",
                  (SELECT coalesce(sum(samples), 0) FROM sample_tally WHERE stream > ?1)
                      AS "point_samples!: u64",
                  (SELECT count(*) FROM evaluation) AS "evaluations!: u64",
                  (SELECT coalesce(sum(length(samples) / 8), 0) FROM evaluation)
                      AS "evaluation_values!: u64",
                  (SELECT coalesce(sum(failures), 0) FROM failure_tally) AS "failures!: u64""#,
        last_design,
    );
    connection.one(query).await
}

/// The number of samples of each design, as (design, samples).
pub(crate) async fn sampled_counts(
    connection: &mut Connection<'_>,
) -> Result<Vec<(u64, u64)>, Error> {
    let query = sqlx::query!(
        r#"SELECT design.design AS "design!: u64",
                  coalesce(sample_tally.samples, 0) AS "samples!: u64"
           FROM design LEFT JOIN sample_tally ON sample_tally.stream = design.design
           ORDER BY design.design"#
    );
    let rows = connection.all(query).await?;
    Ok(rows
        .into_iter()
        .map(|row| (row.design, row.samples))
        .collect())
}
