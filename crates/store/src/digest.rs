//! Digests of sets of samples.

use std::ops::AddAssign;

use sha2::{Digest as _, Sha256};
use sqlx::error::BoxDynError;
use sqlx::sqlite::{SqliteTypeInfo, SqliteValueRef};
use sqlx::{Decode, Sqlite, Type};

/// The digest that [`Store::samples_digest`](crate::Store::samples_digest) defines, with the number of any stream in the
/// place of the design.
///
/// A sum does not depend on the order of the samples, and it can be updated sample by sample in the
/// transactions that store them; a hash over the whole table in order could not. The price is that
/// the digest is a checksum and not a signature. Two different tables agree by accident with
/// probability 2⁻²⁵⁶, but anybody who can choose samples freely can construct two that agree (the
/// generalised birthday problem; Bellare and Micciancio, *A New Paradigm for Collision-Free
/// Hashing*, 1997). The digest does not reveal samples that were wrong before they were stored.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct SamplesDigest {
    /// The lowest 64 bits first.
    limbs: [u64; 4],
}

impl SamplesDigest {
    pub(crate) fn of(stream: u64, sample: u64, values: &[f64]) -> Self {
        let mut hash = Sha256::new();
        hash.update(stream.to_le_bytes());
        hash.update(sample.to_le_bytes());
        for value in values {
            hash.update(value.to_bits().to_le_bytes());
        }
        Self::from_bytes(&hash.finalize().into())
    }

    fn from_bytes(bytes: &[u8; 32]) -> Self {
        let mut limbs = [0; 4];
        for (limb, bytes) in limbs.iter_mut().zip(bytes.as_chunks().0) {
            *limb = u64::from_le_bytes(*bytes);
        }
        Self { limbs }
    }

    pub(crate) fn limbs(self) -> [u64; 4] {
        self.limbs
    }

    pub(crate) fn to_bytes(self) -> [u8; 32] {
        let mut bytes = [0; 32];
        for (bytes, limb) in bytes.as_chunks_mut().0.iter_mut().zip(self.limbs) {
            *bytes = limb.to_le_bytes();
        }
        bytes
    }

    /// The bytes in hex, lowest first, so that the digest of a single sample reads as its SHA-256.
    pub(crate) fn to_hex(self) -> String {
        hex::encode(self.to_bytes())
    }
}

impl Type<Sqlite> for SamplesDigest {
    fn type_info() -> SqliteTypeInfo {
        <Vec<u8> as Type<Sqlite>>::type_info()
    }
}

impl<'r> Decode<'r, Sqlite> for SamplesDigest {
    fn decode(value: SqliteValueRef<'r>) -> Result<Self, BoxDynError> {
        let bytes: &[u8; 32] = <&[u8] as Decode<Sqlite>>::decode(value)?.try_into()?;
        Ok(Self::from_bytes(bytes))
    }
}

impl AddAssign for SamplesDigest {
    fn add_assign(&mut self, other: Self) {
        let mut carry = false;
        for (limb, other) in self.limbs.iter_mut().zip(other.limbs) {
            let (sum, over) = limb.overflowing_add(other);
            let (sum, over_again) = sum.overflowing_add(u64::from(carry));
            *limb = sum;
            carry = over || over_again;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn carries_run_through_all_limbs_and_out_of_the_last() {
        let largest = SamplesDigest::from_bytes(&[0xff; 32]);
        let mut one = [0; 32];
        one[0] = 1;
        let one = SamplesDigest::from_bytes(&one);
        let mut sum = largest;
        sum += one;
        assert_eq!(sum, SamplesDigest::default());
        sum += largest;
        assert_eq!(sum, largest);
        // 2^64 − 1 + 2^64 − 1 without a carry, in the lowest limb only.
        let mut low = SamplesDigest {
            limbs: [u64::MAX, 0, u64::MAX, 0],
        };
        low += low;
        assert_eq!(low.limbs, [u64::MAX - 1, 1, u64::MAX - 1, 1]);
    }

    #[test]
    fn one_sample_shows_its_sha_256() {
        // printf '\x01\0\0\0\0\0\0\0\x02\0\0\0\0\0\0\0\0\0\0\0\0\0\xf8\x3f' | sha256sum
        let digest = SamplesDigest::of(1, 2, &[1.5]);
        assert_eq!(
            digest.to_hex(),
            "67ed80773030edf97eb81715481cff392c429f6a63eecff7d8f5f8ceda2a5229"
        );
        assert_eq!(SamplesDigest::from_bytes(&digest.to_bytes()), digest);
    }
}
