//! `coordinator stability`: inputs on which numerical methods fail, run and measured.

use lab::stability::Atlas;
use results::report::write_file;
use results::table::SCHEMA_VERSION;
use runner::exit::{self, ProgramError};
use serde_json::json;
use tracing::info;

use super::output::print_either;
use super::output_folder::OutputFolder;
use crate::arguments;

/// The file name of the page.
const PAGE: &str = "index.html";

/// Runs all entries of the atlas, prints a line for each, and writes the page and its tables.
pub(super) fn stability(arguments: &arguments::Stability) -> Result<u8, ProgramError> {
    let out = &arguments.out;
    OutputFolder(out).require_new()?;
    let atlas = Atlas::run();
    for (name, table) in atlas.tables()? {
        write_file(out, &name, table)?;
    }
    write_file(out, PAGE, atlas.page(runner::identity::BUILD)?)?;
    let json = json!({
        "schema_version": SCHEMA_VERSION,
        "folder": out.display().to_string(),
        "kept": atlas.is_kept(),
        "entries": atlas.to_json(),
    });
    print_either(arguments.json, &json, || atlas.describe())?;
    info!("wrote {}", out.join(PAGE).display());
    Ok(if atlas.is_kept() {
        exit::OK
    } else {
        exit::FAILURE
    })
}
