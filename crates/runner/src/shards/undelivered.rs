//! The results that a worker could not deliver, as a part.
//!
//! The worker that writes or delivers such a file holds a lock on it, since the workers of a machine
//! share a folder.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::Write as _;
use std::path::{Path, PathBuf};

use crate::protocol::v1::{LeaseId, LeaseResult};
use problem::Campaign;

use crate::shards::error::Error;
use crate::shards::part::{self, Header, Part};
use crate::shards::shard::create_fresh;

/// The ending of the files' names.
const ENDING: &str = "part";

/// A worker's file of results that it has not delivered yet.
#[derive(Debug)]
pub struct UndeliveredFile {
    path: PathBuf,
    file: File,
    /// The leases whose results are in the file.
    leases: BTreeSet<(u64, u64)>,
}

impl UndeliveredFile {
    /// Creates the file of a worker, and its folder.
    pub fn create(
        folder: &Path,
        worker: &str,
        campaign: &Campaign,
        model_digest: &str,
    ) -> Result<Self, Error> {
        let name = format!("{}-{worker}.{ENDING}", campaign.name);
        let path = folder.join(&name);
        let header = Header::undelivered(worker, &campaign.to_json(), model_digest);
        // The file gets its name once it is locked and has its first line.
        let fresh = folder.join(format!(".{name}"));
        let create = || {
            fs::create_dir_all(folder)?;
            let mut file = create_fresh(&fresh)?;
            file.lock()?;
            file.write_all(header.line()?.as_bytes())?;
            file.sync_all()?;
            fs::rename(&fresh, &path)?;
            Ok(file)
        };
        let file = create().map_err(Error::io(&path))?;
        Ok(Self {
            path,
            file,
            leases: BTreeSet::new(),
        })
    }

    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Number of leases with results in the file.
    #[must_use]
    pub fn len(&self) -> usize {
        self.leases.len()
    }

    /// Whether the file has no results.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.leases.is_empty()
    }

    /// Adds the results of leases that are not in the file yet, and waits until they are on disk.
    pub fn keep(&mut self, results: Vec<LeaseResult>) -> Result<(), Error> {
        let of = |result: &LeaseResult| key(result.id.unwrap_or_default());
        let mut results = results;
        results.retain(|result| !self.leases.contains(&of(result)));
        part::append(&mut self.file, &results).map_err(Error::io(&self.path))?;
        self.leases.extend(results.iter().map(of));
        Ok(())
    }

    /// Removes the file: its results are delivered.
    pub fn remove(self) -> Result<(), Error> {
        fs::remove_file(&self.path).map_err(Error::io(&self.path))
    }
}

impl Drop for UndeliveredFile {
    /// Unlocks the file. Closing it would not: a simulator that is started at this moment has it open, too, until it runs.
    fn drop(&mut self) {
        // If that fails, the lock ends with the last process that has the file open.
        let _ = self.file.unlock();
    }
}

fn key(id: LeaseId) -> (u64, u64) {
    (id.epoch, id.number)
}

/// The file of a worker that has ended.
#[derive(Debug)]
pub struct OrphanFile {
    /// Its content.
    pub part: Part,
    /// Keeps other workers away.
    _lock: File,
}

impl OrphanFile {
    /// The files in a folder that no worker uses, in the order of their names. The errors are those
    /// of files that cannot be used. A folder that does not exist has no files.
    #[must_use]
    pub fn all(folder: &Path) -> Vec<Result<Self, Error>> {
        let is_part = |name: &str| {
            let ending = name.rsplit_once('.').map(|(_, ending)| ending);
            !name.starts_with('.') && ending == Some(ENDING)
        };
        let unlocked = unlocked(folder, is_part).into_iter();
        let read = unlocked.map(|(path, lock)| {
            let part = Part::read(&path)?;
            Ok(Self { part, _lock: lock })
        });
        read.collect()
    }

    /// Removes the file: its results are delivered.
    pub fn remove(self) -> Result<(), Error> {
        fs::remove_file(&self.part.path).map_err(Error::io(&self.part.path))
    }
}

/// The files in a folder whose names satisfy `is_wanted` and that no process has locked, in the order of their names.
/// Each is returned with a lock. A folder that does not exist has no files.
pub(crate) fn unlocked(folder: &Path, is_wanted: impl Fn(&str) -> bool) -> Vec<(PathBuf, File)> {
    let Ok(entries) = fs::read_dir(folder) else {
        return Vec::new();
    };
    let paths = entries.filter_map(|entry| Some(entry.ok()?.path()));
    let mut paths: Vec<PathBuf> = paths
        .filter(|path| {
            path.file_name()
                .and_then(|name| name.to_str())
                .is_some_and(&is_wanted)
        })
        .collect();
    paths.sort_unstable();
    let lock = |path: PathBuf| {
        // Another worker may have removed it, also before it was locked.
        let file = File::open(&path).ok()?;
        file.try_lock().ok()?;
        path.exists().then_some((path, file))
    };
    paths.into_iter().filter_map(lock).collect()
}

#[cfg(test)]
mod tests {
    use crate::protocol::v1::UnitResult;
    use crate::shards::Kinship;

    use super::*;

    fn result(number: u64) -> LeaseResult {
        LeaseResult {
            id: Some(LeaseId { epoch: 1, number }),
            results: vec![UnitResult::default()],
            ..LeaseResult::default()
        }
    }

    #[test]
    fn a_file_is_found_once_its_worker_has_ended_and_holds_each_lease_once() {
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("new");
        assert!(OrphanFile::all(&folder).is_empty());
        let campaign = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
        let mut own = UndeliveredFile::create(&folder, "0a", &campaign, "m").unwrap();
        own.keep(vec![result(1), result(2)]).unwrap();
        own.keep(vec![result(2), result(3)]).unwrap();
        assert!(OrphanFile::all(&folder).is_empty(), "its worker lives");
        let path = own.path().to_owned();
        drop(own);
        let found: Vec<OrphanFile> = OrphanFile::all(&folder)
            .into_iter()
            .map(Result::unwrap)
            .collect();
        assert_eq!(found.len(), 1);
        assert!(
            OrphanFile::all(&folder).is_empty(),
            "another worker delivers it"
        );
        let part = &found[0].part;
        assert_eq!(part.path, path);
        assert_eq!(part.results, [result(1), result(2), result(3)]);
        assert_eq!(part.header.shards, 1);
        // Only a campaign that has all that the worker computed takes the results.
        let mut other = campaign.clone();
        let kinship = |other: &Campaign| part.header.kinship(other);
        assert_eq!(kinship(&other), Kinship::Same);
        other.doe.designs += 1;
        assert_eq!(kinship(&other), Kinship::Earlier);
        other.doe.designs -= 2;
        assert_eq!(kinship(&other), Kinship::Foreign);
        assert!(part.missing().is_empty());
        found.into_iter().for_each(|found| found.remove().unwrap());
        assert!(!path.exists());
        // A file that is not a part is an error, and files with other endings are ignored.
        fs::write(folder.join("x.part"), "nonsense").unwrap();
        fs::write(folder.join("note.txt"), "").unwrap();
        let [Err(error)] = &OrphanFile::all(&folder)[..] else {
            panic!("one error")
        };
        assert!(
            error.to_string().contains("x.part is not a part"),
            "{error}"
        );
    }
}
