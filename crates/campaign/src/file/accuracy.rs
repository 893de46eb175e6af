//! `[accuracy]`: the simulator's grid, or the tolerance that chooses it.

use serde::{Deserialize, Serialize};

use super::FileError;
use super::validate::Source;

/// `[accuracy]`: either a tolerance or the grid.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Accuracy {
    /// Root mean square error of a design's percentile that is small enough, µm: chooses the grid and the
    /// estimator in `[sampling]`; see [`crate::accuracy`]. It is not written, what it chooses is.
    #[serde(default, skip_serializing)]
    pub tolerance_um: Option<f64>,
    /// Cells along the path of contact.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cells: Option<u32>,
    /// Mesh phases in one base pitch.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub phases: Option<u32>,
}

impl Accuracy {
    /// The grid: the simulator's own where the section has none.
    #[must_use]
    pub fn grid(&self) -> gear::Discretisation {
        let default = gear::Discretisation::default();
        let or = |chosen: Option<u32>, default| chosen.map_or(default, |count| count as usize);
        gear::Discretisation {
            cells: or(self.cells, default.cells),
            phases: or(self.phases, default.phases),
        }
    }

    pub(super) fn validate(&self, source: Source<'_>, is_external: bool) -> Result<(), FileError> {
        source.require(
            !is_external,
            "accuracy",
            "present",
            "absent where a program simulates: it is the grid of the built-in model",
        )?;
        for (key, count) in [("cells", self.cells), ("phases", self.phases)] {
            let key = format!("accuracy.{key}");
            if let Some(count) = count {
                source.count(&key, count, 8, 4096)?;
            }
        }
        match self.tolerance_um {
            Some(tolerance) => source.positive("accuracy.tolerance_um", tolerance),
            None => Ok(()),
        }
    }
}
