//! The mean wear: its depth, and the analysis of the pair worn by it.

use std::sync::Arc;

use crate::analysis::{Analysis, line_loads, pressures};
use crate::error::Infeasibility;
use crate::input::{LocalAmount, Member, Wear, WearLaw};
use crate::mesh::{Mesh, Scratch};
use crate::pair::Pair;

/// A pair worn by the mean wear.
#[derive(Debug, Clone, PartialEq)]
pub struct WornPair {
    /// The analysis of the worn pair.
    pub analysis: Analysis,
    /// Places on the path of contact, mm from the pinion's base tangent point.
    pub s: Vec<f64>,
    /// Depth of wear W(s) on the pinion's flank and on the gear's, mm normal to it; negative where
    /// [`WearLaw::Signed`] adds material.
    pub depth: [Vec<f64>; 2],
    /// Greatest Hertz pressure over the mesh period at those places, MPa.
    pub pressure: Vec<f64>,
}

/// The mean wear of both flanks.
#[derive(Debug, Clone, PartialEq)]
pub struct FlankWear {
    /// Places on the path of contact, mm from the pinion's base tangent point; increasing.
    s: Vec<f64>,
    /// Depth at those places on the pinion's flank and on the gear's, mm.
    depth: [Vec<f64>; 2],
    /// Whether the depth may be negative.
    adds_material: bool,
}

impl FlankWear {
    /// The same wear with `factor` times the depth everywhere.
    #[must_use]
    pub fn scaled(mut self, factor: f64) -> Self {
        for depth in self.depth.iter_mut().flatten() {
            *depth *= factor;
        }
        self
    }

    /// Whether the depth may be negative.
    pub(crate) const fn adds_material(&self) -> bool {
        self.adds_material
    }

    /// The depth at these increasing places, linear between those that are known and constant beyond them.
    pub(crate) fn at(&self, places: &[f64]) -> [Vec<f64>; 2] {
        if places == self.s {
            return self.depth.clone();
        }
        self.depth.each_ref().map(|depth| {
            let of = |place: &f64| {
                let after = self.s.partition_point(|known| known <= place);
                if after == 0 || after == self.s.len() {
                    return depth[after.min(depth.len() - 1)];
                }
                let [from, to] = [self.s[after - 1], self.s[after]];
                let share = (place - from) / (to - from);
                depth[after - 1] + share * (depth[after] - depth[after - 1])
            };
            places.iter().map(of).collect()
        })
    }
}

impl Pair {
    /// The same pair under another torque on the pinion, N·mm.
    ///
    /// # Errors
    /// [`Infeasibility::ContactUnresolved`], with the tooth model `coupled` only.
    pub fn under(&self, pinion_torque: f64) -> Result<Self, Infeasibility> {
        self.unloaded().clone().under(pinion_torque).load()
    }

    /// The mean wear of the flanks under the load of this pair: that of [`WearLaw`], times the
    /// [mean share](Wear::mean_share). The random part of `wear` is not used.
    #[must_use]
    pub fn flank_wear(&self, wear: &Wear) -> FlankWear {
        let whole = FlankWear {
            s: self.path().to_vec(),
            depth: self.depth(wear),
            adds_material: wear.law.adds_material(),
        };
        whole.scaled(wear.mean_share())
    }

    /// Wears both flanks by the mean wear under the pair's own load, and analyses the worn pair.
    ///
    /// A wear that [`Wear::validate`] refuses gives NaN, never a panic.
    #[must_use]
    pub fn archard(&self, wear: &Wear) -> WornPair {
        self.worn(&self.flank_wear(wear))
    }

    /// Analyses the pair with worn flanks, which another load may have worn.
    #[must_use]
    pub fn worn(&self, wear: &FlankWear) -> WornPair {
        let depth = wear.at(self.path());
        let (gap, lowest) = self.worn_gap(wear.adds_material, &depth);
        let mesh = self.worn_mesh(&gap);
        let mut scratch = Scratch::default();
        let extremes = mesh.solve(&gap, &mut scratch);
        let carried = mesh.greatest_load(&gap, &scratch, extremes.max, false);
        let pressure = pressures(self.input(), self.geometry(), self.path(), &carried);
        WornPair {
            analysis: Analysis::new(
                self.geometry(),
                &mesh,
                &scratch,
                extremes,
                lowest,
                &pressure,
            ),
            s: self.path().to_vec(),
            depth,
            pressure,
        }
    }

    /// The analysis of the pair with a further gap, mm along the normal, at the places of its
    /// [`path`](Self::path), one for each.
    ///
    /// # Panics
    /// If there are not as many gaps as places.
    #[must_use]
    pub fn with_gap(&self, gap: &[f64]) -> Analysis {
        assert_eq!(
            gap.len(),
            self.path().len(),
            "one gap for each place of the path"
        );
        let all: Vec<f64> = gap
            .iter()
            .zip(&self.relief)
            .map(|(gap, relief)| gap + relief)
            .collect();
        let mesh = self.worn_mesh(&all);
        let mut scratch = Scratch::default();
        let extremes = mesh.solve(&all, &mut scratch);
        let carried = mesh.greatest_load(&all, &scratch, extremes.max, false);
        let s = self.path();
        let pressure = pressures(self.input(), self.geometry(), s, &carried);
        Analysis::new(self.geometry(), &mesh, &scratch, extremes, 0.0, &pressure)
    }

