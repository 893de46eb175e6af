//! The face width of `[pair]`: of both gears, or of each.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::FileError;
use super::validate::Source;

/// Face widths b, mm.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(
    untagged,
    expecting = "face_width_mm must be a number, or the numbers of pinion and mate, [b1, b2]"
)]
#[schemars(title = "number or [pinion, mate]")]
pub enum FaceWidth {
    /// That of both gears.
    Both(f64),
    /// Those of pinion and mate.
    Each([f64; 2]),
}

impl FaceWidth {
    /// The face widths of pinion and mate, mm.
    #[must_use]
    pub const fn each(self) -> [f64; 2] {
        match self {
            Self::Both(width) => [width; 2],
            Self::Each(widths) => widths,
        }
    }

    /// The width over which teeth touch, mm: the smaller one.
    #[must_use]
    pub const fn common(self) -> f64 {
        let [pinion, mate] = self.each();
        pinion.min(mate)
    }

    pub(super) fn validate(self, source: Source<'_>) -> Result<(), FileError> {
        let mut widths = self.each().into_iter();
        widths.try_for_each(|width| source.length("pair.face_width_mm", width))
    }
}

/// The number or numbers as the file has them.
impl fmt::Display for FaceWidth {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Both(width) => width.fmt(f),
            Self::Each([pinion, mate]) => write!(f, "{pinion} and {mate}"),
        }
    }
}
