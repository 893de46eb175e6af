//! `coordinator tradeoff`: speed against accuracy, measured on this machine.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::Context as _;
use lab::tradeoff::{Kind, Size, Study, Table};
use problem::Campaign;
use problem::accuracy::CampaignFile;
use problem::formulation::Problem;
use results::report::write_file;
use results::table::SCHEMA_VERSION;
use runner::exit::{self, ProgramError};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use studies::refusal::{require_built_in, require_gears};
use tokio::runtime::Handle;
use tokio_util::sync::CancellationToken;
use tracing::info;

use super::output_folder::OutputFolder;
use super::{FileAccess, Usage, campaign_or_paper, print};
use crate::arguments;

mod overhead;

use overhead::Programs;
pub(super) use overhead::sleep_program;

/// The file that records the campaign, size and program of a folder's tables.
const STAMP: &str = "measured.json";
/// Maximum time for a stopped campaign to end.
const ENDING: Duration = Duration::from_secs(5);
/// The file name of the page.
const PAGE: &str = "tradeoff.html";

/// The campaign, size and program that the tables of a folder belong to.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Stamp {
    schema_version: u32,
    campaign_digest: String,
    size: String,
    program_version: String,
}

impl Stamp {
    fn new(campaign: &Campaign, size: Size) -> Self {
        Self {
            schema_version: SCHEMA_VERSION,
            campaign_digest: campaign.digest(),
            size: size.name(),
            program_version: runner::identity::BUILD.to_owned(),
        }
    }

    /// Refuses the text of a stamp that differs from this one.
    fn check(&self, text: &str) -> Result<(), String> {
        let stored: Self = serde_json::from_str(text)
            .map_err(|error| format!("its {STAMP} cannot be read ({error})"))?;
        for (what, stored, own) in [
            ("campaign", &stored.campaign_digest, &self.campaign_digest),
            ("size", &stored.size, &self.size),
            (
                "program version",
                &stored.program_version,
                &self.program_version,
            ),
        ] {
            if stored != own {
                return Err(format!(
                    "it holds studies of another {what}, {stored}, not {own}"
                ));
            }
        }
        Ok(())
    }
}

/// Measures the studies that the folder does not hold yet, and writes the page.
pub(super) async fn tradeoff(arguments: arguments::Tradeoff) -> Result<u8, ProgramError> {
    let CampaignFile { campaign, .. } = campaign_or_paper(arguments.campaign.as_deref())?;
    require_gears(&campaign).map_err(|error| Usage(error.to_string()))?;
    require_built_in(&campaign).map_err(|error| Usage(error.to_string()))?;
    let size = match (arguments.quick, arguments.designs) {
        (_, Some(designs)) => Size::Designs(designs),
        (true, None) => Size::Quick,
        (false, None) => Size::Full,
    };
    let default = || PathBuf::from(format!("{}-tradeoff", campaign.name));
    let out = arguments.out.unwrap_or_else(default);
    claim(&out, &campaign, size)?;
    let shutdown = CancellationToken::new();
    tokio::spawn(runner::console::watch_signals(shutdown.clone(), "stopping"));
    let is_json = arguments.json;
    let token = shutdown.clone();
    let kinds = match arguments.study.is_empty() {
        true => Kind::ALL.to_vec(),
        false => arguments.study,
    };
    let mut work =
        tokio::task::spawn_blocking(move || conduct(&campaign, &kinds, size, &out, is_json, token));
    tokio::select! {
        done = &mut work => done??,
        () = shutdown.cancelled() => {
            // A campaign that runs in a separate process is ended.
            let _ = tokio::time::timeout(ENDING, work).await;
            info!("stopped; the same command measures the studies that are not finished");
            return Ok(exit::INTERRUPTED);
        }
    }
    Ok(exit::OK)
}

