//! Random flanks: one ΔSTE per draw.
//!
//! The gap of a sample is g(s) = W1(s) Θ1(θ1) + W2(s) Θ2(θ2) with W1, W2 the depths of
//! [`WearLaw`](crate::WearLaw), θ1 = s/r_b1 and θ2 = (L − s)/r_b2 the roll angles of the two gears and
//! Θ1, Θ2 independent fields (see `field`). A multiplier below zero counts as zero. Deviations of
//! manufacture (see `manufacture`) are further random terms of g where they are asked for.

use std::sync::Arc;

use rand::Rng;
use rand_distr::{Distribution as _, StandardNormal};

use crate::field::Field;
use crate::input::{Member, Wear};
use crate::manufacture::{Deviation, Deviations, Scatter};
use crate::mesh::{Mesh, Scratch};
use crate::pair::Pair;
use crate::wear::{FlankWear, subtract_lowest};

/// One random wear of both gears, as a curve over the roll angle of each.
#[derive(Debug, Clone, PartialEq)]
pub struct WearProfile {
    /// Roll angles in rad, [pinion, gear]; increasing for the pinion, decreasing for the gear.
    pub roll: [Vec<f64>; 2],
    /// Wear depth on that gear's flank, mm; negative where material is added.
    pub depth: [Vec<f64>; 2],
    /// Profile slope deviations f_Hα of both gears, mm; zero without [scatter](Scatter).
    pub slope_deviation: [f64; 2],
    /// Growth of the gap along the face that helix slopes and misalignment make, mm; zero without scatter.
    pub tilt: f64,
    /// ΔSTE of the pair with these deviations and worn like this, µm.
    pub delta_ste_um: f64,
}

/// Draws randomly worn versions of one pair.
///
/// A draw takes standard normals from the generator in a fixed order, the modes of the pinion's
/// field, those of the gear's, then one for each deviation of manufacture that is random, and last one for a random
/// share of the depth. Equal generators give equal samples bit for bit and, without a random share, equal wear with and
/// without deviations.
#[derive(Debug, Clone)]
pub struct Sampler {
    /// `None` where the mean-worn flanks have no compliance that can be inverted: samples are NaN.
    mesh: Option<Arc<Mesh>>,
    fields: [Field; 2],
    roll: [Vec<f64>; 2],
    depth: [Vec<f64>; 2],
    deviations: Deviations,
    /// Lower end and width of the range of the worn share, both over the mean share; `None` without a random share.
    life: Option<[f64; 2]>,
    /// Whether the depth may be negative.
    signed: bool,
    relief: Vec<f64>,
    /// µm of transmission error per mm of deflection.
    scale: f64,
    normals: Vec<f64>,
    theta: [Vec<f64>; 2],
    deviation: Deviation,
    /// Worn depth over mean depth in the last draw.
    share: f64,
    gap: Vec<f64>,
    scratch: Scratch,
}

/// The coefficients of one [`Sampler::draw`] from a generator in the same state, for a sampler with this
/// number of [`modes`](Sampler::modes).
pub fn draw_coefficients<R: Rng + ?Sized>(
    rng: &mut R,
    modes: usize,
) -> impl Iterator<Item = f64> + '_ {
    (0..modes).map(move |_| -> f64 { StandardNormal.sample(rng) })
}

impl Pair {
    /// Prepares the drawing of randomly worn pairs. A wear that [`Wear::validate`] refuses gives
    /// NaN samples, never a panic.
    #[must_use]
    pub fn sampler(&self, wear: &Wear) -> Sampler {
        self.sampler_with(wear, Scatter::default())
    }

    /// As [`sampler`](Self::sampler), for gears that deviate at random by this scatter of manufacture.
    #[must_use]
    pub fn sampler_with(&self, wear: &Wear, scatter: Scatter) -> Sampler {
        self.sampler_on(&self.flank_wear(wear), wear, scatter)
    }

    /// As [`sampler_with`](Self::sampler_with), for flanks with the mean wear `flanks`, which another load may have
    /// worn. `wear` gives the random multiplier and the random share of the depth. Samplers of one pair under several
    /// loads have the same flanks for the same coefficients.
    #[must_use]
    pub fn sampler_on(&self, flanks: &FlankWear, wear: &Wear, scatter: Scatter) -> Sampler {
        Sampler::new(self, flanks, wear, scatter)
    }
}

impl Sampler {
    fn new(pair: &Pair, flanks: &FlankWear, wear: &Wear, scatter: Scatter) -> Self {
        let geometry = pair.geometry();
        let roll = Member::BOTH.map(|member| -> Vec<f64> {
            pair.path()
                .iter()
                .map(|&s| geometry.roll_angle(member, s))
                .collect()
        });
        let fields = Member::BOTH.map(|member| {
            let interval = (
                geometry.roll_angle(member, geometry.s_in),
                geometry.roll_angle(member, geometry.s_out),
            );
            Field::new(wear, interval, &roll[member.index()])
        });
        let tilts = pair.input().tooth_model.knows_the_face();
        let deviations = Deviations::new(scatter, pair, tilts);
        let depth = flanks.at(pair.path());
        let (mean_gap, _) = pair.worn_gap(flanks.adds_material(), &depth);
        let mean_share = wear.mean_share();
        Self {
            mesh: pair.mesh_of(&mean_gap, deviations.tilts()).ok(),
            fields,
            roll,
            depth,
            deviations,
            life: wear
                .life
                .filter(|_| mean_share > 0.0)
                .map(|[from, to]| [from / mean_share, (to - from) / mean_share]),
            signed: flanks.adds_material(),
            relief: pair.relief.clone(),
            scale: pair.to_ste_um(1.0),
            normals: Vec::new(),
            theta: [Vec::new(), Vec::new()],
            deviation: Deviation::default(),
            share: 1.0,
            gap: Vec::new(),
            scratch: Scratch::default(),
        }
    }

