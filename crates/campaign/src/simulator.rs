//! What the stages ask of a simulator, whoever answers: the built-in gear model, or a program from
//! elsewhere.
//!
//! A design is prepared once; then its criteria, its two deterministic analyses and its samples
//! are asked for one by one, because each may take microseconds or hours.

use stats::streams::{Purpose, StreamRng};

use crate::formulation::gears::Gears;
use crate::formulation::{Criteria, Design, Problem};
use crate::variant::Variant;

/// Why a simulator gave no number.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum NoAnswer {
    /// The design cannot be simulated, which is a result: a short name and a sentence, as in
    /// `contact-gap: …`.
    #[error("{0}")]
    Refused(String),
    /// The simulator itself failed. Another attempt may succeed.
    #[error("{0}")]
    Failed(String),
}

/// The state in which a design is analysed without random effects.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// As made: of a gear pair, with unworn flanks.
    Nominal,
    /// As the random samples scatter around: of a gear pair, with Archard's wear.
    Baseline,
}

/// A deterministic analysis of a design in one state.
#[derive(Debug, Clone, PartialEq)]
pub struct Analysis {
    /// The response that is sampled, without random effects: of a gear pair ΔSTE, µm. NaN of a problem
    /// [without a baseline](Problem::has_baseline).
    pub value_um: f64,
    /// What constraints are set on.
    pub criteria: Criteria,
}

/// A simulator of the designs of one campaign.
pub trait Simulator {
    /// The campaign's problem.
    fn problem(&self) -> &Problem;

    /// Which program answers, if it says; part of the model digest.
    fn version(&self) -> Option<String> {
        None
    }

    /// Prepares a design.
    ///
    /// # Errors
    ///
    /// The design cannot be simulated, or the simulator failed.
    fn prepare<'a>(&'a self, design: &Design) -> Result<Box<dyn Prepared + 'a>, NoAnswer>;

    /// Prepares a variant of a design. Only the built-in model takes one that is not plain.
    ///
    /// # Errors
    ///
    /// The variant cannot be simulated, or the simulator failed.
    fn prepare_variant<'a>(
        &'a self,
        variant: &Variant,
    ) -> Result<Box<dyn Prepared + 'a>, NoAnswer> {
        if variant.is_plain() {
            self.prepare(&variant.design)
        } else {
            Err(NoAnswer::Failed(
                "an external simulator takes neither corrections nor another module or wear"
                    .to_owned(),
            ))
        }
    }
}

/// A design, ready to be analysed.
pub trait Prepared {
    /// The design without random effects.
    ///
    /// # Errors
    ///
    /// The design cannot be simulated, or the simulator failed.
    fn analyse(&mut self, state: State) -> Result<Analysis, NoAnswer>;

    /// The response with random effects, drawn from `rng` alone: of a gear pair ΔSTE, µm.
    ///
    /// # Errors
    ///
    /// The simulator failed. A design that was prepared cannot be refused for one of its samples:
    /// which samples are drawn together depends on how the campaign is cut into jobs.
    fn sample(&mut self, rng: &mut StreamRng) -> Result<f64, String>;

    /// How many standard normal coefficients the random flanks are made of; none where it is not
    /// known how a simulator makes them.
    fn modes(&mut self) -> usize {
        0
    }

    /// ΔSTE in µm with the random flanks of these coefficients, as many as [`modes`](Self::modes).
    ///
    /// # Errors
    ///
    /// The simulator takes no coefficients.
    fn sample_at(&mut self, _coefficients: &[f64]) -> Result<f64, String> {
        Err(
            "this simulator draws its wear itself: sampling.coefficients must be \"independent\""
                .to_owned(),
        )
    }
}

/// The built-in gear model, which refuses but never fails.
impl Simulator for Problem {
    fn problem(&self) -> &Problem {
        self
    }

    fn prepare<'a>(&'a self, design: &Design) -> Result<Box<dyn Prepared + 'a>, NoAnswer> {
        // The stream is named by whoever draws samples.
        self.prepare_variant(&Variant::new(design.clone(), (Purpose::Wear, 0)))
    }

    fn prepare_variant<'a>(
        &'a self,
        variant: &Variant,
    ) -> Result<Box<dyn Prepared + 'a>, NoAnswer> {
        let Some(gears) = self.gears() else {
            return Err(NoAnswer::Failed(
                "the built-in model simulates gears: start the worker with --exec 'CMD'".to_owned(),
            ));
        };
        let (pair, wear) = gears.variant(variant).map_err(|error| {
            NoAnswer::Refused(match error {
                gear::Error::Infeasible(infeasible) => {
                    format!("{}: {infeasible}", infeasible.code())
                }
                error => format!("invalid-input: {error}"),
            })
        })?;
        Ok(Box::new(BuiltIn {
            gears,
            pair,
            wear,
            sampler: None,
        }))
    }
}

struct BuiltIn<'a> {
    gears: &'a Gears,
    pair: gear::Pair,
    wear: gear::Wear,
    /// Made for the first sample: an optimiser never asks for one.
    sampler: Option<gear::Sampler>,
}

impl Prepared for BuiltIn<'_> {
    fn analyse(&mut self, state: State) -> Result<Analysis, NoAnswer> {
        let analysis = match state {
            State::Nominal => self.pair.unworn(),
            State::Baseline => self.pair.archard(&self.wear).analysis,
        };
        let pressure = analysis.hertz_pressure_mpa;
        Ok(Analysis {
            value_um: analysis.delta_ste_um,
            criteria: self.gears.pair_criteria(&self.pair, pressure).into(),
        })
    }

    fn sample(&mut self, rng: &mut StreamRng) -> Result<f64, String> {
        Ok(self.sampler().draw(rng))
    }

    fn modes(&mut self) -> usize {
        self.sampler().modes()
    }

    fn sample_at(&mut self, coefficients: &[f64]) -> Result<f64, String> {
        Ok(self.sampler().at(coefficients))
    }
}

impl BuiltIn<'_> {
    fn sampler(&mut self) -> &mut gear::Sampler {
        let class = self.gears.flank_class();
        self.sampler
            .get_or_insert_with(|| self.pair.sampler_of_class(&self.wear, class))
    }
}
