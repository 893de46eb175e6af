//! The results of a shard: a line of JSON, then records.
//!
//! A record is its length (4 bytes, little-endian), the first 8 bytes of the SHA-256 of its
//! content, and the content, a [`LeaseResult`]. A truncated record at the end of the file was being
//! written when the worker ended. A wrong checksum means damage.

use std::collections::BTreeSet;
use std::fs::{File, OpenOptions};
use std::io::{self, Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};

use crate::protocol::v1::{LeaseResult, Origin, Unit, UnitResult};
use problem::Campaign;
use prost::Message as _;
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use crate::shards::error::Error;
use crate::shards::shard::{SCHEMA_VERSION, Shard, write_whole};

/// The beginning of the plan of undelivered results; the id of a plan is hex.
const UNDELIVERED: &str = "undelivered-";
/// Size of a record before its content, in bytes.
const HEAD: usize = 12;

/// The header of a part: its shard and campaign.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Header {
    schema_version: u32,
    program_version: String,
    /// The plan of the shard.
    pub plan: String,
    /// The number of the shard, from 1.
    pub shard: u32,
    /// The number of shards in the plan.
    pub shards: u32,
    /// The campaign in the form that workers get.
    campaign_json: String,
    /// The digest of the simulator's answers.
    pub model_digest: String,
    /// The units of the shard.
    units: Vec<Unit>,
}

impl Header {
    /// The header of the results that a worker could not deliver: the only shard of a plan of its
    /// own.
    pub(crate) fn undelivered(worker: &str, campaign_json: &str, model_digest: &str) -> Self {
        Self {
            schema_version: SCHEMA_VERSION,
            program_version: crate::identity::BUILD.to_owned(),
            plan: format!("{UNDELIVERED}{worker}"),
            shard: 1,
            shards: 1,
            campaign_json: campaign_json.to_owned(),
            model_digest: model_digest.to_owned(),
            units: Vec::new(),
        }
    }

    /// Whether the part holds the results that a worker could not deliver.
    #[must_use]
    pub fn is_undelivered(&self) -> bool {
        self.plan.starts_with(UNDELIVERED)
    }

    /// How the campaign of the results is related to `own`.
    #[must_use]
    pub fn kinship(&self, own: &Campaign) -> Kinship {
        match Campaign::from_json(&self.campaign_json) {
            Ok(theirs) if theirs.digest() == own.digest() => Kinship::Same,
            Ok(theirs) if own.extends(&theirs) => Kinship::Earlier,
            _ => Kinship::Foreign,
        }
    }

    /// The header as the first line of a file.
    pub(crate) fn line(&self) -> io::Result<String> {
        Ok(serde_json::to_string(self)? + "\n")
    }
}

/// How the campaign of a part is related to another one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kinship {
    /// They are the same.
    Same,
    /// The other one [extends](Campaign::extends) it: the samples in the part are its samples, too.
    Earlier,
    /// The results are none of the other campaign.
    Foreign,
}

/// A part read from a file.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// The file.
    pub path: PathBuf,
    pub header: Header,
    /// The results of the leases, in the order of their reports.
    pub results: Vec<LeaseResult>,
    /// The end of the last whole record, in bytes.
    end: u64,
}

impl Part {
    /// Reads a part; a truncated record at its end is left out.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let mut bytes = Vec::new();
        File::open(path)
            .and_then(|mut file| file.read_to_end(&mut bytes))
            .map_err(Error::io(path))?;
        let not = |reason: &str| Error::NotAPart {
            path: path.to_owned(),
            reason: reason.to_owned(),
        };
        let line = bytes.iter().position(|byte| *byte == b'\n');
        let line = line.ok_or_else(|| not("it has no first line"))?;
        let header: Header =
            serde_json::from_slice(&bytes[..line]).map_err(|error| not(&error.to_string()))?;
        if header.schema_version != SCHEMA_VERSION {
            return Err(not("it is of another version"));
        }
        if header.program_version != crate::identity::BUILD {
            return Err(Error::Build {
                path: path.to_owned(),
                theirs: header.program_version,
            });
        }
        let mut at = line + 1;
        let mut results = Vec::new();
        while let Some((content, checksum)) = record(&bytes[at..]) {
            let result = LeaseResult::decode(content);
            let (true, Ok(result)) = (checksum == checksum_of(content), result) else {
                return Err(Error::Damaged {
                    path: path.to_owned(),
                    at: at as u64,
                    shard: (!header.is_undelivered()).then_some(header.shard),
                });
            };
            results.push(result);
            at += HEAD + content.len();
        }
        Ok(Self {
            path: path.to_owned(),
            header,
            results,
            end: at as u64,
        })
    }

    /// The units of the shard with missing results.
    #[must_use]
    pub fn missing(&self) -> Vec<Unit> {
        let units = self.header.units.iter();
        units
            .filter(|unit| !is_done(unit, &self.results))
            .copied()
            .collect()
    }

    /// The processes that computed the results, in the order of their first ones, each with its results.
    #[must_use]
    pub fn by_process(&self) -> Vec<(Origin, Vec<UnitResult>)> {
        let mut processes: Vec<(Origin, Vec<UnitResult>)> = Vec::new();
        for result in &self.results {
            let origin = result.origin.clone().unwrap_or_default();
            match processes.iter_mut().find(|(of, _)| *of == origin) {
                Some((_, results)) => results.extend_from_slice(&result.results),
                None => processes.push((origin, result.results.clone())),
            }
        }
        processes
    }

    /// The units of the shard that `results` are about.
    #[must_use]
    pub fn units_with(&self, results: &[UnitResult]) -> Vec<Unit> {
        let about = results.iter().filter_map(|result| result.unit.as_ref());
        let about: BTreeSet<_> = about.map(stream_of).collect();
        let units = self.header.units.iter();
        units
            .filter(|unit| about.contains(&stream_of(unit)))
            .copied()
            .collect()
    }
}

