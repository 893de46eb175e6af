//! The report as files.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use store::Store;

use super::contents::Report;
use super::page::render;

/// The page's name in the report's folder.
pub const FILE: &str = "report.html";

/// The folder of the charts in the report's folder.
pub const CHARTS: &str = "charts";

/// Writes [`FILE`] into the folder `out`, which is made if need be, and its charts into [`CHARTS`]; returns
/// the page's path. `made` says where and when, as (label, value).
///
/// # Errors
///
/// The store cannot be read or a file cannot be written.
pub async fn write(
    store: &Store,
    out: &Path,
    made: &[(String, String)],
) -> anyhow::Result<PathBuf> {
    let files = render(&Report::read(store, made).await?)?;
    let charts = out.join(CHARTS);
    std::fs::create_dir_all(&charts)
        .with_context(|| format!("cannot make the folder {}", charts.display()))?;
    for chart in &files.charts {
        // Names of variables may hold characters that names of files may not.
        let plain = |c: char| {
            if c.is_alphanumeric() || "-_".contains(c) {
                c
            } else {
                '-'
            }
        };
        let name: String = chart.name.chars().map(plain).collect();
        replace(&charts.join(format!("{name}.svg")), &chart.svg)?;
        if let Some(csv) = &chart.csv {
            replace(&charts.join(format!("{name}.csv")), csv)?;
        }
    }
    let path = out.join(FILE);
    replace(&path, &files.html)?;
    Ok(path)
}

/// Writes a draft and renames it, so that the file is never half-written.
fn replace(path: &Path, text: &str) -> anyhow::Result<()> {
    let draft = path.with_added_extension("part");
    std::fs::write(&draft, text)
        .and_then(|()| std::fs::rename(&draft, path))
        .with_context(|| format!("cannot write {}", path.display()))
}