fn conduct(
    campaign: &Campaign,
    kinds: &[Kind],
    size: Size,
    out: &Path,
    is_json: bool,
    shutdown: CancellationToken,
) -> Result<(), ProgramError> {
    let problem = Problem::new(campaign.clone());
    let mut programs = Programs {
        campaign,
        out,
        runtime: Handle::current(),
        shutdown,
    };
    let mut studies = Vec::new();
    for &kind in kinds {
        let (study, origin) = match finished(kind, out)? {
            Some(study) => (study, "measured before"),
            None => {
                let study = kind.run(&problem, size, &mut programs, &mut |done| info!("{done}"))?;
                write_file(out, &file(kind), study.table.csv()?)?;
                (study, "measured")
            }
        };
        if !is_json {
            let sentence = study.views().first().map(lab::tradeoff::View::sentence);
            let (settings, sentence) = (study.table.rows.len(), sentence.unwrap_or_default());
            print(&format!(
                "{}: {origin}, {settings} settings. {sentence}\n",
                kind.name()
            ))?;
        }
        studies.push(study);
    }
    let page = lab::tradeoff::page(
        campaign,
        size,
        &studies,
        runner::coordinator::provenance::labels(),
    );
    let page = results::report::render_tradeoff(&page)?;
    let path = page.write(out, PAGE)?;
    print(&if is_json {
        format!("{}\n", to_json(&studies, size, out))
    } else {
        format!("page: {}\n", path.display())
    })?;
    Ok(())
}

fn file(kind: Kind) -> String {
    format!("{}.csv", kind.name())
}

/// Reads a study from the folder, if it is there.
fn finished(kind: Kind, out: &Path) -> Result<Option<Study>, ProgramError> {
    let path = out.join(file(kind));
    let csv = match std::fs::read(&path) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        Err(source) => return Err(FileAccess::new("read", &path, source).into()),
        Ok(csv) => csv,
    };
    let table = Table::from_csv(&csv).with_context(|| {
        format!(
            "{} is not the table of a study; remove it, and it is measured again",
            path.display()
        )
    })?;
    Ok(Some(Study { kind, table }))
}

/// Claims a folder that is new, empty, or of this campaign, size and program.
fn claim(out: &Path, campaign: &Campaign, size: Size) -> Result<(), ProgramError> {
    let own = Stamp::new(campaign, size);
    let folder = OutputFolder(out);
    if !folder.require_own(STAMP, |text| own.check(text))? {
        folder.require_new()?;
        write_file(out, STAMP, serde_json::to_string_pretty(&own)? + "\n")?;
    }
    Ok(())
}

fn to_json(studies: &[Study], size: Size, out: &Path) -> Value {
    let of_study = |study: &Study| {
        let rows = study.table.rows.iter().map(|row| {
            json!({
                "measured_for": row.panel,
                "method": row.method,
                "setting": row.setting,
                "campaign": row.is_campaign,
                // Missing values are null.
                "values": row.values,
            })
        });
        let views = study.views();
        let recommended = views.iter().map(|view| {
            let row = view.recommended();
            json!({
                "measured_for": view.panel,
                "method": row.map(|row| &row.method),
                "setting": row.map(|row| &row.setting),
                "why": view.sentence(),
            })
        });
        json!({
            "name": study.kind.name(),
            "columns": study.table.columns,
            "rows": rows.collect::<Value>(),
            "recommended": recommended.collect::<Value>(),
        })
    };
    json!({
        "schema_version": SCHEMA_VERSION,
        "folder": out.display().to_string(),
        "size": size.name(),
        "studies": studies.iter().map(of_study).collect::<Value>(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_of_another_campaign_size_or_kind_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        let paper = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
        let wear = Campaign::parse("wear.toml", Campaign::WEAR).unwrap();
        claim(&out, &paper, Size::Quick).unwrap();
        claim(&out, &paper, Size::Quick).unwrap();
        let said = |claimed: Result<(), ProgramError>| format!("{:#}", claimed.unwrap_err());
        assert!(said(claim(&out, &wear, Size::Quick)).contains("another campaign"));
        assert!(said(claim(&out, &paper, Size::Full)).contains("another size, quick, not full"));
        let stamp = out.join(STAMP);
        let text = std::fs::read_to_string(&stamp).unwrap();
        std::fs::write(&stamp, text.replace(runner::identity::BUILD, "0.0.0+0")).unwrap();
        assert!(said(claim(&out, &paper, Size::Quick)).contains("another program version"));
        std::fs::write(&stamp, "{").unwrap();
        assert!(said(claim(&out, &paper, Size::Quick)).contains("cannot be read"));
        assert_eq!(std::fs::read_to_string(&stamp).unwrap(), "{");
        std::fs::remove_file(&stamp).unwrap();
        std::fs::write(out.join("simulator.csv"), "mine").unwrap();
        assert!(said(claim(&out, &paper, Size::Quick)).contains("not empty"));
    }
}
