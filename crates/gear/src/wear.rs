//! The mean wear: its depth, and the analysis of the pair worn by it.

use std::sync::Arc;

use crate::analysis::{Analysis, pressures};
use crate::input::{Wear, WearLaw};
use crate::mesh::{Mesh, Scratch};
use crate::pair::Pair;

/// A pair worn by the mean wear.
#[derive(Debug, Clone, PartialEq)]
pub struct WornPair {
    /// The analysis of the worn pair.
    pub analysis: Analysis,
    /// Places on the path of contact, mm from the pinion's base tangent point.
    pub s: Vec<f64>,
    /// Depth of wear W(s) on each flank, mm normal to it; negative where [`WearLaw::Signed`] adds
    /// material.
    pub depth: Vec<f64>,
    /// Greatest Hertz pressure over the mesh period at those places, MPa.
    pub pressure: Vec<f64>,
}

impl Pair {
    /// Wears both flanks by the mean wear and analyses the worn pair.
    ///
    /// [`WearLaw`] has the depth on each flank; the random part of `wear` is not used. A wear that
    /// [`Wear::validate`] refuses gives NaN, never a panic.
    #[must_use]
    pub fn archard(&self, wear: &Wear) -> WornPair {
        let depth = self.depth(wear);
        let (gap, lowest) = self.worn_gap(wear, &depth);
        let mesh = self.worn_mesh(&gap);
        let mut scratch = Scratch::default();
        let extremes = mesh.solve(&gap, &mut scratch);
        let carried = mesh.greatest_load(&gap, &scratch, extremes.max, false);
        let pressure = pressures(
            self.input(),
            self.geometry(),
            &self.mesh.frame.path.s,
            &carried,
        );
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
            Some(wear) => self.worn_gap(wear, &self.depth(wear)).0,
            None => self.relief.clone(),
        };
        let mut scratch = Scratch::default();
        let mesh = self.worn_mesh(&gap);
        mesh.solve(&gap, &mut scratch);
        let s = &self.mesh.frame.path.s;
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

    /// The mesh of the worn flanks. Should wear make its compliance singular, the approach of the
    /// unworn ones serves.
    fn worn_mesh(&self, gap: &[f64]) -> Arc<Mesh> {
        self.mesh_of(gap, false)
            .unwrap_or_else(|_| Arc::clone(&self.mesh))
    }

    /// The gap at the nodes with wear of this depth on both flanks, and the lowest gap, which is subtracted
    /// from it where the wear may add material; mm.
    pub(crate) fn worn_gap(&self, wear: &Wear, depth: &[f64]) -> (Vec<f64>, f64) {
        let mut gap: Vec<f64> = depth
            .iter()
            .zip(&self.relief)
            .map(|(depth, relief)| relief + 2.0 * depth)
            .collect();
        let lowest = match wear.law {
            WearLaw::Archard { .. } => 0.0,
            WearLaw::Signed { .. } => subtract_lowest(&mut gap),
        };
        (gap, lowest)
    }

    /// Mean wear depth on each flank at the nodes, mm: [`WearLaw`].
    pub(crate) fn depth(&self, wear: &Wear) -> Vec<f64> {
        let places = self.mesh.frame.path.s.iter().zip(self.pressure());
        let s_pitch = self.geometry().s_pitch;
        match wear.law {
            WearLaw::Archard { max_depth_um } => {
                let max_depth = max_depth_um * 1e-3;
                let mut depth: Vec<f64> = places.map(|(s, p)| p * (s - s_pitch).abs()).collect();
                let most = depth.iter().fold(0.0, |most: f64, &v| most.max(v));
                if most > 0.0 {
                    for v in &mut depth {
                        *v = max_depth * (*v / most);
                    }
                }
                depth
            }
            WearLaw::Signed { coefficient } => places
                .map(|(s, p)| coefficient * p * (s_pitch - s))
                .collect(),
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
