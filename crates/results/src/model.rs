//! The kriging model of a store as a model file.

use anyhow::Context as _;
use campaign::formulation::{ROBUST_VARIABLES, VARIABLE_NAMES};
use kriging::Surrogate;
use modelling::{ModelFile, Quantity};
use stages::fitting::P90_MODEL;
use store::Store;

/// The model of P90 (µm) over the six variables of the designs, as the campaign fitted it last.
///
/// # Errors
///
/// The campaign has not fitted its model yet, or the store cannot be read.
pub async fn stored(store: &Store) -> anyhow::Result<ModelFile> {
    let row = store.model(P90_MODEL).await?.with_context(|| {
        format!(
            "{} holds no model yet: the campaign fits it when its samples are in",
            store.path().display()
        )
    })?;
    let surrogate = Surrogate::from_json(&row.json)?;
    let inputs = VARIABLE_NAMES[..ROBUST_VARIABLES].iter();
    let inputs: Vec<Quantity> = inputs.map(|name| Quantity::new(name)).collect();
    Ok(ModelFile::new(&inputs, Quantity::new("p90_um"), surrogate))
}
