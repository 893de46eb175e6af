//! The textbook calculation of ΔSTE, a plain sum over phases and slices: the reference for speed and accuracy
//! of the prefix sums.

use crate::{Pair, ToothModel};

/// One slice of one pair of teeth: where its gap is found in a table, and its stiffness.
struct Slice {
    cell: usize,
    u: f64,
    stiffness: f64,
    /// Gap of a tip corner beyond the path, mm.
    separation: f64,
}

impl Slice {
    fn new(nodes: &[f64], s: f64, stiffness: f64) -> Self {
        let next = nodes.partition_point(|&x| x <= s);
        let cell = next.clamp(1, nodes.len() - 1) - 1;
        Self {
            cell,
            u: (s - nodes[cell]) / (nodes[cell + 1] - nodes[cell]),
            stiffness,
            separation: 0.0,
        }
    }
}

/// The textbook calculation: at each phase, forces summed slice by slice of the face, or tooth by
/// tooth where teeth are whole beams.
pub struct PlainSum {
    phases: Vec<Vec<Slice>>,
    base_force: f64,
    scale: f64,
    gaps: Vec<f64>,
}

impl PlainSum {
    /// Phases and slices of the textbook calculation.
    pub const TEXTBOOK: [usize; 2] = [64, 21];

    /// Evaluates the compliance in every slice at every phase. `nodes` are the places, increasing,
    /// at which gaps will be given.
    #[must_use]
    pub fn new(pair: &Pair, nodes: &[f64], [phases, slices]: [usize; 2]) -> Self {
        let g = pair.geometry();
        if pair.input().tooth_model == ToothModel::WholeFaceBeam {
            return Self::whole_face(pair, nodes, phases);
        }
        let path = &pair.mesh.frame.path;
        let beyond = path.goes_beyond().then(|| pair.beyond());
        let dz = g.face_width / slices as f64;
        let phases = (0..phases)
            .map(|k| {
                let phi = g.base_pitch * k as f64 / phases as f64;
                let mut touching = Vec::new();
                for i in 0..slices {
                    let mut s = path.s_in + phi - (i as f64 + 0.5) * dz * g.beta_b.tan();
                    while s <= path.s_out {
                        if s >= path.s_in {
                            let (before, after) = (g.s_in - s, s - g.s_out);
                            let nearest = s.clamp(g.s_in, g.s_out);
                            touching.push(Slice {
                                separation: beyond.as_ref().map_or(0.0, |b| b.gap(before, after)),
                                ..Slice::new(nodes, nearest, dz / pair.compliance(nearest))
                            });
                        }
                        s += g.base_pitch;
                    }
                }
                touching
            })
            .collect();
        Self {
            phases,
            base_force: pair.base_force(),
            scale: 1e3 / g.beta_b.cos(),
            gaps: Vec::new(),
        }
    }

    fn whole_face(pair: &Pair, nodes: &[f64], phases: usize) -> Self {
        let g = pair.geometry();
        let hertz = 2.0 * pair.input().surface_compliance().iter().sum::<f64>();
        let width = g.face_width * g.beta_b.tan();
        let phases = (0..phases).map(|k| {
            let mut touching = Vec::new();
            let mut end = g.s_in + g.base_pitch * k as f64 / phases as f64;
            while end < g.s_out + width {
                let (lo, hi) = ((end - width).max(g.s_in), end.min(g.s_out));
                if lo < hi {
                    let (s, share) = (0.5 * (lo + hi), (hi - lo) / width);
                    let compliance = pair.compliance(s) + hertz * (1.0 / share - 1.0);
                    touching.push(Slice::new(nodes, s, g.face_width / compliance));
                }
                end += g.base_pitch;
            }
            touching
        });
        Self {
            phases: phases.collect(),
            base_force: pair.base_force(),
            scale: 1e3 / g.beta_b.cos(),
            gaps: Vec::new(),
        }
    }

    /// ΔSTE in µm for the gap at the nodes. Slices that would pull are dropped, and taken up again
    /// where they would touch, until none changes.
    pub fn delta_ste_um(&mut self, gap: &[f64]) -> f64 {
        let (mut least, mut most) = (f64::MAX, f64::MIN);
        for slices in &self.phases {
            self.gaps.clear();
            self.gaps.extend(
                slices
                    .iter()
                    .map(|s| s.separation + gap[s.cell] + s.u * (gap[s.cell + 1] - gap[s.cell])),
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