    /// Hertz pressure on the flanks, MPa, with the mean wear or without any. Each place of the
    /// [`path`](Self::path) has a row with the pressures in the middles of `parts` even parts of the face,
    /// each taken when the line of contact passes there.
    #[must_use]
    pub fn contact_pattern(&self, wear: Option<&Wear>, parts: usize) -> Vec<Vec<f64>> {
        let gap = match wear {
            Some(wear) => {
                let wear = self.flank_wear(wear);
                self.worn_gap(wear.adds_material, &wear.depth).0
            }
            None => self.relief.clone(),
        };
        let mut scratch = Scratch::default();
        let mesh = self.worn_mesh(&gap);
        mesh.solve(&gap, &mut scratch);
        let s = self.path();
        let columns: Vec<Vec<f64>> = (0..parts)
            .map(|part| {
                let across = (part as f64 + 0.5) / parts as f64;
                let carried = mesh.load_across(&gap, &scratch, across);
                pressures(self.input(), self.geometry(), s, &carried)
            })
            .collect();
        (0..s.len())
            .map(|row| columns.iter().map(|column| column[row]).collect())
            .collect()
    }

    /// The mesh of the worn flanks. The mesh of the unworn flanks is used if wear makes the compliance
    /// singular.
    fn worn_mesh(&self, gap: &[f64]) -> Arc<Mesh> {
        self.mesh_of(gap, false)
            .unwrap_or_else(|_| Arc::clone(&self.mesh))
    }

    /// The gap at the nodes with wear of these depths on the flanks, and the lowest gap, which is subtracted
    /// from it where the wear may add material; mm.
    pub(crate) fn worn_gap(&self, adds_material: bool, depth: &[Vec<f64>; 2]) -> (Vec<f64>, f64) {
        let [pinion, gear] = depth;
        let mut gap: Vec<f64> = pinion
            .iter()
            .zip(gear)
            .zip(&self.relief)
            .map(|((pinion, gear), relief)| relief + (pinion + gear))
            .collect();
        let lowest = if adds_material {
            subtract_lowest(&mut gap)
        } else {
            0.0
        };
        (gap, lowest)
    }

    /// The depth of [`WearLaw`] at the nodes, mm, [pinion, gear].
    fn depth(&self, wear: &Wear) -> [Vec<f64>; 2] {
        let places = self.path().iter().zip(self.pressure());
        let s_pitch = self.geometry().s_pitch;
        match wear.law {
            WearLaw::Archard { max_depth_um } => {
                let mut depth: Vec<f64> = places.map(|(s, p)| p * (s - s_pitch).abs()).collect();
                scale_deepest(std::slice::from_mut(&mut depth), max_depth_um * 1e-3);
                [depth.clone(), depth]
            }
            WearLaw::Signed { coefficient } => {
                let depth: Vec<f64> = places
                    .map(|(s, p)| coefficient * p * (s_pitch - s))
                    .collect();
                [depth.clone(), depth]
            }
            WearLaw::LocalArchard { amount } => {
                let mut depth = self.pressed_sliding();
                match amount {
                    LocalAmount::MaxDepth { max_depth_um } => {
                        scale_deepest(&mut depth, max_depth_um * 1e-3);
                    }
                    LocalAmount::Cycles {
                        coefficient,
                        pinion_cycles,
                    } => {
                        let factor = coefficient * pinion_cycles;
                        for v in depth.iter_mut().flatten() {
                            *v *= factor;
                        }
                    }
                }
                depth
            }
        }
    }

    /// Pressure times sliding distance at the nodes per mesh cycle of the pinion, N/mm, [pinion, gear].
    fn pressed_sliding(&self) -> [Vec<f64>; 2] {
        let (geometry, s) = (self.geometry(), self.path());
        let load = line_loads(self.input(), geometry, s, self.pressure());
        let [z1, z2] = geometry.teeth.map(f64::from);
        let cycles = [1.0, z1 / z2];
        Member::BOTH.map(|member| {
            // A point slides in the transverse section, at β_b to the normal of the contact line.
            let factor = cycles[member.index()] / geometry.beta_b.cos();
            s.iter()
                .zip(&load)
                .map(|(&s, w)| factor * w * geometry.specific_sliding(member, s).abs())
                .collect()
        })
    }
}

/// Scales all depths so that the greatest is `deepest`, unless all are zero.
fn scale_deepest(depth: &mut [Vec<f64>], deepest: f64) {
    let most = depth
        .iter()
        .flatten()
        .fold(0.0, |most: f64, &v| most.max(v));
    if most > 0.0 {
        for v in depth.iter_mut().flatten() {
            *v = deepest * (*v / most);
        }
    }
}

/// Subtracts the lowest gap from all of them and returns it. The deflection and the transmission
/// error fall by as much at every phase; loads and ΔSTE stay.
pub(crate) fn subtract_lowest(gap: &mut [f64]) -> f64 {
    let lowest = gap.iter().fold(f64::INFINITY, |least, &g| least.min(g));
    for g in gap {
        *g -= lowest;
    }
    lowest
}
