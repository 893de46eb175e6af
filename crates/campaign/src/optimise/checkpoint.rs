//! The state of a run as it is saved.

use ledger::Unit;
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use super::objective::Seen;

/// The version of the form.
const FORMAT: u32 = 1;

/// The bytes of the SHA-256 that a saved state begins with.
const DIGEST_BYTES: usize = 32;

/// The most bytes of a saved state. One of 11 variables has some 20 000; a run with so many restarts
/// that it has more is not saved.
pub const MAX_STATE_BYTES: usize = 1 << 20;

/// The state of an unfinished run as bytes: the SHA-256 of the rest, and JSON. Without the program
/// that wrote it, it means nothing: another build may compute other numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Checkpoint {
    /// The evaluations that it comes after. States of one run with the same number are the same.
    pub evaluations: u64,
    /// The state, [`MAX_STATE_BYTES`] at most; [`Saved::read`] reads it.
    pub state: Vec<u8>,
}

/// The state of an unfinished run, read and checked.
#[derive(Debug, Clone)]
pub struct Saved(pub(super) State);

/// Everything that a run knows between two generations.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct State {
    pub(super) search: cmaes::Run,
    /// The position in the run's random stream, in words of 32 bits.
    pub(super) word: u128,
    pub(super) seen: Seen,
    /// How many times the run has continued beyond the printed evaluations.
    pub(super) continuations: u32,
    /// The evaluations of the searches before this one.
    pub(super) evaluations: u64,
    /// The improvements and the restarts of the printed search, once it has ended.
    pub(super) history: Vec<(u64, f64)>,
    pub(super) restarts: Vec<(u64, String)>,
}

/// A state with what it is of.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Form<S> {
    format: u32,
    stream: String,
    generation: u64,
    state: S,
}

impl State {
    /// The evaluations of all searches so far.
    fn all_evaluations(&self) -> u64 {
        self.evaluations + self.search.evaluations() as u64
    }

    /// The state as bytes; none before the first generation, and of one that is too large.
    pub(super) fn checkpoint(&self, unit: &Unit) -> Option<Checkpoint> {
        let evaluations = self.all_evaluations();
        if evaluations == 0 {
            return None;
        }
        let json = serde_json::to_vec(&Form {
            format: FORMAT,
            stream: unit.stream.to_string(),
            generation: unit.generation.0,
            state: self,
        });
        let json = json.ok()?;
        let state = [&Sha256::digest(&json)[..], &json].concat();
        (state.len() <= MAX_STATE_BYTES).then_some(Checkpoint { evaluations, state })
    }
}

impl Saved {
    /// Reads the state of a run that is to go on.
    ///
    /// # Errors
    ///
    /// A sentence without subject: the bytes are damaged, or are the state of another run.
    pub fn read(bytes: &[u8], unit: &Unit) -> Result<Self, String> {
        let digest = bytes.split_at_checked(DIGEST_BYTES);
        let json = digest.filter(|(digest, json)| Sha256::digest(json)[..] == **digest);
        let (_, json) = json.ok_or("is damaged: its bytes have another digest")?;
        let form: Form<State> =
            serde_json::from_slice(json).map_err(|error| format!("cannot be read: {error}"))?;
        if form.format != FORMAT {
            return Err(format!("has format {}, not {FORMAT}", form.format));
        }
        if form.stream != unit.stream.to_string() || form.generation != unit.generation.0 {
            let Form {
                stream, generation, ..
            } = form;
            return Err(format!(
                "is of {stream}, generation {generation:016x}, and not of {}, generation {:016x}",
                unit.stream, unit.generation.0
            ));
        }
        Ok(Self(form.state))
    }

    /// The evaluations that the state comes after.
    #[must_use]
    pub fn evaluations(&self) -> u64 {
        self.0.all_evaluations()
    }
}
