//! The report as files.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use store::Store;

use super::contents::Report;
use super::page::{ReportFiles, render};

/// The page's name in the report's folder.
pub const FILE: &str = "report.html";

/// The folder of the charts in the report's folder.
const CHARTS: &str = "charts";

/// Writes [`FILE`] into the folder `out`, which is made if need be, with its charts; returns the page's path. `made`
/// says where and when, as (label, value).
///
/// # Errors
///
/// The store cannot be read or a file cannot be written.
pub async fn write(
    store: &Store,
    out: &Path,
    made: &[(String, String)],
) -> anyhow::Result<PathBuf> {
    render(&Report::read(store, made).await?)?.write(out, FILE)
}

impl ReportFiles {
    /// Writes the page as the file `name` into the folder `out`, and its charts into the folder `charts` there; returns
    /// the page's path.
    ///
    /// # Errors
    ///
    /// A file cannot be written.
    pub fn write(&self, out: &Path, name: &str) -> anyhow::Result<PathBuf> {
        let charts = out.join(CHARTS);
        for chart in &self.charts {
            // Names of variables may hold characters that names of files may not.
            let plain = |c: char| {
                if c.is_alphanumeric() || "-_".contains(c) {
                    c
                } else {
                    '-'
                }
            };
            let name: String = chart.name.chars().map(plain).collect();
            write_file(&charts, &format!("{name}.svg"), &chart.svg)?;
            if let Some(csv) = &chart.csv {
                write_file(&charts, &format!("{name}.csv"), csv)?;
            }
        }
        write_file(out, name, &self.html)?;
        Ok(out.join(name))
    }
}

/// Writes a file into the folder `out`, which is created if need be. The file is never left
/// half-written.
///
/// # Errors
///
/// The folder or the file cannot be written.
pub fn write_file(out: &Path, name: &str, content: impl AsRef<[u8]>) -> anyhow::Result<()> {
    std::fs::create_dir_all(out)
        .with_context(|| format!("cannot make the folder {}", out.display()))?;
    let path = out.join(name);
    let draft = out.join(format!("{name}.part"));
    std::fs::write(&draft, content)
        .and_then(|()| std::fs::rename(&draft, &path))
        .with_context(|| format!("cannot write {}", path.display()))
}
