//! Options of a fit.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::kernel::Kernel;
use crate::likelihood::gls::Trend;
use crate::likelihood::prior::Estimator;

/// Options of the search for the parameters of the covariance.
#[derive(Debug, Clone, PartialEq)]
pub struct FitOptions {
    /// The correlation function.
    pub kernel: Kernel,
    /// The criterion that the parameters maximise.
    pub estimator: Estimator,
    /// Seed of the random starts and subsets (stream purpose `Fit`).
    pub seed: u64,
    /// Number of starts; at least one is taken.
    pub starts: usize,
    /// The most points on which the likelihood is searched; at least two. More would hardly change the parameters:
    /// their errors fall with the square root of the number, and the time grows with its cube.
    pub subset: usize,
    /// The most quasi-Newton iterations of one search.
    pub max_iterations: usize,
    /// The trend around which the process varies.
    pub trend: Trend,
    /// Whether a nugget is estimated.
    pub nugget: Nugget,
    /// Whether to calibrate the predicted variances, see [`crate::Model::calibrated`].
    pub calibrate: bool,
    /// Whether to refuse a model that is not better than a constant plus noise, with
    /// [`crate::Error::NoStructure`]. Otherwise such a model has the [`crate::Warning::NoStructure`].
    pub refuse_no_structure: bool,
}

impl Default for FitOptions {
    fn default() -> Self {
        Self {
            kernel: Kernel::default(),
            estimator: Estimator::default(),
            seed: 0,
            starts: 20,
            subset: 4000,
            max_iterations: 100,
            trend: Trend::Constant,
            nugget: Nugget::Known,
            calibrate: false,
            refuse_no_structure: false,
        }
    }
}

/// Whether a noise variance is estimated besides the known ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Nugget {
    /// Only the known variances.
    #[default]
    Known,
    /// One more variance, the same for all observations, is estimated and added.
    /// Repeated observations of a point are then not merged, since their scatter determines the nugget; the
    /// fit takes the time of that many points. Only noise-free copies of one observation count once.
    Estimated,
}

impl Nugget {
    pub(crate) fn is_estimated(self) -> bool {
        self == Self::Estimated
    }
}
