//! `[accuracy]`: the simulator's grid, or the tolerance that chooses it.

use gear::Discretisation;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::FileError;
use super::validate::Source;

/// `[accuracy]`: either a tolerance or the grid.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct AccuracySection {
    /// Root mean square error of a design's percentile that is small enough, µm. It chooses the grid and the
    /// estimator in `[sampling]`, whose keys are left out then.
    pub(super) tolerance_um: Option<f64>,
    /// Cells along the path of contact; 64 if absent.
    pub(super) cells: Option<u32>,
    /// Mesh phases in one base pitch; if absent 24 with the tooth model `coupled`, 32 with others.
    pub(super) phases: Option<u32>,
}

impl AccuracySection {
    /// The grid for pairs of this tooth model.
    pub(super) fn grid(self, model: gear::ToothModel) -> Discretisation {
        let default = Discretisation::of(model);
        let or = |count: Option<u32>, default| count.map_or(default, |count| count as usize);
        Discretisation {
            cells: or(self.cells, default.cells),
            phases: or(self.phases, default.phases),
        }
    }
}

impl From<Discretisation> for AccuracySection {
    fn from(grid: Discretisation) -> Self {
        let count = |count| u32::try_from(count).ok();
        Self {
            tolerance_um: None,
            cells: count(grid.cells),
            phases: count(grid.phases),
        }
    }
}

pub(super) fn validate(grid: &Discretisation, source: Source<'_>) -> Result<(), FileError> {
    for (key, count) in [("cells", grid.cells), ("phases", grid.phases)] {
        let count = u32::try_from(count).unwrap_or(u32::MAX);
        source.count(&format!("accuracy.{key}"), count, 8, 4096)?;
    }
    Ok(())
}
