//! A note of the units that a worker is computing, in a file that survives the worker.
//!
//! A program that simulates can crash its worker: it may end the process group, or use up the memory. The next
//! worker with the same folder reads the note and tells the coordinator which units were being computed, so that only
//! these are suspected. The built-in simulator needs none.
//!
//! The file begins with a header line; then each slot has a record: lease, unit, or zeros while it computes nothing.
//! A record is written by one call and never synced, since it has to outlive only the process. The file is locked
//! while its worker lives.

use std::fs::{self, File};
use std::io::{self, BufRead as _, Read as _, Write as _};
use std::os::unix::fs::FileExt as _;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use ledger::{Generation, LeaseId, StreamId, Unit};
use tracing::warn;

use crate::protocol::v1::{DeadWorker, HeldLease};
use crate::shards::unlocked;

/// The first word of the header.
const MAGIC: &str = "pitchline-begun";
/// The ending of the files' names.
const ENDING: &str = ".begun";
/// Length of a record, in bytes.
const RECORD: usize = 40;

/// The notes of this worker and of former ones.
#[derive(Debug)]
pub(super) struct Journal {
    /// The folder of the notes, and the prefix of their names; none for a worker that makes none.
    place: Option<(PathBuf, String)>,
    slots: usize,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    own: Option<OwnFile>,
    /// The notes of workers that ended without removing them.
    crashed: Vec<OrphanFile>,
}

/// The file of this worker.
#[derive(Debug)]
struct OwnFile {
    path: PathBuf,
    file: File,
    /// Length of the header line, in bytes.
    header: u64,
    /// The slots that compute something.
    busy: Vec<bool>,
}

/// The file of a worker that has ended.
#[derive(Debug)]
struct OrphanFile {
    path: PathBuf,
    /// Keeps other workers away.
    _lock: File,
    worker: DeadWorker,
}

/// The record of a unit, which is cleared on drop.
pub(super) struct Note<'a> {
    journal: &'a Journal,
    slot: Option<usize>,
}

impl Drop for Note<'_> {
    fn drop(&mut self) {
        if let Some(slot) = self.slot
            && let Some(own) = &mut self.journal.state().own
        {
            own.busy[slot] = false;
            own.write(slot, &[0; RECORD]);
        }
    }
}

impl Journal {
    pub(super) fn new(place: Option<(PathBuf, String)>, slots: usize) -> Self {
        Self {
            place,
            slots,
            state: Mutex::default(),
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // A panic cannot leave the state half changed.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The former workers of the campaign with this digest that crashed, with the units that each was computing.
    pub(super) fn crashed(&self, campaign: &str) -> Vec<DeadWorker> {
        let Some((folder, prefix)) = &self.place else {
            return Vec::new();
        };
        let mut state = self.state();
        if state.crashed.is_empty() {
            state.crashed = orphans(folder, prefix, campaign);
        }
        let orphans = state.crashed.iter();
        orphans.map(|orphan| orphan.worker.clone()).collect()
    }

    /// Removes the notes of crashed workers, whose content the coordinator knows.
    pub(super) fn forget_crashed(&self) {
        for orphan in std::mem::take(&mut self.state().crashed) {
            if let Err(error) = fs::remove_file(&orphan.path) {
                warn!(file = %orphan.path.display(), %error, "cannot remove the note of a crashed worker");
            }
        }
    }

    /// Creates this worker's note.
    pub(super) fn open(&self, worker: &str, campaign: &str) {
        let Some((folder, prefix)) = &self.place else {
            return;
        };
        let path = folder.join(format!("{prefix}{worker}{ENDING}"));
        match OwnFile::create(&path, worker, campaign, self.slots) {
            Ok(own) => self.state().own = Some(own),
            Err(error) => warn!(file = %path.display(), %error,
                "cannot write the journal: if a job kills this worker, other jobs are suspected, too"),
        }
    }

    /// Notes that a unit is about to be computed.
    pub(super) fn begin(&self, lease: LeaseId, unit: &Unit) -> Note<'_> {
        let mut state = self.state();
        let slot = state.own.as_mut().and_then(|own| {
            let slot = own.busy.iter().position(|is_busy| !is_busy)?;
            own.busy[slot] = true;
            own.write(slot, &record(lease, unit));
            Some(slot)
        });
        Note {
            journal: self,
            slot,
        }
    }

    /// Removes this worker's note.
    pub(super) fn remove(&self) {
        if let Some(own) = self.state().own.take() {
            // A note that stays has no records once the jobs have ended.
            let _ = fs::remove_file(own.path);
        }
    }
}

impl OwnFile {
    fn create(path: &Path, worker: &str, campaign: &str, slots: usize) -> io::Result<Self> {
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder)?;
        }
        let mut file = File::options().write(true).create_new(true).open(path)?;
        file.lock()?;
        let header = format!("{MAGIC} {worker} {campaign}\n");
        file.write_all(header.as_bytes())?;
        Ok(Self {
            path: path.to_owned(),
            file,
            header: header.len() as u64,
            busy: vec![false; slots],
        })
    }

    fn write(&self, slot: usize, record: &[u8; RECORD]) {
        let at = self.header + (slot * RECORD) as u64;
        if let Err(error) = self.file.write_all_at(record, at) {
            warn!(file = %self.path.display(), %error,
                "cannot write the journal: if a job kills this worker, other jobs are suspected, too");
        }
    }
}

