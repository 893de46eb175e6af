//! ΔSTE of a pair over the torque, new and worn.

use gear::{Pair, Sampler, Scatter, Wear};
use stats::streams::{Purpose, stream};

/// Torques at which ΔSTE is computed, in per cent of the pair's.
const TORQUES: [f64; 12] = [
    10.0, 25.0, 40.0, 50.0, 60.0, 70.0, 80.0, 90.0, 100.0, 115.0, 130.0, 150.0,
];
/// Maximum number of randomly worn pairs from which the band is computed.
const BAND_SAMPLES: u32 = 60;

/// ΔSTE of a pair at several torques. Its flanks are worn at the torque that it is designed for.
#[derive(Debug, Clone, PartialEq)]
pub struct TorqueCurves {
    /// Torques on the pinion, N·m.
    pub torque_nm: Vec<f64>,
    /// The torque that the pair is designed for, N·m; one of `torque_nm`.
    pub design_nm: f64,
    /// ΔSTE of the unworn pair at each torque, µm.
    pub unworn_um: Vec<f64>,
    /// ΔSTE with the mean wear at each torque, µm; may be empty.
    pub worn_um: Vec<f64>,
    /// P10 and P90 of ΔSTE over random wear at each torque, µm; may be empty.
    pub band_um: [Vec<f64>; 2],
}

/// The random flanks behind the band of [`over_torque`].
#[derive(Debug, Clone, Copy)]
pub struct RandomFlanks {
    /// The scatter of manufacture.
    pub scatter: Scatter,
    /// The seed of the random numbers.
    pub seed: u64,
    /// Number of pairs; at most 60 are drawn.
    pub samples: u32,
}

/// ΔSTE at torques up to one and a half times that of the pair, under which its flanks are worn: without wear, with the
/// mean of `wear`, and the P10 and P90 of `random` flanks. A curve that is not asked for is empty, and a torque at
/// which the contact cannot be solved has no value.
#[must_use]
pub fn over_torque(pair: &Pair, wear: Option<&Wear>, random: Option<RandomFlanks>) -> TorqueCurves {
    let design_nm = pair.input().pinion_torque * 1e-3;
    let mut curves = TorqueCurves {
        torque_nm: TORQUES.map(|percent| percent * design_nm / 100.0).to_vec(),
        design_nm,
        unworn_um: Vec::new(),
        worn_um: Vec::new(),
        band_um: [Vec::new(), Vec::new()],
    };
    let flanks = wear.map(|wear| (wear, pair.flank_wear(wear)));
    for &torque_nm in &curves.torque_nm {
        let loaded = pair.under(torque_nm * 1e3).ok();
        let of = |value: &dyn Fn(&Pair) -> f64| loaded.as_ref().map_or(f64::NAN, value);
        curves
            .unworn_um
            .push(of(&|loaded| loaded.unworn().delta_ste_um));
        let Some((wear, flanks)) = &flanks else {
            continue;
        };
        curves
            .worn_um
            .push(of(&|loaded| loaded.worn(flanks).analysis.delta_ste_um));
        let Some(random) = random else { continue };
        let drawn = loaded.as_ref().map_or_else(Vec::new, |loaded| {
            draw(loaded.sampler_on(flanks, wear, random.scatter), random)
        });
        for (band, level) in curves.band_um.iter_mut().zip([0.1, 0.9]) {
            let quantile = stats::order_statistic(&drawn, level, 0.95);
            band.push(quantile.map_or(f64::NAN, |quantile| quantile.value));
        }
    }
    curves
}

fn draw(mut sampler: Sampler, random: RandomFlanks) -> Vec<f64> {
    let samples = u64::from(random.samples.min(BAND_SAMPLES));
    (0..samples)
        .map(|sample| sampler.draw(&mut stream(random.seed, Purpose::Wear, 0, sample)))
        .collect()
}
