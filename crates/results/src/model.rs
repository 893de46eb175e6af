//! The kriging model of a store as a model file.

use crate::modelling::{ModelFile, Quantity};
use anyhow::bail;
use kriging::Surrogate;
use stages::fitting::latest_model;
use store::Store;

use crate::columns::column;
use crate::snapshot;

/// The model that the campaign fitted last, of the measure over the variables that the DoE moves. After an enrichment
/// it is fitted to the infill points as well.
///
/// # Errors
///
/// The campaign has not fitted its model yet, or the store cannot be read.
pub async fn stored(store: &Store) -> anyhow::Result<ModelFile> {
    let Some(row) = latest_model(store).await? else {
        let is_done = store.stage().await?.as_deref() == Some("done");
        bail!(
            "{} holds no model{}",
            store.path().display(),
            match is_done {
                true => ": the campaign ended without one, and its status says why",
                false => " yet: the campaign fits it when its samples are in",
            }
        );
    };
    let surrogate = Surrogate::from_json(&row.json)?;
    let problem = snapshot::problem(store).await?;
    let inputs: Vec<Quantity> = problem.free_names().map(Quantity::new).collect();
    Ok(ModelFile::new(
        &inputs,
        Quantity::new(&column(&problem, "{p}")),
        surrogate,
    ))
}
