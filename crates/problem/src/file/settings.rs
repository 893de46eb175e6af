//! Sections of all kinds of campaign: DoE, optimiser and verification.

use cmaes::Restarts;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::FileError;
use super::validate::Source;

/// `[doe]`
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Doe {
    /// Number n of designs.
    pub designs: u32,
    /// The kind of design.
    #[serde(default)]
    pub method: doe::Method,
    /// Your own designs, each a list with the values of the variables that are not fixed, in their order. They are the first
    /// designs, and the searches of the baseline begin at them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub points: Vec<Vec<f64>>,
    /// Known samples of the first `points`: for each a list of samples, each with a value of every sampled response. They
    /// take the place of the first samples of a program that draws its random numbers itself. They are part of the campaign, so a
    /// store that was begun without them is refused.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub samples: Vec<Vec<Vec<f64>>>,
    /// Known deterministic responses of the first `points`: for each a list of those that constraints limit, in the order of
    /// the file, and last the baseline if there is one; an empty list if they are not known. The program is not asked for
    /// them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub responses: Vec<Vec<f64>>,
    /// A CSV file with these designs in the place of `points`, relative to the folder of the campaign file: a column for
    /// each of the variables.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub table: Option<String>,
    /// The contents of a row of the table.
    #[serde(default, skip_serializing_if = "TableRows::are_designs")]
    pub table_rows: TableRows,
}

/// The contents of a row of `doe.table`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum TableRows {
    /// A design.
    #[default]
    Designs,
    /// A design, with a column for each deterministic response, too: the table has `responses` as well as `points`. A design
    /// whose responses are not known has a row in which these are empty.
    Responses,
    /// A sample of a design, with a column for each sampled response, too: the table has `samples` as well as `points`.
    /// A design without any has a row in which these are empty. If there is no baseline, and the table has a column for each
    /// deterministic response, it has `responses`, too.
    Samples,
}

impl TableRows {
    fn are_designs(&self) -> bool {
        *self == Self::Designs
    }
}

/// Relative improvement of the criterion below which a restarted run ends: far below the error of any percentile.
const TOLERANCE: f64 = 1e-6;

/// `[optimise]`: the settings of CMA-ES.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Optimise {
    /// Number λ of candidates per generation.
    pub population: u32,
    /// Number µ of candidates that are selected.
    pub parents: u32,
    /// Initial step size, as a fraction of each variable's range.
    pub step: f64,
    /// Largest number of evaluations per start. With `restarts = "from-best"` a run ends before that, after a restart
    /// that improves its best value by less than a millionth.
    pub evaluations: u32,
    /// How a search that has stopped restarts.
    pub restarts: Restarts,
    /// Number of evaluations after which the search restarts from its best point whatever its
    /// state; given with `restarts = "from-best"` and only then.
    pub restart_at: Option<u32>,
    /// Number of independent runs.
    pub starts: u32,
    /// Whether a further approach optimises the sampled percentile itself, without a model: each
    /// feasible design gets as many samples as a design of the DoE.
    #[serde(default)]
    pub direct: bool,
}

impl Optimise {
    /// The settings of a run of CMA-ES within `bounds`.
    #[must_use]
    pub fn run(&self, bounds: cmaes::Bounds) -> cmaes::RunOptions {
        cmaes::RunOptions {
            search: cmaes::Options {
                population: self.population as usize,
                parents: self.parents as usize,
                step: self.step,
                ..cmaes::Options::new(bounds)
            },
            evaluations: self.evaluations as usize,
            tolerance: TOLERANCE,
            restarts: self.restarts,
            restart_at: self.restart_at.map(|at| at as usize),
        }
    }
}

/// `[verify]`: the number of verification samples at each optimum, given directly or by the width of the interval. Without
/// either key, `half_width` is 0.005 for the built-in model, and `samples` is 500 for a program.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Verify {
    /// Number of verification samples at each optimum.
    pub samples: Option<u32>,
    /// Target half width of the 95 % interval, relative to the percentile. The number of samples is estimated from the
    /// first 4000 samples of an optimum.
    pub half_width: Option<f64>,
}

impl Doe {
    pub(super) fn validate(&self, source: Source<'_>) -> Result<(), FileError> {
        let most = match self.method {
            doe::Method::Sobol => doe::SOBOL_POINTS as u32,
            _ => 100_000,
        };
        source.count("doe.designs", self.designs, 2, most)?;
        if let Some(table) = &self.table {
            let expected = "absent beside doe.points, which are the designs themselves";
            source.require(self.points.is_empty(), "doe.table", table, expected)?;
        }
        source.require(
            self.table.is_some() || self.table_rows.are_designs(),
            "doe.table_rows",
            self.table_rows,
            "absent without doe.table",
        )?;
        for (key, known) in [
            ("doe.samples", self.samples.len()),
            ("doe.responses", self.responses.len()),
        ] {
            let points = self.points.len();
            let expected = format!("at most a list for each of doe.points, {points}");
            source.require(known <= points, key, known, &expected)?;
        }
        source.require(
            self.points.len() <= self.designs as usize,
            "doe.points",
            self.points.len(),
            &format!("at most doe.designs, {}", self.designs),
        )?;
        let is_own = self.table.is_some() || !self.points.is_empty();
        source.require(
            self.method != doe::Method::Sobol || !is_own,
            "doe.method",
            self.method,
            "\"maximin\" or \"random\" with doe.points or doe.table: a Sobol sequence cannot start with given designs",
        )
    }
}

