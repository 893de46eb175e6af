//! One pair in all cases of its load, with the flanks that the load wears.

use std::sync::Arc;

use gear::{Analysis, FlankWear, Pair, Sampler, Scatter, Wear};
use rand::Rng;

use crate::file::{Load, LoadCase};

/// A pair under the torque and with the share of wear of each case.
#[derive(Debug, Clone)]
pub struct LoadedCases {
    pair: Arc<Pair>,
    /// The pair under the torque of each case, and the share of the wear's depth.
    cases: Vec<(Arc<Pair>, f64)>,
    wear: Wear,
    /// The mean wear under the load's own torque.
    flanks: FlankWear,
    scatter: Scatter,
}

impl LoadedCases {
    /// The cases of `load`, whose torque `pair` is under, with this wear and this scatter of manufacture.
    ///
    /// # Errors
    ///
    /// The contact under another torque cannot be solved.
    pub fn new(
        pair: Pair,
        load: &Load,
        wear: &Wear,
        scatter: Scatter,
    ) -> Result<Self, gear::Infeasibility> {
        let pair = Arc::new(pair);
        let of = |case: &LoadCase| {
            let torque = 1e3 * load.torque_of(case);
            let loaded = match torque == pair.input().pinion_torque {
                true => Arc::clone(&pair),
                false => Arc::new(pair.under(torque)?),
            };
            Ok((loaded, case.wear))
        };
        let cases: Result<Vec<_>, gear::Infeasibility> = load.all_cases().iter().map(of).collect();
        Ok(Self {
            flanks: pair.flank_wear(wear),
            cases: cases?,
            wear: *wear,
            pair,
            scatter,
        })
    }

    /// The pair under the load's own torque.
    #[must_use]
    pub fn pair(&self) -> &Pair {
        &self.pair
    }

    /// The analyses of new flanks.
    #[must_use]
    pub fn unworn(&self) -> Vec<Analysis> {
        self.cases.iter().map(|(pair, _)| pair.unworn()).collect()
    }

    /// The analyses of flanks with the mean wear in each case.
    #[must_use]
    pub fn worn(&self) -> Vec<Analysis> {
        let worn = |(pair, share): &(Arc<Pair>, f64)| pair.worn(&self.flanks_of(*share)).analysis;
        self.cases.iter().map(worn).collect()
    }

    fn flanks_of(&self, share: f64) -> FlankWear {
        self.flanks.clone().scaled(share)
    }

    /// The random pairs of a sampling, with their ΔSTE in every case.
    #[must_use]
    pub fn sampler(&self) -> CaseSampler {
        let sampler = |(pair, share): &(Arc<Pair>, f64)| {
            pair.sampler_on(&self.flanks_of(*share), &self.wear, self.scatter)
        };
        CaseSampler {
            samplers: self.cases.iter().map(sampler).collect(),
        }
    }
}

/// Draws random pairs, which are the same in all cases.
#[derive(Debug, Clone)]
pub struct CaseSampler {
    samplers: Vec<Sampler>,
}

impl CaseSampler {
    /// Number of random numbers in a draw.
    #[must_use]
    pub fn modes(&self) -> usize {
        self.samplers[0].modes()
    }

    /// ΔSTE in µm of one random pair in every case.
    pub fn draw<R: Rng + ?Sized>(&mut self, rng: &mut R) -> Vec<f64> {
        let modes = self.modes();
        let coefficients: Vec<f64> = gear::draw_coefficients(rng, modes).collect();
        self.at(&coefficients)
    }

    /// ΔSTE in µm in every case of the pair with these coefficients; see [`Sampler::at`].
    pub fn at(&mut self, coefficients: &[f64]) -> Vec<f64> {
        let samplers = self.samplers.iter_mut();
        samplers.map(|sampler| sampler.at(coefficients)).collect()
    }
}
