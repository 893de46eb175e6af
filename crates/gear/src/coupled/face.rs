//! Coupling along the face: how a load at one place of the face moves another place.
//!
//! The displacement is expanded in cosine modes φ_k(z) = √(ε_k/b) cos(kπz/b), ε_0 = 1, ε_k = 2, as a free end mirrors
//! it. Each mode has a gain: the mean displacement (k = 0) has that of a slice, short waves die out. Bending and
//! foundation have gains of their own. Two more terms describe the ends of a helical tooth: modes an odd distance apart
//! couple (the acute corner is soft, the obtuse one stiff), and so do modes an even distance apart (the ends are free).
//! A neighbouring tooth is touched at another place of the face, so its kernel is shifted along z. The kernel of the
//! tooth behind is the transpose of that of the tooth ahead.
//!
//! All constants come from finite elements of 36 gears; see the module `coupled`.

use std::f64::consts::PI;

use crate::geometry::Geometry;
use crate::vectors::with_vectors;

/// The most modes: waves shorter than a tenth of the module carry nothing.
const MOST_MODES: usize = 24;
/// The fewest modes, for faces that are wide enough to have as many strips.
const FEWEST_MODES: usize = 4;

/// A matrix over pairs of strips, row by row.
#[derive(Debug, Clone)]
pub(crate) struct Kernel {
    strips: usize,
    values: Vec<f64>,
}

impl Kernel {
    /// The values of the strip `a` with `count` strips from `first` on.
    #[inline(always)]
    pub(crate) fn part(&self, a: usize, first: usize, count: usize) -> &[f64] {
        &self.values[a * self.strips + first..][..count]
    }

    fn zero(strips: usize) -> Self {
        let values = vec![0.0; strips * strips];
        Self { strips, values }
    }

    /// Adds Σ_k `left(k, a)` `right[k][c]` for every pair (a, c) of strips.
    fn plus(mut self, left: impl Fn(usize, usize) -> f64, right: &[Vec<f64>]) -> Self {
        with_vectors(
            #[inline(always)]
            || {
                for (a, row) in self.values.chunks_exact_mut(self.strips).enumerate() {
                    for (k, right) in right.iter().enumerate() {
                        let left = left(k, a);
                        for (value, right) in row.iter_mut().zip(right) {
                            *value += left * right;
                        }
                    }
                }
            },
        );
        self
    }
}

/// The kernels of a pair. Units are 1/mm.
#[derive(Debug, Clone)]
pub(crate) struct Face {
    /// Bending of the loaded tooth.
    pub(crate) bending: Kernel,
    /// Shear and foundation of the loaded tooth, [pinion, gear].
    pub(crate) foundation: [Kernel; 2],
    /// Displacement of the tooth n = 1, 2 ahead for a load on this one: the part that the place on the
    /// flank changes linearly.
    pub(crate) neighbour: [Kernel; 2],
    /// Displacement of the tooth n = 1, 2 ahead: the part that is proportional to the product of both places.
    pub(crate) neighbour_product: [Kernel; 2],
    /// Tilt: φ_0 φ_1′ ∓ φ_1 φ_0′, antisymmetric and symmetric.
    pub(crate) antisymmetric: Kernel,
    pub(crate) symmetric: Kernel,
}

