//! The work of one node.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use crate::protocol::v1::{Lease, Unit};
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use crate::shards::error::Error;

/// Version of the files of shards and parts.
pub(super) const SCHEMA_VERSION: u32 = 1;

/// A shard: the jobs of one node.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Shard {
    schema_version: u32,
    program_version: String,
    /// The id of the plan: a digest of the jobs of all its shards.
    pub plan: String,
    /// The number of the shard, from 1.
    pub shard: u32,
    /// The number of shards in the plan.
    pub shards: u32,
    /// The digest of the simulator's answers; none for an external simulator, which only workers
    /// can ask.
    pub model_digest: Option<String>,
    /// The campaign in the form that workers get.
    pub campaign_json: String,
    /// The leases to compute.
    pub leases: Vec<Lease>,
}

impl Shard {
    /// Divides the leases among at most `shards` shards, in turn. No shard is empty.
    #[must_use]
    pub fn deal(
        leases: Vec<Lease>,
        shards: u32,
        (campaign_json, campaign_digest): (&str, &str),
        model_digest: Option<&str>,
    ) -> Vec<Self> {
        let plan = digest_of(&leases, campaign_digest);
        let count = (leases.len() as u32).min(shards);
        let mut dealt: Vec<Vec<Lease>> = vec![Vec::new(); count as usize];
        for (turn, lease) in leases.into_iter().enumerate() {
            dealt[turn % count as usize].push(lease);
        }
        let shard = |(shard, leases)| Self {
            schema_version: SCHEMA_VERSION,
            program_version: crate::identity::BUILD.to_owned(),
            plan: plan.clone(),
            shard,
            shards: count,
            model_digest: model_digest.map(str::to_owned),
            campaign_json: campaign_json.to_owned(),
            leases,
        };
        (1..).zip(dealt).map(shard).collect()
    }

    /// Writes the shard as `N.json` in a folder. The file is whole or does not exist.
    pub fn write(&self, folder: &Path) -> Result<PathBuf, Error> {
        let path = folder.join(format!("{}.json", self.shard));
        let json = serde_json::to_vec(self).map_err(std::io::Error::from);
        json.and_then(|json| write_whole(&path, &json))
            .map_err(Error::io(&path))?;
        Ok(path)
    }

    pub fn read(path: &Path) -> Result<Self, Error> {
        let text = fs::read(path).map_err(Error::io(path))?;
        let not = |reason: String| Error::NotAShard {
            path: path.to_owned(),
            reason,
        };
        let shard: Self = serde_json::from_slice(&text).map_err(|error| not(error.to_string()))?;
        if shard.schema_version != SCHEMA_VERSION {
            return Err(not(format!("its version is {}", shard.schema_version)));
        }
        if shard.program_version != crate::identity::BUILD {
            return Err(Error::Build {
                path: path.to_owned(),
                theirs: shard.program_version,
            });
        }
        Ok(shard)
    }

    /// The units to compute.
    pub fn units(&self) -> impl Iterator<Item = &Unit> {
        self.leases.iter().flat_map(|lease| &lease.units)
    }
}

/// Writes a file that is whole or does not exist, whenever this process is killed.
pub(crate) fn write_whole(path: &Path, content: &[u8]) -> std::io::Result<()> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let fresh = path.with_file_name(format!(".{name}"));
    let mut file = create_fresh(&fresh)?;
    file.write_all(content)?;
    file.sync_all()?;
    fs::rename(&fresh, path)
}

/// Creates a file under a temporary name. A file that has the name is removed first, since it may be a link to another
/// file.
pub(crate) fn create_fresh(path: &Path) -> std::io::Result<fs::File> {
    let _ = fs::remove_file(path);
    fs::File::create_new(path)
}

fn digest_of(leases: &[Lease], campaign_digest: &str) -> String {
    let mut hash = Sha256::new();
    hash.update(campaign_digest);
    for unit in leases.iter().flat_map(|lease| &lease.units) {
        for number in [
            unit.kind as u64,
            unit.index,
            unit.generation,
            unit.first.into(),
            unit.count.into(),
        ] {
            hash.update(number.to_le_bytes());
        }
    }
    hex::encode(&hash.finalize()[..8])
}