/// The stream of a unit and its generation.
const fn stream_of(unit: &Unit) -> (i32, u64, u64) {
    (unit.kind, unit.index, unit.generation)
}

/// Whether the results cover a unit, or one of them says why the rest of it has no samples.
pub(crate) fn is_done(unit: &Unit, results: &[LeaseResult]) -> bool {
    let of_unit = results.iter().flat_map(|result| &result.results);
    let of_unit = of_unit.filter(|result| {
        let own = result.unit.as_ref().map(stream_of);
        own == Some(stream_of(unit))
    });
    let mut covered = unit.first;
    let end = unit.first + unit.count;
    for result in of_unit {
        let Some(own) = &result.unit else { continue };
        let says_why =
            result.refused.is_some() || result.ruled_out.is_some() || result.error.is_some();
        // A reason applies to all of a unit only if its result begins within the unit.
        if says_why && own.first >= unit.first && own.first < end.max(unit.first + 1) {
            return true;
        }
        if own.first <= covered && own.first + own.count > covered {
            covered = own.first + own.count;
        }
    }
    covered >= end
}

#[derive(Debug)]
pub(crate) struct PartWriter {
    path: PathBuf,
    file: File,
    /// The results in the file.
    pub(crate) results: Vec<LeaseResult>,
}

impl PartWriter {
    /// Opens the part of a shard: a new file, or an existing part of the same shard, which is
    /// continued.
    pub(crate) fn open(path: &Path, shard: &Shard, model_digest: &str) -> Result<Self, Error> {
        let header = Header {
            schema_version: SCHEMA_VERSION,
            program_version: crate::identity::BUILD.to_owned(),
            plan: shard.plan.clone(),
            shard: shard.shard,
            shards: shard.shards,
            campaign_json: shard.campaign_json.clone(),
            model_digest: model_digest.to_owned(),
            units: shard.units().copied().collect(),
        };
        let error = Error::io(path);
        if !path.try_exists().map_err(&error)? {
            let line = header.line().map_err(&error)?;
            write_whole(path, line.as_bytes()).map_err(&error)?;
        }
        let held = Part::read(path)?;
        if held.header.model_digest != header.model_digest && held.header.plan == header.plan {
            return Err(Error::OtherSimulator {
                path: path.to_owned(),
            });
        }
        if held.header != header {
            return Err(Error::OtherShard {
                path: path.to_owned(),
                theirs: held.header.plan,
            });
        }
        let mut file = OpenOptions::new().write(true).open(path).map_err(&error)?;
        file.set_len(held.end).map_err(&error)?;
        file.seek(SeekFrom::End(0)).map_err(&error)?;
        Ok(Self {
            path: path.to_owned(),
            file,
            results: held.results,
        })
    }

    /// Appends results and waits until they are on disk.
    pub(crate) fn append(&mut self, results: &[LeaseResult]) -> Result<(), Error> {
        append(&mut self.file, results).map_err(Error::io(&self.path))?;
        self.results.extend_from_slice(results);
        Ok(())
    }
}

/// Appends the records of results to a file and waits until they are on disk.
pub(crate) fn append(file: &mut File, results: &[LeaseResult]) -> io::Result<()> {
    let mut bytes = Vec::new();
    for result in results {
        let content = result.encode_to_vec();
        bytes.extend((content.len() as u32).to_le_bytes());
        bytes.extend(checksum_of(&content));
        bytes.extend(content);
    }
    file.write_all(&bytes)?;
    file.sync_data()
}

/// Returns the content and the checksum of the first record; none if it is truncated.
fn record(bytes: &[u8]) -> Option<(&[u8], [u8; 8])> {
    let (length, rest) = bytes.split_first_chunk::<4>()?;
    let (checksum, rest) = rest.split_first_chunk::<8>()?;
    let content = rest.get(..u32::from_le_bytes(*length) as usize)?;
    Some((content, *checksum))
}

fn checksum_of(content: &[u8]) -> [u8; 8] {
    let digest: [u8; 32] = Sha256::digest(content).into();
    std::array::from_fn(|byte| digest[byte])
}
