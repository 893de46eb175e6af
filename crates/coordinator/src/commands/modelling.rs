//! Models of a user's own table: read files, call the library, print.

use std::path::Path;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};
use kriging::{FitOptions, Settings};
use results::model;
use results::modelling::table::SkippedRows;
use results::modelling::{ModelFile, Request, Table, summary};
use results::table::VersionedObject;
use runner::exit::{self, ProgramError};
use store::Store;
use tokio_util::sync::CancellationToken;
use tracing::{debug, info, warn};

use super::output::{self, print_either};
use super::{read, read_bytes};
use crate::arguments;

/// `coordinator fit`.
pub(super) async fn fit(arguments: &arguments::Fit) -> Result<u8, ProgramError> {
    if let Some(out) = &arguments.out {
        output::require_new_file(out)?;
    }
    let table = table(&arguments.data)?;
    let how = &arguments.how;
    let request = Request {
        response: arguments.response.clone(),
        variance: arguments.variance.clone(),
        inputs: arguments.inputs.clone(),
        skip_missing: arguments.skip_missing,
        nugget: how.nugget,
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
            ..Settings::default()
        },
    };
    let doing = format!("fitting a model to {} rows", table.len());
    let Some(fitted) =
        interruptible(doing, move || results::modelling::fit(&table, &request)).await?
    else {
        return Ok(exit::INTERRUPTED);
    };
    let fitted = fitted?;
    if let Some(out) = &arguments.out {
        output::write(out, format!("{}\n", fitted.model.to_json()?).as_bytes())?;
    }
    print_either(
        arguments.json,
        &VersionedObject::new(&fitted.summary),
        || summary::describe(&fitted.summary),
    )?;
    Ok(exit::OK)
}

/// `coordinator predict`.
pub(super) async fn predict(arguments: &arguments::Predict) -> Result<u8, ProgramError> {
    output::require_new_file(&arguments.out)?;
    let model = match (&arguments.model, &arguments.db) {
        (Some(file), _) => ModelFile::from_json(&file.display().to_string(), &read(file)?)?,
        (None, Some(db)) => model::stored(&Store::open_read_only(db).await?).await?,
        (None, None) => return Err(super::Usage("give --model or --db".to_owned()).into()),
    };
    let mut table = table(&arguments.at)?;
    let mut skipped = Vec::new();
    if arguments.skip_missing {
        let inputs: Vec<&str> = model
            .inputs
            .iter()
            .map(|input| input.name.as_str())
            .collect();
        skipped = table.skip_missing(&inputs)?;
        for SkippedRows { column, lines } in &skipped {
            warn!(%column, ?lines, "left out the rows without a value");
        }
    }
    let (level, interval) = (arguments.level, arguments.interval);
    let doing = format!("predicting at {} points", table.len());
    let work = move || results::modelling::predict(&model, &table, level, interval);
    let Some(predictions) = interruptible(doing, work).await? else {
        return Ok(exit::INTERRUPTED);
    };
    let mut predictions = predictions?;
    predictions.skipped = skipped;
    if !predictions.unused.is_empty() {
        warn!(columns = %predictions.unused.join(", "), "ignored: not model inputs");
    }
    let content = if arguments.json {
        (serde_json::to_string(&VersionedObject::new(&predictions))? + "\n").into_bytes()
    } else {
        predictions.to_csv().map_err(anyhow::Error::from)?
    };
    output::write(&arguments.out, &content)?;
    Ok(exit::OK)
}

/// Runs `work` on a separate thread and shows its elapsed time on a terminal. Returns `None` if a signal stopped
/// the program before.
pub(super) async fn interruptible<T: Send + 'static>(
    doing: String,
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<Option<T>, ProgramError> {
    let bar = runner::console::bars().add(ProgressBar::new_spinner());
    bar.set_style(ProgressStyle::with_template("{spinner} {msg}, {elapsed}")?);
    bar.set_message(doing.clone());
    bar.enable_steady_tick(Duration::from_millis(200));
    let shutdown = CancellationToken::new();
    tokio::spawn(runner::console::watch_signals(shutdown.clone(), "stopping"));
    debug!("{doing}");
    let found = tokio::select! {
        found = tokio::task::spawn_blocking(work) => Some(found?),
        () = shutdown.cancelled() => None,
    };
    bar.finish_and_clear();
    if found.is_none() {
        info!("stopped; nothing was written");
    }
    Ok(found)
}

fn table(file: &Path) -> Result<Table, ProgramError> {
    Ok(Table::parse(
        &file.display().to_string(),
        read_bytes(file)?,
    )?)
}
