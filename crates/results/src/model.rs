//! The kriging model of a store as a model file.

use crate::modelling::{ModelFile, Quantity};
use anyhow::Context as _;
use kriging::Surrogate;
use problem::Campaign;
use problem::formulation::Problem;
use stages::fitting::latest_model;
use store::Store;

use crate::columns::column;

/// The model of the measure over the variables that the DoE moves, as the campaign fitted it last: after an
/// enrichment, to its infill points as well.
///
/// # Errors
///
/// The campaign has not fitted its model yet, or the store cannot be read.
pub async fn stored(store: &Store) -> anyhow::Result<ModelFile> {
    let row = latest_model(store).await?.with_context(|| {
        format!(
            "{} holds no model yet: the campaign fits it when its samples are in",
            store.path().display()
        )
    })?;
    let surrogate = Surrogate::from_json(&row.json)?;
    let file = store.campaign().await?.file_text;
    let problem = Problem::new(Campaign::parse("the store's campaign file", &file)?);
    let inputs: Vec<Quantity> = problem.free_names().map(Quantity::new).collect();
    Ok(ModelFile::new(
        &inputs,
        Quantity::new(&column(&problem, "{p}")),
        surrogate,
    ))
}
