//! Profile corrections: material taken off the flanks on purpose, so that teeth that bend under load
//! meet and part gently.
//!
//! Corrections are part of the gap g that the contact closes. Tip relief depends on the place s on the path alone, so
//! it costs nothing beyond the uncorrected pair. Crowning and helix slope depend on the place z along the face. Each
//! coupled cell has its own gap, so they cost nothing more there. For slices, a helix slope lowers the deflection of
//! each line of a helical pair by a different amount. With crowning the face integral is no longer one of s alone and
//! prefix sums do not apply: each phase is integrated piece by piece, and a worn sample takes about seventeen times as
//! long. Amounts are normal to the flank, as wear depths are.
//!
//! Left out: end relief, pressure-angle corrections, topographies.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::geometry::Geometry;
use crate::input::{InputError, Member, check_range, named};

/// The growth of tip relief from its start to the tip.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ReliefShape {
    /// In proportion to the distance from its start.
    #[default]
    Linear,
    /// With the square of that distance, so that it starts without a corner.
    Parabolic,
}

named!(ReliefShape: Linear, Parabolic);

/// Tip relief of one gear: C_a x^k on its last flank points, x from 0 at the start of the relief
/// to 1 at the end of contact, k = 1 or 2 (ISO 21771:2007, 7.4).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TipRelief {
    /// Material taken off where the flank ends (r_Na), mm normal to it; C_a.
    pub amount: f64,
    /// Length of the relieved part along the path of contact, mm.
    pub length: f64,
    /// Linear or parabolic.
    pub shape: ReliefShape,
}

impl TipRelief {
    /// Material taken off at the distance `from_tip` (mm along the path, at least 0) before the
    /// end of contact of this gear's tip, mm.
    #[must_use]
    pub fn depth(&self, from_tip: f64) -> f64 {
        let x = (1.0 - from_tip / self.length).max(0.0);
        match self.shape {
            ReliefShape::Linear => self.amount * x,
            ReliefShape::Parabolic => self.amount * x * x,
        }
    }
}

/// The gap that depends on the place z across the face alone.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Lead {
    /// Gap at both ends, from where it falls as a parabola to zero in the middle; mm.
    pub(crate) crowning: f64,
    /// Growth of the gap from the leading end, z = 0, to the trailing one, z = 1; mm.
    pub(crate) slope: f64,
}

impl Lead {
    /// The same gap with a further slope.
    pub(crate) fn tilted(self, slope: f64) -> Self {
        Self {
            slope: self.slope + slope,
            ..self
        }
    }

    /// Whether the gap is the same all along the face.
    pub(crate) fn is_even(self) -> bool {
        self == Self::default()
    }

    /// Gap at the share `z` of the face, 0 to 1, mm. The slope's own gap is zero at one end.
    pub(crate) fn gap(self, z: f64) -> f64 {
        let x = 1.0 - 2.0 * z;
        let slope = if self.slope < 0.0 {
            self.slope * (z - 1.0)
        } else {
            self.slope * z
        };
        self.crowning * x * x + slope
    }

    /// The least gap, mm.
    pub(crate) fn least(self) -> f64 {
        let vertex = 0.5 - 0.125 * self.slope / self.crowning;
        let ends = self.gap(0.0).min(self.gap(1.0));
        if (0.0..=1.0).contains(&vertex) {
            ends.min(self.gap(vertex))
        } else {
            ends
        }
    }
}

/// The corrections of a pair; the default is none.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Corrections {
    /// Tip relief of pinion and gear.
    pub tip_relief: [Option<TipRelief>; 2],
    /// Lengthwise crowning C_β of both flanks together, mm: the gap at both ends of the face, from
    /// where it falls as a parabola to zero in the middle.
    pub crowning: f64,
    /// Helix slope of both flanks together, mm: how much more material is missing at the trailing end of
    /// the face, which a contact line reaches last, than at the leading end. Positive as for a pinion whose helix
    /// angle is too large, f_Hβ > 0 in ISO 1328-1:2013, or a gear whose helix angle is too small.
    pub helix_slope: f64,
    /// Misalignment of the shafts over the face, mm in the plane of action and across the shafts, with the sign
    /// of the helix slope; the mesh misalignment of ISO 6336-1.
    pub misalignment: f64,
}