fn record(lease: LeaseId, unit: &Unit) -> [u8; RECORD] {
    let mut record = [0; RECORD];
    let numbers = [
        lease.epoch,
        lease.number,
        unit.stream.key(),
        unit.generation.0,
    ];
    for (place, number) in record.chunks_exact_mut(8).zip(numbers) {
        place.copy_from_slice(&number.to_le_bytes());
    }
    record[32..36].copy_from_slice(&unit.samples.start.to_le_bytes());
    record[36..40].copy_from_slice(&unit.samples.end.to_le_bytes());
    record
}

/// The unit of a record, unless its slot computed nothing.
fn begun(record: &[u8]) -> Option<HeldLease> {
    let number = |at: usize| Some(u64::from_le_bytes(record.get(at..at + 8)?.try_into().ok()?));
    let samples = number(32)?;
    let unit = Unit {
        stream: StreamId::from_key(number(16)?)?,
        generation: Generation(number(24)?),
        samples: samples as u32..(samples >> 32) as u32,
    };
    let lease = LeaseId {
        epoch: number(0)?,
        number: number(8)?,
    };
    (lease.number > 0).then(|| HeldLease {
        id: Some(lease.into()),
        units: vec![(&unit).into()],
    })
}

/// The notes of this campaign in a folder that no living worker holds, in the order of their names.
fn orphans(folder: &Path, prefix: &str, campaign: &str) -> Vec<OrphanFile> {
    let is_note = |name: &str| name.starts_with(prefix) && name.ends_with(ENDING);
    let unlocked = unlocked(folder, is_note).into_iter();
    unlocked
        .filter_map(|(path, file)| read(path, file, campaign))
        .collect()
}

fn read(path: PathBuf, file: File, campaign: &str) -> Option<OrphanFile> {
    let mut reader = io::BufReader::new(&file);
    let mut header = String::new();
    reader.read_line(&mut header).ok()?;
    let [magic, worker, of] = header.split_whitespace().collect::<Vec<_>>()[..] else {
        return None;
    };
    if magic != MAGIC || of != campaign {
        return None;
    }
    let mut records = Vec::new();
    reader.read_to_end(&mut records).ok()?;
    let worker = DeadWorker {
        worker_id: worker.to_owned(),
        begun: records.chunks(RECORD).filter_map(begun).collect(),
    };
    drop(reader);
    Some(OrphanFile {
        path,
        _lock: file,
        worker,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit(design: u32) -> Unit {
        Unit {
            stream: StreamId::design(design),
            generation: Generation(u64::MAX),
            samples: 3..7,
        }
    }

    const LEASE: LeaseId = LeaseId {
        epoch: 9,
        number: 4,
    };

    #[test]
    fn the_next_worker_reads_what_the_last_one_was_computing() {
        let folder = tempfile::tempdir().unwrap();
        let place = || Some((folder.path().to_owned(), "c-".to_owned()));
        let first = Journal::new(place(), 2);
        first.open("0a", "digest");
        let one = first.begin(LEASE, &unit(1));
        let _two = first.begin(LEASE, &unit(2));
        drop(one);
        let _three = first.begin(LEASE, &unit(3));
        let next = Journal::new(place(), 1);
        assert!(next.crashed("digest").is_empty(), "it lives");
        // What a killed process leaves: the file without its lock.
        let path = folder.path().join("c-0a.begun");
        let left = fs::read(&path).unwrap();
        fs::write(folder.path().join("c-0b.begun"), left).unwrap();
        assert!(next.crashed("another").is_empty());
        let [crashed] = &next.crashed("digest")[..] else {
            panic!("one worker has crashed");
        };
        assert_eq!(crashed.worker_id, "0a");
        let units = |held: &HeldLease| Unit::try_from(&held.units[0]).unwrap();
        assert!(crashed.begun.iter().map(units).eq([unit(3), unit(2)]));
        assert_eq!(LeaseId::from(crashed.begun[0].id.unwrap()), LEASE);
        next.forget_crashed();
        assert!(next.crashed("digest").is_empty());
        assert!(path.exists());
        first.remove();
        assert!(!path.exists());
    }

    #[test]
    fn what_is_no_note_is_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in [
            ("c-1.begun", ""),
            ("c-2.begun", "nonsense\n"),
            ("d-3.begun", "x"),
        ] {
            fs::write(folder.path().join(name), text).unwrap();
        }
        let journal = Journal::new(Some((folder.path().to_owned(), "c-".to_owned())), 1);
        assert!(journal.crashed("digest").is_empty());
        journal.forget_crashed();
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 3);
        let without = Journal::new(None, 1);
        without.open("0a", "digest");
        drop(without.begin(LEASE, &unit(1)));
    }
}
