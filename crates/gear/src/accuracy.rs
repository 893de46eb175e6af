//! The errors of the tooth models against finite elements, and the pairs for which they are known.

use crate::input::ToothModel;

/// The error of a tooth model in ΔSTE against finite elements of 24 pairs that it was not fitted to, in
/// words.
#[must_use]
pub const fn model_error(model: ToothModel) -> &'static str {
    match model {
        ToothModel::Coupled => {
            "ΔSTE of 24 compared pairs within 4 % or 0.04 µm of finite elements in the median, 15 % or 0.15 µm at the \
             95th percentile"
        }
        ToothModel::WeberBanaschek => {
            "ΔSTE of 24 compared pairs 19 % from finite elements in the median, 63 % at the 95th percentile"
        }
        ToothModel::HertzBeam | ToothModel::WholeFaceBeam | ToothModel::PrismaticBeam => {
            "several times stiffer than finite elements"
        }
    }
}

/// The pairs for which [`ToothModel::Coupled`] was compared with finite elements, as ranges. Bodies are
/// solid and teeth are not undercut.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    /// Name and unit.
    pub name: &'static str,
    /// Least and greatest value.
    pub limits: [f64; 2],
}

impl Range {
    /// Numbers of teeth.
    pub const TEETH: Self = Self::new("numbers of teeth", [15.0, 80.0]);
    /// Face widths over the normal module.
    pub const FACE_WIDTH: Self = Self::new("face widths in modules", [2.0, 14.0]);
    /// Helix angles, degrees.
    pub const HELIX_ANGLE: Self = Self::new("helix angles in degrees", [0.0, 35.0]);
    /// Rack pressure angles, degrees.
    pub const PRESSURE_ANGLE: Self = Self::new("pressure angles in degrees", [17.5, 25.0]);
    /// Profile shift coefficients.
    pub const PROFILE_SHIFT: Self = Self::new("profile shifts in modules", [-0.1, 0.6]);

    const fn new(name: &'static str, limits: [f64; 2]) -> Self {
        Self { name, limits }
    }

    /// Whether this value is in the range, up to rounding.
    #[must_use]
    pub fn contains(&self, value: f64) -> bool {
        let [low, high] = self.limits;
        let rounding = 1e-9 * high;
        value >= low - rounding && value <= high + rounding
    }
}
