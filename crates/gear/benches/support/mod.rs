//! Shared by the benches and the speed-accuracy example: random designs of the paper's box, and
//! the plain phase-by-slice sum that the prefix sums are measured against.

use gear::{Kernel, Material, Pair, PairInput, Size, TipRule, ToothModel, Wear};
use rand::RngExt as _;
use stats::streams::StreamRng;

/// The wear of the paper's campaign.
pub(crate) const WEAR: Wear = Wear {
    max_depth: 3.5e-3,
    kernel: Kernel::SquaredExponential,
    range: 0.2,
    variance: 0.01,
};

/// A design of the paper's 6-variable problem: x, ha0, hf0 of both gears; the rest is frozen.
pub(crate) fn design(v: [f64; 6], tooth_model: ToothModel) -> PairInput {
    PairInput {
        teeth: [20, 22],
        size: Size::CentreDistance(110.0),
        pressure_angle: 18_f64.to_radians(),
        helix_angle: 30_f64.to_radians(),
        face_width: 10.0,
        profile_shift: [v[0], v[1]],
        tool_addendum: [v[2], v[3]],
        tool_dedendum: [v[4], v[5]],
        tip_radius: [0.0003, 0.19],
        root_radius: [0.64, 0.23],
        tip_diameter: [None, None],
        tooth_model,
        tip_rule: TipRule::AsCut,
        pinion_torque: 200e3,
        material: Material {
            youngs_modulus_mpa: 200e3,
            poisson_ratio: 0.29,
            yield_mpa: 980.0,
            hertz_limit_mpa: 1550.0,
        },
    }
}

/// A random point of the paper's 6-variable box.
pub(crate) fn in_the_box(rng: &mut StreamRng, tooth_model: ToothModel) -> PairInput {
    let mut v = [0.0; 6];
    for value in &mut v[..2] {
        *value = rng.random_range(-1.0..2.0);
    }
    for value in &mut v[2..] {
        *value = rng.random_range(0.8..1.7);
    }
    design(v, tooth_model)
}

/// One slice of one pair of teeth: where its gap is found in a table, and its stiffness.
struct Slice {
    cell: usize,
    u: f64,
    stiffness: f64,
}

/// The textbook calculation: 64 phases, 21 slices of the face, forces summed slice by slice.
pub(crate) struct PlainSum {
    phases: Vec<Vec<Slice>>,
    base_force: f64,
    scale: f64,
    gaps: Vec<f64>,
}

impl PlainSum {
    pub(crate) const PHASES: usize = 64;
    pub(crate) const SLICES: usize = 21;

    /// Evaluates the compliance in every slice at every phase. `nodes` are the places, increasing,
    /// at which gaps will be given.
    pub(crate) fn new(pair: &Pair, nodes: &[f64]) -> Self {
        let g = pair.geometry();
        let dz = g.face_width / Self::SLICES as f64;
        let phases = (0..Self::PHASES)
            .map(|k| {
                let phi = g.base_pitch * k as f64 / Self::PHASES as f64;
                let mut slices = Vec::new();
                for i in 0..Self::SLICES {
                    let mut s = g.s_in + phi - (i as f64 + 0.5) * dz * g.beta_b.tan();
                    while s <= g.s_out {
                        if s >= g.s_in {
                            let next = nodes.partition_point(|&x| x <= s);
                            let cell = next.clamp(1, nodes.len() - 1) - 1;
                            slices.push(Slice {
                                cell,
                                u: (s - nodes[cell]) / (nodes[cell + 1] - nodes[cell]),
                                stiffness: dz / pair.compliance(s),
                            });
                        }
                        s += g.base_pitch;
                    }
                }
                slices
            })
            .collect();
        Self {
            phases,
            base_force: pair.base_force(),
            scale: 1e3 / g.beta_b.cos(),
            gaps: Vec::new(),
        }
    }

    /// ΔSTE in µm for the gap at the nodes. Slices that would pull are dropped, and taken up again
    /// where they would touch, until none changes.
    pub(crate) fn delta_ste_um(&mut self, gap: &[f64]) -> f64 {
        let (mut least, mut most) = (f64::MAX, f64::MIN);
        for slices in &self.phases {
            self.gaps.clear();
            self.gaps.extend(
                slices
                    .iter()
                    .map(|s| gap[s.cell] + s.u * (gap[s.cell + 1] - gap[s.cell])),
            );
            let (mut delta, mut count) = (f64::INFINITY, usize::MAX);
            loop {
                let (mut force, mut stiffness, mut touching) = (self.base_force, 0.0, 0);
                for (slice, &gap) in slices.iter().zip(&self.gaps) {
                    if gap < delta {
                        force += slice.stiffness * gap;
                        stiffness += slice.stiffness;
                        touching += 1;
                    }
                }
                if touching == count {
                    break;
                }
                (delta, count) = (force / stiffness, touching);
            }
            least = f64::min(least, delta);
            most = f64::max(most, delta);
        }
        (most - least) * self.scale
    }
}
