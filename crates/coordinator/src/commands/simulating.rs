//! `coordinator simulate`: one gear pair from a file.

use ::studies::simulate::{self, WearChoice};
use problem::PairFile;
use runner::exit::{self, ProgramError};
use tracing::{info, warn};

use super::output_folder::OutputFolder;
use super::{Usage, print_either, read};
use crate::arguments;

/// Default seed of random wear.
const SEED: u64 = 1;
/// Default number of samples of random wear.
const SAMPLES: u32 = 30;

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
