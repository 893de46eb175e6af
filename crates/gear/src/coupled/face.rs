//! Coupling along the face: how a load at one place of the face moves another place.
//!
//! The displacement is expanded in cosine modes φ_k(z) = √(ε_k/b) cos(kπz/b), ε_0 = 1, ε_k = 2, as a
//! free end mirrors it. Each mode has a gain: the mean displacement (k = 0) has that of a slice, short
//! waves die out. Bending and foundation have gains of their own. Two more terms make the ends of a
//! helical tooth what they are: modes of odd distance couple (the acute corner is soft, the obtuse
//! one stiff), and modes of even distance (the ends are free). A neighbouring tooth is touched at
//! another place of the face, so its kernel is shifted along z.
//!
//! All constants come from finite elements of 36 gears; see the module `coupled`.

use std::f64::consts::PI;

use crate::geometry::Geometry;

/// The most modes: shorter waves than a tenth of the module carry nothing.
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
    pub(crate) fn at(&self, a: usize, b: usize) -> f64 {
        self.values[a * self.strips + b]
    }

    fn new(strips: usize, value: impl Fn(usize, usize) -> f64) -> Self {
        let values = (0..strips * strips)
            .map(|k| value(k / strips, k % strips))
            .collect();
        Self { strips, values }
    }
}

/// The kernels of a pair. Units are 1/mm.
#[derive(Debug, Clone)]
pub(crate) struct Face {
    /// Bending of the loaded tooth.
    pub(crate) bending: Kernel,
    /// Shear and foundation of the loaded tooth, [pinion, gear].
    pub(crate) foundation: [Kernel; 2],
    /// Neighbours n = 1, 2, each ahead and behind: the part that the place on the flank changes
    /// linearly.
    pub(crate) neighbour: [[Kernel; 2]; 2],
    /// The same for the part with the product of both places.
    pub(crate) neighbour_product: [[Kernel; 2]; 2],
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
        let cos: Vec<Vec<f64>> = z
            .iter()
            .map(|z| kappa.iter().map(|kappa| (kappa * z).cos()).collect())
            .collect();
        let sin: Vec<Vec<f64>> = z
            .iter()
            .map(|z| kappa.iter().map(|kappa| (kappa * z).sin()).collect())
            .collect();
        let phi = |strip: usize, k: usize| cos[strip][k] * (weight(k) / b).sqrt();

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

        let bending = Kernel::new(strips, |a, c| {
            (0..modes)
                .map(|k| bending_gain(k) * phi(a, k) * phi(c, k))
                .sum()
        });
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
                    (0..modes).map(|k| phi(a, k) * mixed[k * modes + l]).sum()
                })
                .collect();
            Kernel::new(strips, |a, c| {
                (0..modes).map(|l| half[a * modes + l] * phi(c, l)).sum()
            })
        });

        let transverse_pitch = 2.0 * PI * geometry.r[0] / f64::from(geometry.teeth[0]);
        let shift = transverse_pitch * beta.sin() * beta.cos();
        let decay = |k: usize, rate: f64| (-rate * (x[k] * beta.cos()).powi(2)).exp();
        let shifted = |n: usize, ahead: bool, rate: f64| {
            let offset = if ahead { shift } else { -shift } * n as f64;
            let terms: Vec<[f64; 2]> = (0..modes)
                .map(|k| {
                    let (sin, cos) = (kappa[k] * offset).sin_cos();
                    let size = weight(k) / b * decay(k, rate);
                    [size * cos, 0.5 * size * sin]
                })
                .collect();
            Kernel::new(strips, |a, c| {
                terms
                    .iter()
                    .enumerate()
                    .map(|(k, [even, odd])| {
                        even * cos[a][k] * cos[c][k]
                            + odd * (sin[a][k] * cos[c][k] - cos[a][k] * sin[c][k])
                    })
                    .sum()
            })
        };
        let neighbours = |rates: [f64; 2]| {
            [1, 2].map(|n| [true, false].map(|ahead| shifted(n, ahead, rates[n - 1])))
        };
        let tilt = |sign: f64| {
            Kernel::new(strips, |a, c| {
                if modes > 1 {
                    phi(a, 0) * phi(c, 1) + sign * phi(a, 1) * phi(c, 0)
                } else {
                    0.0
                }
            })
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