impl Corrections {
    /// The same corrections with tip relief on one gear.
    #[must_use]
    pub const fn with_tip_relief(mut self, member: Member, relief: TipRelief) -> Self {
        self.tip_relief[member.index()] = Some(relief);
        self
    }

    /// The same corrections with the given crowning, mm.
    #[must_use]
    pub const fn with_crowning(mut self, crowning: f64) -> Self {
        self.crowning = crowning;
        self
    }

    /// The same corrections with the given helix slope, mm.
    #[must_use]
    pub const fn with_helix_slope(mut self, slope: f64) -> Self {
        self.helix_slope = slope;
        self
    }

    /// The same corrections on shafts with the given misalignment, mm.
    #[must_use]
    pub const fn with_misalignment(mut self, misalignment: f64) -> Self {
        self.misalignment = misalignment;
        self
    }

    /// The gap along the face.
    pub(crate) fn lead(&self, geometry: &Geometry) -> Lead {
        Lead {
            crowning: self.crowning,
            slope: self.helix_slope + self.misalignment * geometry.beta_b.cos(),
        }
    }

    /// Checks that amounts are at least zero and lengths positive.
    ///
    /// # Errors
    /// Names the first field that is out of its domain.
    pub fn validate(&self) -> Result<(), InputError> {
        let depth =
            |field, value: f64| check_range(field, value, 0.0..=1e3, "a depth from 0 to 1000 mm");
        for (relief, fields) in self.tip_relief.iter().zip([
            ["tip_relief[0].amount", "tip_relief[0].length"],
            ["tip_relief[1].amount", "tip_relief[1].length"],
        ]) {
            if let Some(relief) = relief {
                depth(fields[0], relief.amount)?;
                check_range(
                    fields[1],
                    relief.length,
                    1e-6..=1e6,
                    "a length from 1e-6 to 1e6 mm",
                )?;
            }
        }
        depth("crowning", self.crowning)?;
        let slope = |field, value: f64| {
            check_range(field, value, -1e3..=1e3, "a slope from -1000 to 1000 mm")
        };
        slope("helix_slope", self.helix_slope)?;
        slope("misalignment", self.misalignment)
    }

    /// Gap of the tip relief of both gears at `s`, mm.
    #[must_use]
    pub fn relief_at(&self, geometry: &Geometry, s: f64) -> f64 {
        // The pinion's tip touches at the end of the path, the gear's at its start.
        let from_tip = [geometry.s_out - s, s - geometry.s_in];
        self.tip_relief
            .iter()
            .zip(from_tip)
            .map(|(relief, from_tip)| relief.map_or(0.0, |relief| relief.depth(from_tip)))
            .sum()
    }

    /// Length of the path of contact on which no relief takes material off, mm; negative where reliefs are longer
    /// than the path.
    #[must_use]
    pub fn pure_involute(&self, geometry: &Geometry) -> f64 {
        let relieved = self.tip_relief.iter().flatten();
        let relieved = relieved.filter(|relief| relief.amount > 0.0);
        let lengths: f64 = relieved.map(|relief| relief.length).sum();
        geometry.s_out - geometry.s_in - lengths
    }

    /// Whether some tip is relieved.
    pub(crate) fn has_relief(&self) -> bool {
        self.tip_relief
            .iter()
            .flatten()
            .any(|relief| relief.amount > 0.0)
    }

    /// Places on the path where a relief starts.
    pub(crate) fn relief_starts(&self, geometry: &Geometry) -> Vec<f64> {
        let [pinion, gear] = self.tip_relief;
        let pinion = pinion.map(|relief| geometry.s_out - relief.length);
        let gear = gear.map(|relief| geometry.s_in + relief.length);
        pinion.into_iter().chain(gear).collect()
    }
}
