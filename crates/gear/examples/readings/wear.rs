//! Wear as one reading of the paper has it, and what it does to a printed design.

use gear::paper::{WEAR, design};
use gear::{Discretisation, Pair, PairInput, TipRule};
use stats::streams::{Purpose, stream};

use crate::support::{PlainSum, TEXTBOOK};

/// What wears a place: sliding times this.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Load {
    /// The greatest Hertz pressure met there, which is how this crate reads Archard's law.
    Greatest,
    /// Its mean over the phases in contact.
    Mean,
    /// That at the roll angle at which the middle of the face touches there.
    MidFace,
    /// That of the load spread evenly over the mean length of contact.
    Nominal,
    /// The greatest load per length of line instead of the pressure.
    Line,
    /// Nothing: wear by sliding alone.
    None,
}

/// Sliding speed, specific sliding of each flank, or the greater specific sliding on both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Sliding {
    Speed,
    Own,
    Greater,
}

/// Whose deepest place has the stated depth: the pair's, each gear's, or that of a typical design,
/// all designs having one coefficient of wear.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Scale {
    Pair,
    Gear,
    Fixed,
}

/// What else is changed, one at a time: where the transmission error is measured, the random field,
/// which gear wears.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Else {
    Nothing,
    NormalToFlank,
    WorkingCircle,
    ReferenceCircle,
    OneField,
    TwiceTheSd,
    OneFieldTwiceTheSd,
    PinionAlone,
    GearAlone,
}

#[derive(Clone, Copy)]
pub(crate) struct Reading {
    pub(crate) load: Load,
    pub(crate) sliding: Sliding,
    pub(crate) scale: Scale,
    pub(crate) tip: TipRule,
    pub(crate) other: Else,
}

/// A printed design under one tip rule, ready for any wear.
pub(crate) struct Case {
    pair: Pair,
    sum: PlainSum,
    s: Vec<f64>,
    /// Θ of both gears at the places `s`, for each sample.
    multipliers: Vec<[Vec<f64>; 2]>,
}

/// ΔSTE of a design in µm.
pub(crate) struct Outcome {
    pub(crate) archard: f64,
    pub(crate) mean: f64,
    pub(crate) sd: f64,
}

impl Case {
    pub(crate) fn new(
        variables: [f64; 6],
        tip_rule: TipRule,
        samples: u64,
    ) -> Result<Self, gear::Error> {
        let input = PairInput {
            tip_rule,
            ..design(variables)
        };
        let pair = Pair::new(&input, &Discretisation::default())?;
        let worn = pair.archard(&WEAR);
        let mut sampler = pair.sampler(&WEAR);
        let multipliers = (0..samples).map(|k| {
            let profile = sampler.draw_profile(&mut stream(2009, Purpose::Wear, 0, k));
            profile.depth.map(|depth| {
                let mut last = 1.0;
                let ratio = depth.iter().zip(&worn.depth).map(|(random, mean)| {
                    // Nothing wears at the pitch point: its neighbour's multiplier will do.
                    if *mean > 1e-9 * WEAR.max_depth {
                        last = random / mean;
                    }
                    last
                });
                ratio.collect()
            })
        });
        let multipliers = multipliers.collect();
        // Four times as many slices as the textbook's keep the sum within half a per cent.
        let sum = PlainSum::new(&pair, &worn.s, [TEXTBOOK[0], 4 * TEXTBOOK[1]]);
        Ok(Self {
            pair,
            sum,
            s: worn.s,
            multipliers,
        })
    }

    /// Load at `s` as the reading counts it, up to a constant shared by all designs.
    fn load(&self, load: Load, s: f64) -> f64 {
        let (g, unworn) = (self.pair.geometry(), self.pair.unworn());
        let p = g.base_pitch;
        let width = g.face_width * g.beta_b.tan();
        let mut touching = Vec::new();
        let mut middle = (f64::INFINITY, 0.0);
        for (phase, &delta) in unworn.phases.iter().zip(&unworn.ste_um) {
            let start = g.s_in + phase * p;
            // How far the line that has passed s, or is about to leave it, is ahead of s.
            let ahead = (start - s).rem_euclid(p);
            touching.extend((ahead <= width).then_some(delta));
            let off = (ahead - 0.5 * width + 0.5 * p).rem_euclid(p) - 0.5 * p;
            if off.abs() < middle.0 {
                middle = (off.abs(), delta);
            }
        }
        let line = |delta: f64| g.beta_b.cos() * delta / (1e3 * self.pair.compliance(s));
        let pressure = |line: f64| (line / g.relative_radius(s)).sqrt();
        let greatest = touching.iter().fold(0.0, |most: f64, &v| most.max(v));
        match load {
            Load::Greatest => pressure(line(greatest)),
            Load::Mean => {
                let sum: f64 = touching.iter().map(|&delta| pressure(line(delta))).sum();
                sum / touching.len() as f64
            }
            Load::MidFace => pressure(line(middle.1)),
            Load::Nominal => pressure(self.pair.base_force() / (g.eps_alpha * g.face_width)),
            Load::Line => line(greatest),
            Load::None => 1.0,
        }
    }