impl Verify {
    /// Number of first samples, from which the number for a half width is estimated. They are enough for an interval
    /// at every level from 0.001 to 0.999.
    pub const PILOT: u32 = 4000;
    /// Maximum of the number that is estimated from a half width. Without it the number would grow without bound for a
    /// percentile near zero.
    const MOST: u32 = 100_000;
    /// The half width for the built-in simulator, which takes 0.05 s for the samples.
    const HALF_WIDTH: f64 = 0.005;
    /// The number of samples of an external simulator.
    const SAMPLES: u32 = 500;

    /// Fills in the default of a file without either key.
    pub(super) fn resolved(self, is_external: bool) -> Self {
        match (self.samples, self.half_width, is_external) {
            (None, None, false) => Self {
                half_width: Some(Self::HALF_WIDTH),
                ..self
            },
            (None, None, true) => Self {
                samples: Some(Self::SAMPLES),
                ..self
            },
            _ => self,
        }
    }

    /// Number of samples that every optimum gets first, whatever their values.
    #[must_use]
    pub fn first(&self) -> u32 {
        self.samples.unwrap_or(Self::PILOT)
    }

    /// Most samples that an optimum gets.
    #[must_use]
    pub fn most(&self) -> u32 {
        if self.half_width.is_some() {
            Self::MOST
        } else {
            self.first()
        }
    }

    /// Number of samples of an optimum, estimated from the percentile `pilot` of its first samples;
    /// [`Verify::first`] if no half width is given or `pilot` has no interval.
    #[must_use]
    pub fn wanted(&self, pilot: &stats::IntervalEstimate) -> u32 {
        let (Some(aim), Some((low, high))) = (self.half_width, pilot.interval) else {
            return self.first();
        };
        // The width shrinks with the root of the number of samples. The width of the pilot's interval is known to about
        // 10 %, and 1.2 is the margin for its square.
        let ratio = 0.5 * (high - low) / (aim * pilot.value.abs());
        let wanted = 1.2 * ratio * ratio * pilot.n as f64;
        // 0/0 for a response that is always zero.
        if wanted.is_nan() {
            return self.first();
        }
        (wanted.ceil() as u32).clamp(Self::PILOT, Self::MOST)
    }

    /// Whether an optimum has at least as many samples with these settings as with `held`.
    pub(super) fn extends(&self, held: &Self) -> bool {
        match (self.half_width, held.half_width) {
            (Some(ours), Some(held)) => ours <= held,
            (None, Some(_)) => false,
            (_, None) => self.first() >= held.first(),
        }
    }

    pub(super) fn validate(&self, source: Source<'_>) -> Result<(), FileError> {
        if let Some(half_width) = self.half_width {
            source.require(
                self.samples.is_none(),
                "verify.half_width",
                half_width,
                "left out beside verify.samples, which fixes the number",
            )?;
            source.require(
                (1e-4..=0.5).contains(&half_width),
                "verify.half_width",
                half_width,
                "from 0.0001 to 0.5, relative to the percentile",
            )?;
        }
        match self.samples {
            Some(samples) => source.count("verify.samples", samples, 4, 1_000_000),
            None => Ok(()),
        }
    }
}

impl Default for Optimise {
    /// Settings that suit a response of a few variables.
    fn default() -> Self {
        Self {
            population: 10,
            parents: 5,
            step: 0.3,
            evaluations: 4000,
            restarts: Restarts::Ipop,
            restart_at: None,
            starts: 3,
            direct: false,
        }
    }
}

impl Optimise {
    pub(super) fn validate(&self, source: Source<'_>) -> Result<(), FileError> {
        let count = |key, value, low, high| source.count(key, value, low, high);
        count("optimise.population", self.population, 4, 10_000)?;
        count("optimise.parents", self.parents, 1, self.population)?;
        source.between("optimise.step", self.step, 0.0, 10.0)?;
        count(
            "optimise.evaluations",
            self.evaluations,
            self.population,
            100_000_000,
        )?;
        let key = "optimise.restart_at";
        match (self.restarts, self.restart_at) {
            (Restarts::FromBest, Some(at)) => count(key, at, 1, self.evaluations)?,
            (Restarts::FromBest, None) => {
                return Err(source.missing(key, "given, unless restarts is \"ipop\" or \"bipop\""));
            }
            (_, Some(at)) => {
                return Err(source.refuse(
                    key,
                    at,
                    "absent when restarts is \"ipop\" (if absent) or \"bipop\", which restart when a search \
                     has stopped; beside \"from-best\" it is given",
                ));
            }
            (_, None) => {}
        }
        count("optimise.starts", self.starts, 1, 1000)
    }
}
