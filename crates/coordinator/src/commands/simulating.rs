//! `coordinator simulate` and `coordinator import`: one gear pair from a file.

use ::studies::simulate::{self, WearChoice};
use problem::PairFile;
use runner::exit::{self, HasExitCode, ProgramError};
use tracing::{info, warn};

use super::output_folder::OutputFolder;
use super::{Usage, print, print_either, read};
use crate::arguments;

/// Default seed of random wear.
const SEED: u64 = 1;
/// Default number of samples of random wear.
const SAMPLES: u32 = 30;

/// The file is not of the kind that the command reads.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
struct WrongFile(String);

impl HasExitCode for WrongFile {
    fn exit_code(&self) -> u8 {
        exit::BAD_FILE
    }
}

/// Simulates the pair of a file, prints its figures, and says whether it is simulable and feasible.
pub(super) fn simulate(arguments: &arguments::Simulate) -> Result<u8, ProgramError> {
    if arguments.wear != WearChoice::Random {
        let given = [
            ("--seed", arguments.seed),
            ("--samples", arguments.samples.map(u64::from)),
        ];
        for (name, value) in given {
            let Some(value) = value else { continue };
            let sentence = format!("{name} {value} is for random wear: add --wear random");
            return Err(Usage(sentence).into());
        }
    }
    if let Some(out) = &arguments.out {
        OutputFolder(out).require_new()?;
    }
    let text = read(&arguments.pair)?;
    if text.trim_start().starts_with('<') {
        let pair = arguments.pair.display();
        return Err(WrongFile(format!(
            "{pair} is XML, not a pair file: if it is REXS, `coordinator import {pair} > pair.toml` converts it"
        ))
        .into());
    }
    let file = PairFile::parse(&arguments.pair.display().to_string(), &text)?;
    let request = simulate::Request {
        wear: arguments.wear,
        seed: arguments.seed.unwrap_or(SEED),
        samples: arguments.samples.unwrap_or(SAMPLES),
    };
    let simulation = simulate::run(&file, request)?;
    for warning in &simulation.warnings {
        warn!("{warning}");
    }
    let json = simulate::to_json(&simulation)?;
    print_either(arguments.json, &json, || simulate::describe(&simulation))?;
    if let Some(out) = &arguments.out {
        let name = arguments.pair.file_stem().unwrap_or_default();
        let subject = simulate::Subject {
            title: &name.to_string_lossy(),
            program_version: runner::identity::BUILD,
            file: &file,
            request,
        };
        if let Some(page) = simulate::write_page(&subject, &simulation, out)? {
            info!("wrote {}", page.display());
        }
    }
    Ok(if simulation.simulable {
        exit::OK
    } else {
        exit::NOT_SIMULABLE
    })
}

/// Prints the pair file of a stage in REXS.
pub(super) fn import(arguments: &arguments::Import) -> Result<u8, ProgramError> {
    let text = read(&arguments.file)?;
    let file = arguments.file.display().to_string();
    let imported = simulate::import(&file, &text, arguments.torque)
        .map_err(|error| WrongFile(format!("{error:#}")))?;
    for note in &imported.notes {
        warn!("{note}");
    }
    print(&imported.toml)?;
    Ok(exit::OK)
}
