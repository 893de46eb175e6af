//! The fillet of a tooth in the virtual normal section: the trochoid envelope of the rack corner.
//!
//! It is described by γ, the inclination of the corner's normal: γ = 0 at the root circle, γ = π/2 − α_n where the
//! involute takes over.

use crate::quadrature::Point;

/// The trochoid that the rack corner leaves.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Fillet {
    pub(crate) r_n: f64,
    /// Depth of the corner's centre below the rolling line; negative above it.
    pub(crate) h_c: f64,
    pub(crate) rho: f64,
    /// Distance of the corner's centre from the tooth axis along the rolling line.
    pub(crate) x_c: f64,
}

impl Fillet {
    /// Rotation of the gear that brings the corner's point γ to the tooth: (h_c tan γ + x_c)/r_n.
    fn rotation(&self, tan: f64) -> f64 {
        (self.h_c * tan + self.x_c) / self.r_n
    }

    /// Inclination of the tangent against the horizontal.
    pub(crate) fn inclination(&self, gamma: f64) -> f64 {
        gamma + self.rotation(gamma.tan())
    }

    /// The point (x, y) at γ.
    pub(crate) fn point(&self, gamma: f64) -> (f64, f64) {
        let point = self.along(Self::parameter(gamma));
        (point.x, point.y)
    }

    /// |d(x, y)/dγ| for cos γ; not positive beyond a cusp.
    pub(crate) fn speed(&self, cos: f64) -> f64 {
        (self.rho * (self.r_n * cos * cos + self.h_c) + self.h_c * self.h_c / cos)
            / (self.r_n * cos * cos)
    }

    /// The parameter w of the point γ, sinh w = tan γ. In γ the trochoid has a pole at 90°, not far
    /// beyond its end; in w it is smooth all along.
    pub(crate) fn parameter(gamma: f64) -> f64 {
        gamma.tan().asinh()
    }

    /// The point at the parameter w, with the derivative of its height by w.
    pub(crate) fn along(&self, w: f64) -> Point {
        let exp = w.exp();
        let (cosh, tan) = (0.5 * (exp + 1.0 / exp), 0.5 * (exp - 1.0 / exp));
        let cos = 1.0 / cosh;
        let (sin_phi, cos_phi) = self.rotation(tan).sin_cos();
        let depth = self.h_c + self.rho * cos;
        let (x, y) = (-tan * depth, self.r_n - depth);
        // The height grows with sin(inclination) along the curve, and dγ = cos γ dw.
        let climb = cos * (tan * cos_phi + sin_phi);
        Point {
            x: x * cos_phi + y * sin_phi,
            y: y * cos_phi - x * sin_phi,
            rate: self.speed(cos) * cos * climb,
        }
    }

    /// Radius of curvature, ISO 6336-3 form.
    pub(crate) fn curvature_radius(&self, gamma: f64) -> f64 {
        let cos = gamma.cos();
        self.rho + self.h_c * self.h_c / (cos * (self.r_n * cos * cos + self.h_c))
    }
}