    /// Wear of both flanks at the places `s`, before scaling.
    fn shape(&self, reading: Reading) -> [Vec<f64>; 2] {
        let g = self.pair.geometry();
        let ratio = f64::from(g.teeth[0]) / f64::from(g.teeth[1]);
        let mut shape = [Vec::new(), Vec::new()];
        for &s in &self.s {
            let v = [s, (g.path_length - s) * ratio];
            let wear = self.load(reading.load, s) * (v[0] - v[1]).abs();
            let by = match reading.sliding {
                Sliding::Speed => [1.0; 2],
                Sliding::Own => v,
                Sliding::Greater => [v[0].min(v[1]); 2],
            };
            for i in 0..2 {
                shape[i].push(wear / by[i]);
            }
        }
        shape
    }

    pub(crate) fn outcome(&mut self, wear: &[Vec<f64>; 2], depth: f64, other: Else) -> Outcome {
        let g = self.pair.geometry();
        let measured = match other {
            Else::NormalToFlank => g.beta_b.cos(),
            Else::WorkingCircle => 1.0 / g.alpha_wt.cos(),
            Else::ReferenceCircle => g.r[0] / g.r_b[0],
            _ => 1.0,
        };
        let second = usize::from(!matches!(other, Else::OneField | Else::OneFieldTwiceTheSd));
        let times = match other {
            Else::TwiceTheSd | Else::OneFieldTwiceTheSd => 2.0,
            _ => 1.0,
        };
        let random = |theta: f64| 1.0 + times * (theta - 1.0);
        let [a, b] = wear;
        let archard: Vec<f64> = a.iter().zip(b).map(|(a, b)| depth * (a + b)).collect();
        let archard = measured * self.sum.delta_ste_um(&archard);
        let mut draws = Vec::new();
        for theta in &self.multipliers {
            let at = |k: usize| a[k] * random(theta[0][k]) + b[k] * random(theta[second][k]);
            let gap: Vec<f64> = (0..a.len()).map(|k| depth * at(k)).collect();
            draws.push(measured * self.sum.delta_ste_um(&gap));
        }
        let (mean, sd) = stats::mean_sd(&draws).expect("two or more finite samples");
        Outcome { archard, mean, sd }
    }
}

/// Wear of every case, scaled as the reading says.
pub(crate) fn wears(cases: &[Case], reading: Reading) -> Vec<[Vec<f64>; 2]> {
    let most = |v: &[f64]| v.iter().fold(0.0, |most: f64, &v| most.max(v));
    let mut shapes: Vec<_> = cases.iter().map(|case| case.shape(reading)).collect();
    let deepest: Vec<f64> = shapes.iter().map(|[a, b]| most(a).max(most(b))).collect();
    let logs: f64 = deepest.iter().map(|v| v.ln()).sum();
    let typical = (logs / deepest.len() as f64).exp();
    let resting = match reading.other {
        Else::PinionAlone => 1,
        Else::GearAlone => 0,
        _ => 2,
    };
    for (shape, deepest) in shapes.iter_mut().zip(deepest) {
        for (i, flank) in shape.iter_mut().enumerate() {
            let by = match reading.scale {
                Scale::Pair => deepest,
                Scale::Gear => most(flank),
                Scale::Fixed => typical,
            };
            for v in flank {
                *v = if i == resting { 0.0 } else { *v / by };
            }
        }
    }
    shapes
}

impl Outcome {
    /// The paper's estimate of the percentile.
    pub(crate) fn p90(&self) -> f64 {
        self.mean + 1.28 * self.sd
    }
}
