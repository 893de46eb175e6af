//! The settings of the enrichment.

use std::fmt;

use cmaes::Bounds;
use kriging::{Kernel, Noise};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Error;

/// The infill criterion: the value of an observation. A new design and more samples at an existing
/// one are valued by the same quantity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Criterion {
    /// Expected quantile improvement: by how much the lowest upper quantile among the designs is
    /// expected to fall, given the noise of the observation to come. V. Picheny, D. Ginsbourger,
    /// Y. Richet, G. Caplin, *Quantile-based optimization of noisy computer experiments with tunable
    /// precision*, Technometrics 55(1), 2013.
    ExpectedQuantileImprovement,
    /// Expected improvement of the model that interpolates the noisy model's own predictions, so
    /// that it vanishes at the designs. A. Forrester, A. Keane, N. Bressloff, *Design and analysis
    /// of "noisy" computer experiments*, AIAA Journal 44(10), 2006; with the noisy model's process
    /// variance kept. The value of more samples at a design is the expected improvement of the mean
    /// that is interpolated there, which the samples change.
    ReinterpolatedExpectedImprovement,
    /// Knowledge gradient: by how much the lowest mean among a set of candidates is expected to
    /// fall. P. Frazier, W. Powell, S. Dayanik, *The knowledge-gradient policy for correlated normal
    /// beliefs*, INFORMS Journal on Computing 21(4), 2009. The candidates are the 20 most promising
    /// designs and the new one itself.
    #[default]
    KnowledgeGradient,
}

impl Criterion {
    /// All criteria.
    pub const ALL: [Self; 3] = [
        Self::ExpectedQuantileImprovement,
        Self::ReinterpolatedExpectedImprovement,
        Self::KnowledgeGradient,
    ];
}

/// The name in files and reports.
impl fmt::Display for Criterion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

/// The settings of the enrichment. Start from [`Options::new`] and change single fields.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// The box of the designs, in the caller's units.
    pub bounds: Bounds,
    /// The values of each discrete variable, increasing; none for a continuous one. Empty if all are continuous.
    pub values: Vec<Vec<f64>>,
    /// Seed of the searches within the models.
    pub seed: u64,
    /// The infill criterion.
    pub criterion: Criterion,
    /// The correlation function of the models.
    pub kernel: Kernel,
    /// The source of the noise variances.
    pub noise: Noise,
    /// Whether the logarithm of the response is modelled, too, if all responses are positive. The logarithm
    /// of a response that spans decades is much smoother. The noise stays known: its variance is
    /// divided by the square of the response.
    pub logarithm: bool,
    /// The most observations of a round.
    pub batch: usize,
    /// Samples of a new design.
    pub samples_new: u32,
    /// Further samples at an existing design, each time it is chosen.
    pub samples_more: u32,
    /// The most samples that all rounds may still ask for.
    pub samples_left: u32,
    /// The most rounds.
    pub rounds: usize,
    /// δ of the stopping rule, in the unit of the response.
    pub delta_um: f64,
    /// β of the quantiles by which designs are compared, as a standard normal deviate: 1.28 for
    /// 90 %.
    pub quantile_z: f64,
    /// One infill point in this many is sought in the whole box, with the model of all designs; the
    /// others are sought in the trust regions. With 1, all are sought in the whole box.
    pub global_every: usize,
    /// The most basins: good designs that are far apart, each with a trust region.
    pub basins: usize,
    /// Number of designs, nearest to a basin's best one, that the basin's model is fitted to.
    pub local_points: usize,
    /// Number of designs, nearest to a basin's best one, that the basin's trust region spans.
    pub region_points: usize,
    /// Evaluations of criterion and exact constraints in the search for one infill point.
    pub search_evaluations: usize,
    /// Starts of the search for the covariance parameters.
    pub fit_starts: usize,
}

impl Options {
    /// Defaults: knowledge gradient, batches of 12, 30 samples for a new design and for more samples at an old one,
    /// δ = 0.02, quantiles of 80 %, every third point global, three basins with models of 30 d designs and regions
    /// of 5 d, searches of 300 d evaluations, and five starts of each fit. They were chosen on seven test functions
    /// of 2 to 8 variables; the table of `docs/enrichment.md` has four of them.
    #[must_use]
    pub fn new(bounds: Bounds) -> Self {
        let d = bounds.dimension();
        Self {
            bounds,
            values: Vec::new(),
            seed: 0,
            criterion: Criterion::default(),
            kernel: Kernel::default(),
            noise: Noise::Smoothed,
            logarithm: true,
            batch: 12,
            samples_new: 30,
            samples_more: 30,
            samples_left: u32::MAX,
            rounds: usize::MAX,
            delta_um: 0.02,
            quantile_z: 0.84,
            global_every: 3,
            basins: 3,
            local_points: 30 * d,
            region_points: 5 * d,
            search_evaluations: 300 * d,
            fit_starts: 5,
        }
    }

    /// [`Error::Setting`] for the first setting that is out of range.
    pub(crate) fn check(&self) -> Result<(), Error> {
        let counts = [
            ("batch", self.batch),
            ("samples of a new design", self.samples_new as usize),
            ("further samples", self.samples_more as usize),
            ("share of global points", self.global_every),
            ("basins", self.basins),
            ("local points", self.local_points),
            ("region points", self.region_points),
            ("search evaluations", self.search_evaluations),
        ];
        for (name, count) in counts {
            if count == 0 {
                let (value, expected) = (0.0, "at least 1");
                return Err(Error::Setting {
                    name,
                    value,
                    expected,
                });
            }
        }
        for (name, value) in [("delta", self.delta_um), ("quantile", self.quantile_z)] {
            if !(value >= 0.0 && value.is_finite()) {
                let expected = "finite and not negative";
                return Err(Error::Setting {
                    name,
                    value,
                    expected,
                });
            }
        }
        Ok(())
    }
}
