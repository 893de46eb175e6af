//! Models of a user's own table: read files, call the library, print.

use std::path::Path;

use campaign::file::Nugget;
use kriging::{FitOptions, Settings};
use modelling::table::Skipped;
use modelling::{ModelFile, Request, Table, summary};
use protocol::exit;
use results::model;
use store::Store;
use tracing::warn;

use super::output::{self, print_either};
use super::{read, read_bytes};
use crate::arguments;

/// `coordinator fit`.
pub(super) fn fit(arguments: &arguments::Fit) -> anyhow::Result<u8> {
    if let Some(out) = &arguments.out {
        output::refuse_taken(out)?;
    }
    let table = table(&arguments.data)?;
    let how = &arguments.how;
    let request = Request {
        response: arguments.response.clone(),
        variance: arguments.variance.clone(),
        inputs: arguments.inputs.clone(),
        skip_missing: arguments.skip_missing,
        nugget: how.nugget.map(|nugget| nugget == Nugget::Estimated),
        settings: Settings {
            fit: FitOptions {
                kernel: how.kernel,
                estimator: how.estimator,
                seed: how.seed,
                trend: how.trend,
                calibrate: how.calibrate,
                ..FitOptions::default()
            },
            method: how.method,
            response: how.response_scale,
        },
    };
    let fitted = modelling::fit(&table, &request)?;
    if let Some(out) = &arguments.out {
        output::write(out, format!("{}\n", fitted.model.to_json()?).as_bytes())?;
    }
    print_either(arguments.json, &fitted.summary, || {
        summary::describe(&fitted.summary)
    })?;
    Ok(exit::OK)
}

/// `coordinator predict`.
pub(super) async fn predict(arguments: &arguments::Predict) -> anyhow::Result<u8> {
    output::refuse_taken(&arguments.out)?;
    let model = match (&arguments.model, &arguments.db) {
        (Some(file), _) => ModelFile::from_json(&file.display().to_string(), &read(file)?)?,
        (None, Some(db)) => model::stored(&Store::open_read_only(db).await?).await?,
        (None, None) => return Err(super::Usage("give --model or --db".to_owned()).into()),
    };
    let mut table = table(&arguments.at)?;
    if arguments.skip_missing {
        let inputs: Vec<&str> = model
            .inputs
            .iter()
            .map(|input| input.name.as_str())
            .collect();
        for Skipped { column, lines } in table.skip_missing(&inputs)? {
            warn!(%column, ?lines, "left out the rows without a value");
        }
    }
    let predictions = modelling::predict(&model, &table, arguments.level)?;
    if !predictions.unused.is_empty() {
        warn!(columns = %predictions.unused.join(", "), "no inputs of the model, and not used");
    }
    let content = if arguments.json {
        (serde_json::to_string(&predictions)? + "\n").into_bytes()
    } else {
        predictions.to_csv()?
    };
    output::write(&arguments.out, &content)?;
    Ok(exit::OK)
}

fn table(file: &Path) -> anyhow::Result<Table> {
    Ok(Table::parse(
        &file.display().to_string(),
        read_bytes(file)?,
    )?)
}