impl Face {
    /// The kernels between the middles `z` of the strips, mm from the leading end of the face.
    /// `end_gain` is the share by which body terms raise the gain of the mean displacement,
    /// [pinion, gear], at the middle of the path.
    pub(crate) fn new(geometry: &Geometry, z: &[f64], end_gain: [f64; 2]) -> Self {
        let (b, m, beta) = (geometry.face_width, geometry.normal_module, geometry.beta);
        let (t, s2, width) = (beta.tan(), beta.sin().powi(2), b / m);
        let most = z.len().clamp(FEWEST_MODES, MOST_MODES);
        let modes = ((3.2 * width / (PI * beta.cos())).ceil() as usize).clamp(FEWEST_MODES, most);
        let modes = if z.len() == 1 { 1 } else { modes };
        let strips = z.len();
        let kappa: Vec<f64> = (0..modes).map(|k| k as f64 * PI / b).collect();
        let x: Vec<f64> = kappa.iter().map(|kappa| kappa * m).collect();
        let weight = |k: usize| if k == 0 { 1.0 } else { 2.0 };
        // The waves at the strips, mode by mode.
        let waves = |of: &dyn Fn(usize, f64) -> f64| -> Vec<Vec<f64>> {
            (0..modes)
                .map(|k| z.iter().map(|&z| of(k, z)).collect())
                .collect()
        };
        let cos = waves(&|k, z| (kappa[k] * z).cos());
        let sin = waves(&|k, z| (kappa[k] * z).sin());
        let mut phi = cos.clone();
        for (k, phi) in phi.iter_mut().enumerate() {
            phi.iter_mut()
                .for_each(|value| *value *= (weight(k) / b).sqrt());
        }

        let gain = |k: usize, of: &dyn Fn(f64) -> f64| if k == 0 { 1.0 } else { of(x[k]) };
        let foundation_gain = |k| {
            gain(k, &|x| {
                (-1.624 * (x.hypot(0.202) - 0.202)).exp()
                    * (1.0 + (5.29 + 6.8 * s2) / (width * width))
                    * (1.0 + 1.032 * s2)
            })
        };
        let bending_gain = |k| gain(k, &|x| (1.0 + 0.07 * s2) / (1.0 + (1.124 * x).powi(2)));
        let odd = |q: f64| 3.427 * t / (1.0 + 0.455 * t) / (1.0 + 1.273 * q.abs());
        let even = |q: f64| 2.906 * t * t * (-1.26 * q * q).exp();

        let bending = Kernel::zero(strips).plus(|k, a| bending_gain(k) * phi[k][a], &phi);
        let foundation = [0, 1].map(|i| {
            let sign = if i == 0 { 1.0 } else { -1.0 };
            let root = |k: usize| {
                if k == 0 {
                    (1.0 + end_gain[i]).max(0.0).sqrt()
                } else {
                    foundation_gain(k).sqrt()
                }
            };
            let mut mixed = vec![0.0; modes * modes];
            for k in 0..modes {
                for l in 0..modes {
                    let (minus, plus) = (x[k] - x[l], x[k] + x[l]);
                    let couple = if k == l {
                        mixed[k * modes + l] = foundation_gain(k);
                        continue;
                    } else if k.abs_diff(l) % 2 == 1 {
                        sign * (odd(minus) + odd(plus))
                    } else {
                        let xx = x[k] * x[l];
                        even(minus) + even(plus) - 0.229 + 1.32 * xx / (1.0 + 0.45 * xx)
                    };
                    mixed[k * modes + l] =
                        root(k) * root(l) * couple * (weight(k) * weight(l)).sqrt() * m / (2.0 * b);
                }
            }
            // Φ M first, so that a kernel costs strips² × modes.
            let half: Vec<f64> = (0..strips * modes)
                .map(|at| {
                    let (a, l) = (at / modes, at % modes);
                    (0..modes).map(|k| phi[k][a] * mixed[k * modes + l]).sum()
                })
                .collect();
            Kernel::zero(strips).plus(|l, a| half[a * modes + l], &phi)
        });

        let transverse_pitch = 2.0 * PI * geometry.r[0] / f64::from(geometry.teeth[0]);
        let shift = transverse_pitch * beta.sin() * beta.cos();
        let decay = |k: usize, rate: f64| (-rate * (x[k] * beta.cos()).powi(2)).exp();
        // The tooth ahead is touched at another place of the face.
        let shifted = |n: usize, rate: f64| {
            let terms: Vec<[f64; 2]> = (0..modes)
                .map(|k| {
                    let (sin, cos) = (kappa[k] * shift * n as f64).sin_cos();
                    let size = weight(k) / b * decay(k, rate);
                    [size * cos, 0.5 * size * sin]
                })
                .collect();
            let even = |k: usize, a: usize| terms[k][0] * cos[k][a] + terms[k][1] * sin[k][a];
            Kernel::zero(strips)
                .plus(even, &cos)
                .plus(|k, a| -terms[k][1] * cos[k][a], &sin)
        };
        let neighbours = |rates: [f64; 2]| [1, 2].map(|n| shifted(n, rates[n - 1]));
        let tilt = |sign: f64| {
            let tilt = Kernel::zero(strips);
            if modes == 1 {
                return tilt;
            }
            tilt.plus(|_, a| phi[0][a], &phi[1..2])
                .plus(|_, a| sign * phi[1][a], &phi[..1])
        };
        Self {
            bending,
            foundation,
            neighbour: neighbours([2.4, 3.5]),
            neighbour_product: neighbours([6.0, 6.0]),
            antisymmetric: tilt(-1.0),
            symmetric: tilt(1.0),
        }
    }
}
