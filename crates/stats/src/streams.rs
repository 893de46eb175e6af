//! Named random streams: the same numbers wherever and whenever they are drawn.
//!
//! Every random number of a campaign comes from a stream named by (campaign seed, purpose, design
//! index, sample index). The first three make a ChaCha8 key, the last one selects one of that
//! key's 2⁶⁴ streams, so two different names never share a number, and sample 17 of design 1204 is
//! the same on one worker or a thousand, on the first attempt or the fifth.
//!
//! Purpose tags and the key layout are part of the result of every campaign: changing either
//! changes all digests.

use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;

/// The use of a stream. The discriminant is part of the stream's key.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u64)]
pub enum Purpose {
    /// Construction of the design of experiments.
    Doe = 1,
    /// Random wear fields of the DoE's samples.
    Wear = 2,
    /// Random wear fields of an optimum's verification samples.
    Verify = 3,
    /// An optimiser's start point and mutations.
    Optimise = 4,
    /// Start points of the kriging likelihood search.
    Fit = 5,
    /// Anything drawn by tests, examples and benchmarks.
    Test = 6,
}

/// The generator behind every stream.
pub type StreamRng = ChaCha8Rng;

/// Returns the stream named by (`seed`, `purpose`, `design`, `sample`), positioned at its start.
#[must_use]
pub fn stream(seed: u64, purpose: Purpose, design: u64, sample: u64) -> StreamRng {
    let mut key = [0_u8; 32];
    key[0..8].copy_from_slice(&seed.to_le_bytes());
    key[8..16].copy_from_slice(&(purpose as u64).to_le_bytes());
    key[16..24].copy_from_slice(&design.to_le_bytes());
    key[24..32].copy_from_slice(b"pitchln1");
    let mut rng = ChaCha8Rng::from_seed(key);
    rng.set_stream(sample);
    rng
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::Rng as _;

    #[test]
    fn a_name_gives_the_same_numbers_again() {
        let draw = || stream(7, Purpose::Wear, 1204, 17).next_u64();
        assert_eq!(draw(), draw());
    }

    #[test]
    fn every_part_of_the_name_matters() {
        let base = stream(7, Purpose::Wear, 1204, 17).next_u64();
        assert_ne!(base, stream(8, Purpose::Wear, 1204, 17).next_u64());
        assert_ne!(base, stream(7, Purpose::Verify, 1204, 17).next_u64());
        assert_ne!(base, stream(7, Purpose::Wear, 1205, 17).next_u64());
        assert_ne!(base, stream(7, Purpose::Wear, 1204, 18).next_u64());
    }

    /// Pins the first draw: a change of it changes every campaign's digest.
    #[test]
    fn the_first_number_is_pinned() {
        assert_eq!(
            stream(2009, Purpose::Wear, 0, 0).next_u64(),
            11_556_994_561_779_802_607
        );
    }
}
