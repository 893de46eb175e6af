//! Fitted models.

use crate::Error;
use crate::connection::Connection;
use crate::row::{self, Columns, Row};

/// A fitted model.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ModelRow {
    /// The data that it was fitted to: [`ModelRow::DOE`] or [`ModelRow::ENRICHED`].
    pub name: String,
    /// The number of the modelled measure, as in [`ResponseRow`](crate::ResponseRow).
    pub number: u64,
    /// The whole model, as JSON.
    pub json: String,
    /// A summary of the model, as JSON.
    pub summary_json: String,
}

impl ModelRow {
    /// The name of the model of the DoE.
    pub const DOE: &str = "doe";
    /// The name of the model of the DoE and all infill points, from the end of an enrichment.
    pub const ENRICHED: &str = "enriched";
}

impl Row for ModelRow {
    const TABLE: &'static str = "model";

    fn key(&self) -> String {
        format!("name {:?}, number {}", self.name, self.number)
    }

    fn add_to(&self, columns: &mut Columns) {
        columns
            .text(&self.name)
            .count("number", self.number)
            .text(&self.json)
            .text(&self.summary_json);
    }
}

/// The models with this name, or all models, in the order of their numbers.
pub(crate) async fn named(
    connection: &mut Connection<'_>,
    name: Option<&str>,
) -> Result<Vec<ModelRow>, Error> {
    let query = sqlx::query!(
        r#"SELECT name, number AS "number: u64", json, summary_json, seal FROM model
           WHERE ?1 IS NULL OR name = ?1 ORDER BY name, number"#,
        name,
    );
    let rows = connection.all(query).await?;
    rows.into_iter()
        .map(|row| {
            let model = ModelRow {
                name: row.name,
                number: row.number,
                json: row.json,
                summary_json: row.summary_json,
            };
            connection.check(model, row.seal)
        })
        .collect()
}

/// Stores the model, replacing that of the same name and number.
pub(crate) async fn replace(connection: &mut Connection<'_>, row: &ModelRow) -> Result<(), Error> {
    let seal = row::seal(row)?;
    let number = row.number.cast_signed();
    let query = sqlx::query!(
        "INSERT OR REPLACE INTO model (name, number, json, summary_json, seal) VALUES (?, ?, ?, ?, ?)",
        row.name,
        number,
        row.json,
        row.summary_json,
        seal,
    );
    connection.execute(query).await.map(drop)
}

pub(crate) async fn remove(connection: &mut Connection<'_>, name: &str) -> Result<(), Error> {
    let query = sqlx::query!("DELETE FROM model WHERE name = ?", name);
    connection.execute(query).await.map(drop)
}
