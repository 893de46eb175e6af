//! The measures of the samples of designs.

use crate::Error;
use crate::connection::Connection;
use crate::row::{self, Columns, Row};

/// A measure of the samples of a design, to which kriging is fitted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ResponseRow {
    /// Index of the design.
    pub design: u64,
    /// The number of the measure: 0 is optimised, the others belong to constraints.
    pub number: u64,
    /// Mean of the samples.
    pub mean: f64,
    /// Standard deviation of the samples.
    pub standard_deviation: f64,
    /// Estimate of the measure; infinite if too many samples failed.
    pub measure: f64,
    /// Variance of that estimate.
    pub measure_variance: f64,
    /// p-value of Lilliefors' test of normality; `None` if the test does not apply.
    pub lilliefors_p: Option<f64>,
}

impl Row for ResponseRow {
    const TABLE: &'static str = "response";

    fn key(&self) -> String {
        match self.number {
            0 => format!("design {}", self.design),
            number => format!("design {}, number {number}", self.design),
        }
    }

    fn add_to(&self, columns: &mut Columns) {
        columns
            .count("design", self.design)
            .count("number", self.number)
            .number("mean", self.mean)
            .number("standard_deviation", self.standard_deviation)
            .outcome("measure", self.measure)
            .number("measure_variance", self.measure_variance)
            .option(self.lilliefors_p, |to, p| to.number("lilliefors_p", p));
    }
}

pub(crate) async fn all(connection: &mut Connection<'_>) -> Result<Vec<ResponseRow>, Error> {
    let query = sqlx::query!(
        r#"SELECT design AS "design: u64", number AS "number: u64", mean, standard_deviation, measure,
                  measure_variance, lilliefors_p, seal
           FROM response ORDER BY number, design"#
    );
    let rows = connection.all(query).await?;
    rows.into_iter()
        .map(|row| {
            let response = ResponseRow {
                design: row.design,
                number: row.number,
                mean: row.mean,
                standard_deviation: row.standard_deviation,
                measure: row.measure,
                measure_variance: row.measure_variance,
                lilliefors_p: row.lilliefors_p,
            };
            connection.check(response, row.seal)
        })
        .collect()
}

/// Replaces all responses by these.
pub(crate) async fn replace(
    connection: &mut Connection<'_>,
    rows: &[ResponseRow],
) -> Result<(), Error> {
    remove(connection).await?;
    for row in rows {
        let seal = row::seal(row)?;
        let [design, number] = [row.design, row.number].map(u64::cast_signed);
        let query = sqlx::query!(
            "INSERT OR REPLACE INTO response (design, number, mean, standard_deviation, measure,
                 measure_variance, lilliefors_p, seal)
             VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
            design,
            number,
            row.mean,
            row.standard_deviation,
            row.measure,
            row.measure_variance,
            row.lilliefors_p,
            seal,
        );
        connection.execute(query).await?;
    }
    Ok(())
}

pub(crate) async fn remove(connection: &mut Connection<'_>) -> Result<(), Error> {
    let query = sqlx::query!("DELETE FROM response");
    connection.execute(query).await.map(drop)
}
