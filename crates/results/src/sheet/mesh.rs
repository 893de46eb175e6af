//! Transmission error and stiffness of a loaded pair, as rows.

use std::f64::consts::TAU;

use gear::rating::{Factors, rate};
use gear::{Analysis, Pair};

use super::{Row, Section};

/// Number of harmonics of the mesh frequency in the sheet.
const ORDERS: usize = 5;

/// Names of the harmonics in JSON and in words.
const HARMONICS: [(&str, &str); ORDERS] = [
    ("ste_order_1_um", "amplitude of mesh order 1"),
    ("ste_order_2_um", "amplitude of mesh order 2"),
    ("ste_order_3_um", "amplitude of mesh order 3"),
    ("ste_order_4_um", "amplitude of mesh order 4"),
    ("ste_order_5_um", "amplitude of mesh order 5"),
];

/// The static transmission error of an analysis, with the mean wear or without any, along the line of action and as
/// rotations of pinion and mate: mean, peak to peak, and amplitudes by mesh order.
#[must_use]
pub fn transmission_error(pair: &Pair, analysis: &Analysis, is_worn: bool) -> Section {
    let radii = pair.geometry().r_b;
    let along = |key, quantity, symbol, um| Row::one(key, [quantity, symbol, "µm"], um, 4);
    // 1 µm over a base radius in mm is that many milliradians.
    let turned = |key, quantity, um: f64| {
        Row::each(key, [quantity, "", "µrad"], radii.map(|r| 1e3 * um / r), 2)
    };
    let (phases, ste) = (&analysis.phases, &analysis.ste_um);
    let (mean, range) = (mean(phases, ste), analysis.delta_ste_um);
    let mut rows = vec![
        along("ste_mean_um", "mean", "STE", mean),
        turned("ste_mean_urad", "mean, as a rotation", mean),
        along("ste_peak_to_peak_um", "peak to peak", "ΔSTE", range),
        turned(
            "ste_peak_to_peak_urad",
            "peak to peak, as a rotation",
            range,
        ),
    ];
    rows.extend(
        (1..).zip(HARMONICS).map(|(order, (key, quantity))| {
            along(key, quantity, "", amplitude(phases, ste, order))
        }),
    );
    Section {
        title: match is_worn {
            true => "Static transmission error, mean wear",
            false => "Static transmission error, unworn",
        },
        rows,
    }
}

/// The stiffness of the simulated pair beside that of ISO 6336-1.
#[must_use]
pub fn stiffness(pair: &Pair, factors: &Factors, unworn: &Analysis) -> Section {
    let g = pair.geometry();
    let rated = rate(pair, 1.0, factors).stiffness;
    let unit = "N/(mm·µm)";
    let mean = mean(&unworn.phases, &unworn.ste_um);
    Section {
        title: "Stiffness over the face width",
        rows: vec![
            Row::one(
                "pair_stiffness_n_per_mm_um",
                ["one pair of teeth at the pitch point", "", unit],
                pair.pitch_stiffness(),
                3,
            ),
            Row::one(
                "iso_6336_single_stiffness_n_per_mm_um",
                ["one pair of teeth, ISO 6336-1", "c′", unit],
                rated.single,
                3,
            ),
            Row::one(
                "mesh_stiffness_n_per_mm_um",
                ["mesh, F_bt/b over the mean STE, unworn", "", unit],
                pair.base_force() / (g.face_width * mean),
                3,
            ),
            Row::one(
                "iso_6336_mesh_stiffness_n_per_mm_um",
                ["mesh, ISO 6336-1", "c_γα", unit],
                rated.mesh_alpha,
                3,
            ),
        ],
    }
}

/// Pieces of a periodic curve through values at these phases, from 0 to below or up to 1: both ends, each as phase and
/// value.
fn pieces<'a>(
    phases: &'a [f64],
    values: &'a [f64],
) -> impl Iterator<Item = [[f64; 2]; 2]> + use<'a> {
    let next = phases.iter().copied().skip(1);
    let next = next.zip(values.iter().copied().skip(1));
    let closing = values.first().map(|first| (1.0, *first));
    let starts = phases.iter().zip(values);
    starts
        .zip(next.chain(closing))
        .map(|((&a, &from), (b, to))| [[a, from], [b, to]])
}

/// The mean of a periodic curve over its period.
fn mean(phases: &[f64], values: &[f64]) -> f64 {
    let areas = pieces(phases, values).map(|[[a, from], [b, to]]| 0.5 * (b - a) * (from + to));
    areas.sum()
}

/// The amplitude of the harmonic of this order, from 1, of a periodic curve through values at these phases, which need
/// not be evenly spaced: Fourier's integral by the trapezoidal rule.
pub(crate) fn amplitude(phases: &[f64], values: &[f64], order: usize) -> f64 {
    let omega = TAU * order as f64;
    let part = |f: fn(f64) -> f64| {
        let areas = pieces(phases, values)
            .map(|[[a, from], [b, to]]| 0.5 * (b - a) * (from * f(omega * a) + to * f(omega * b)));
        areas.sum::<f64>()
    };
    2.0 * part(f64::cos).hypot(part(f64::sin))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// At even phases, closed or not, the amplitudes are exact. At those of a spur pair, whose spacing has kinks and
    /// where two phases nearly coincide, they are within half a per cent.
    #[test]
    fn harmonics_have_their_own_amplitudes() {
        let amplitudes = [2.0, 1.0, 0.3, 0.4, 0.1];
        let wave = |x: f64| {
            let harmonics = (1..).zip(amplitudes);
            harmonics.fold(3.0, |sum, (order, amplitude)| {
                let order = f64::from(order);
                sum + amplitude * (TAU * order * x + order).cos()
            })
        };
        let even = |end: u32| (0..end).map(|k| f64::from(k) / 24.0).collect::<Vec<f64>>();
        let mut uneven: Vec<f64> = (0..14).map(|k| f64::from(k) * 0.538 / 13.0).collect();
        uneven.push(0.538 + 1e-6);
        uneven.extend((1..12).map(|k| 0.538 + f64::from(k) * 0.462 / 12.0));
        for (phases, within) in [(even(24), 1e-12), (even(25), 1e-12), (uneven, 5e-3)] {
            let values: Vec<f64> = phases.iter().copied().map(wave).collect();
            assert!((mean(&phases, &values) - 3.0).abs() < within);
            for (order, expected) in (1..).zip(amplitudes) {
                let found = amplitude(&phases, &values, order);
                assert!(
                    (found - expected).abs() < within,
                    "{order}: {found} for {expected}"
                );
            }
        }
    }
}
