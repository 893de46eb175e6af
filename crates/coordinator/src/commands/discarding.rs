//! `discard`: removes stored results that are not trusted.

use problem::Campaign;
use problem::formulation::Problem;
use results::table::VersionedObject;
use runner::coordinator::server;
use runner::exit::{self, ProgramError};
use serde::Serialize;
use stages::stage::Stage;
use store::{Discard, RemovedRows, Store};

use super::output::print_either;
use super::refuse_network_store;
use crate::arguments;

#[derive(Serialize)]
struct Removal {
    /// Whether the results were removed, not only counted.
    removed: bool,
    samples: u64,
    criteria: u64,
    evaluations: u64,
    runs: u64,
}

/// `coordinator discard`.
pub(super) async fn discard(arguments: arguments::Discard) -> Result<u8, ProgramError> {
    refuse_network_store(&arguments.db, arguments.allow_network_store)?;
    let what = match (arguments.what.design, arguments.what.worker) {
        (Some(design), _) => Discard::Design(design),
        (None, worker) => Discard::Worker(worker.unwrap_or_default()),
    };
    let held = Store::open_read_only(&arguments.db).await?;
    let row = held.campaign().await?;
    held.close().await?;
    let campaign = Campaign::stored(&row.file_text)?;
    let store = server::open_store(&Problem::new(campaign), &row.file_text, &arguments.db).await?;
    let removed = remove(&store, &what, arguments.yes).await;
    store.close().await?;
    let RemovedRows {
        samples,
        criteria,
        evaluations,
        runs,
    } = removed?;
    let removal = Removal {
        removed: arguments.yes,
        samples,
        criteria,
        evaluations,
        runs,
    };
    print_either(arguments.json, &VersionedObject::new(&removal), || {
        describe(&what, &removal)
    })?;
    Ok(exit::OK)
}

/// Removes the results, or only counts them. A campaign that lost some is no longer finished.
async fn remove(
    store: &Store,
    what: &Discard,
    is_meant: bool,
) -> Result<RemovedRows, store::Error> {
    let removed = store.discard(what, !is_meant).await?;
    if is_meant && removed != RemovedRows::default() {
        store.put_stage(&Stage::Sample.to_string()).await?;
    }
    Ok(removed)
}

fn describe(what: &Discard, removal: &Removal) -> String {
    let of = match what {
        Discard::Design(design) => format!("design {design}"),
        Discard::Worker(name) => format!("worker or host {name}"),
    };
    let Removal {
        samples,
        criteria,
        evaluations,
        runs,
        ..
    } = removal;
    let counts = format!(
        "{samples} samples, criteria of {criteria} designs, {evaluations} evaluations and {runs} runs of optimisers"
    );
    match removal.removed {
        _ if samples + criteria + evaluations + runs == 0 => {
            format!(
                "no stored results of {of}: `coordinator export --table blocks` names workers and hosts\n"
            )
        }
        true => format!(
            "removed         {counts}, of {of}\n\
             next            the campaign's command again, which computes them and all that follows from them again\n"
        ),
        false => format!(
            "would remove    {counts}, of {of}\n\
             next            the same command with --yes\n"
        ),
    }
}
