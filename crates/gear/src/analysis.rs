//! The results of a loaded contact: transmission error and Hertz pressure.

use std::f64::consts::PI;

use crate::balance::Extremes;
use crate::geometry::Geometry;
use crate::input::PairInput;
use crate::mesh::{Mesh, Scratch};

/// Micrometres in a millimetre.
pub(crate) const UM: f64 = 1e3;

/// Static transmission error and highest Hertz pressure over one mesh period.
#[derive(Debug, Clone, PartialEq)]
pub struct Analysis {
    /// Mesh phases in base pitches, increasing, from 0 to below 1; not evenly spaced.
    pub phases: Vec<f64>,
    /// Transverse static transmission error at those phases, µm along the line of action.
    pub ste_um: Vec<f64>,
    /// ΔSTE = max − min over the period, µm. Extremes between the phases are included.
    pub delta_ste_um: f64,
    /// F, the highest Hertz pressure over the phases and the path, MPa.
    pub hertz_pressure_mpa: f64,
}

impl Analysis {
    /// The analysis of a solution whose gaps were measured from the `lowest`, mm.
    pub(crate) fn new(
        geometry: &Geometry,
        mesh: &Mesh,
        scratch: &Scratch,
        extremes: Extremes,
        lowest: f64,
        pressure: &[f64],
    ) -> Self {
        let scale = UM / geometry.beta_b.cos();
        Self {
            phases: mesh
                .frame
                .path
                .phases
                .iter()
                .map(|phi| phi / geometry.base_pitch)
                .collect(),
            ste_um: scratch
                .delta
                .iter()
                .map(|delta| (delta + lowest) * scale)
                .collect(),
            delta_ste_um: (extremes.max - extremes.min) * scale,
            hertz_pressure_mpa: pressure.iter().fold(0.0, |most: f64, &p| most.max(p)),
        }
    }
}

/// Hertz pressure at each of the places `s` under the line load `carried`, MPa: √(w E*/(π R)).
pub(crate) fn pressures(
    input: &PairInput,
    geometry: &Geometry,
    s: &[f64],
    carried: &[f64],
) -> Vec<f64> {
    let modulus = input.contact_modulus();
    s.iter()
        .zip(carried)
        .map(|(&s, w)| (w * modulus / (PI * geometry.relative_radius(s))).sqrt())
        .collect()
}

/// Line load at each of the places `s` under which the Hertz pressure is `pressure`, N per mm of
/// contact line: the inverse of [`pressures`].
pub(crate) fn line_loads(
    input: &PairInput,
    geometry: &Geometry,
    s: &[f64],
    pressure: &[f64],
) -> Vec<f64> {
    let modulus = input.contact_modulus();
    s.iter()
        .zip(pressure)
        .map(|(&s, p)| p * p * PI * geometry.relative_radius(s) / modulus)
        .collect()
}