    /// Number of random numbers in a draw: the modes of both fields, one for each deviation of
    /// manufacture, and one for a random share of the depth.
    #[must_use]
    pub fn modes(&self) -> usize {
        let life = usize::from(self.life.is_some());
        self.fields[0].rank() + self.fields[1].rank() + self.deviations.modes() + life
    }

    /// Share of the variance of each gear's multiplier, [pinion, gear], that the truncated
    /// expansion leaves out, as a mean over the flank: at most 1e-5 for a smooth kernel, one or two
    /// per cent for a rough one (see [`Kernel`](crate::Kernel)), where it is known to about a tenth.
    #[must_use]
    pub fn truncation(&self) -> [f64; 2] {
        [self.fields[0].left_out(), self.fields[1].left_out()]
    }

    /// ΔSTE in µm of one randomly worn pair.
    pub fn draw<R: Rng + ?Sized>(&mut self, rng: &mut R) -> f64 {
        let mut normals = std::mem::take(&mut self.normals);
        normals.clear();
        normals.extend(draw_coefficients(rng, self.modes()));
        let delta_ste_um = self.at(&normals);
        self.normals = normals;
        delta_ste_um
    }

    /// The slope of ΔSTE, µm, in each coefficient: the secant from one standard deviation below
    /// the mean wear to one above. ΔSTE has kinks, so that there is no derivative. Over the
    /// scatter of the wear it is all but linear in most designs, which makes the sum of slopes
    /// times coefficients a strong control variate. Over slope deviations as large as the wear is
    /// deep it is not, and the control is weaker. Costs two analyses for each of the
    /// [`modes`](Self::modes).
    pub fn slopes(&mut self) -> Vec<f64> {
        let mut coefficients = vec![0.0; self.modes()];
        (0..coefficients.len())
            .map(|mode| {
                coefficients[mode] = 1.0;
                let above = self.at(&coefficients);
                coefficients[mode] = -1.0;
                let below = self.at(&coefficients);
                coefficients[mode] = 0.0;
                0.5 * (above - below)
            })
            .collect()
    }

    /// ΔSTE in µm of the pair worn according to the coefficients of the fields' modes, those of the
    /// pinion's field first, then those of the deviations, and that of the share last. Standard normal coefficients
    /// make it a [`draw`](Self::draw), zeros the mean wear. Missing coefficients count as zero;
    /// those beyond [`modes`](Self::modes) are ignored.
    pub fn at(&mut self, coefficients: &[f64]) -> f64 {
        let mut rest = coefficients;
        for (field, theta) in self.fields.iter().zip(&mut self.theta) {
            let (own, others) = rest.split_at(field.rank().min(rest.len()));
            field.evaluate(own, theta);
            rest = others;
        }
        let (deviations, life) = rest.split_at(self.deviations.modes().min(rest.len()));
        self.share = self.life.map_or(1.0, |[least, more]| {
            least + more * stats::normal_probability(life.first().copied().unwrap_or_default())
        });
        let ([pinion, gear], share) = (&self.depth, self.share);
        self.gap.clear();
        // For equal depths the second term is zero, and the gap is exactly the depth times a + b.
        self.gap.extend(
            pinion
                .iter()
                .zip(gear)
                .zip(&self.relief)
                .zip(self.theta[0].iter().zip(&self.theta[1]))
                .map(|(((d1, d2), relief), (a, b))| {
                    relief + share * (d1 * (a + b) + (d2 - d1) * b)
                }),
        );
        self.deviation = self.deviations.of(deviations);
        let scatters = self.deviations.modes() > 0;
        if scatters {
            self.deviations.add_to(&mut self.gap, &self.deviation);
        }
        if self.signed || scatters {
            subtract_lowest(&mut self.gap);
        }
        let Some(mesh) = &self.mesh else {
            return f64::NAN;
        };
        let extremes = mesh.solve_tilted(&self.gap, self.deviation.tilt, &mut self.scratch);
        (extremes.max - extremes.min) * self.scale
    }

    /// As [`draw`](Self::draw), with the wear profiles that gave the ΔSTE.
    pub fn draw_profile<R: Rng + ?Sized>(&mut self, rng: &mut R) -> WearProfile {
        let delta_ste_um = self.draw(rng);
        let depth = [0, 1].map(|i| {
            let theta = self.theta[i].iter();
            let worn = theta
                .zip(&self.depth[i])
                .map(|(theta, depth)| self.share * (theta * depth));
            worn.collect()
        });
        WearProfile {
            roll: self.roll.clone(),
            depth,
            slope_deviation: self.deviation.profile,
            tilt: self.deviation.tilt,
            delta_ste_um,
        }
    }
}
