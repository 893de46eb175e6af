//! The involute function and its inverse, both through the tangent of the pressure angle.
//!
//! A point of an involute at radius r has the tangent length τ = √(r² − r_b²), the roll angle
//! t = τ/r_b = tan α and the polar angle inv α = tan α − α = t − atan t. Working with t instead of
//! α keeps the base circle (t = 0) free of square-root singularities.

/// The tangent length √(r² − r_b²) at the radius `r`, zero inside the base circle.
pub(crate) fn tangent_length(r: f64, r_b: f64) -> f64 {
    ((r - r_b) * (r + r_b)).max(0.0).sqrt()
}

/// inv of the angle whose tangent is `t`: t − atan t.
pub(crate) fn inv_of_tangent(t: f64) -> f64 {
    if t.abs() < 0.05 {
        // t − atan t cancels to t³/3; five terms of the series are exact to rounding here.
        let t2 = t * t;
        t * t2 * (1.0 / 3.0 - t2 * (1.0 / 5.0 - t2 * (1.0 / 7.0 - t2 * (1.0 / 9.0 - t2 / 11.0))))
    } else {
        t - t.atan()
    }
}

/// The tangent t > 0 with t − atan t = `inv`, for a finite `inv` > 0.
///
/// The function is increasing and convex for t > 0, so Newton's method started anywhere lands at
/// or right of the root with its first step and falls monotonically from there.
pub(crate) fn tangent_of_inv(inv: f64) -> f64 {
    let mut t = if inv < 1.0 {
        (3.0 * inv).cbrt()
    } else {
        inv + std::f64::consts::FRAC_PI_2
    };
    for _ in 0..60 {
        let step = (inv_of_tangent(t) - inv) * (1.0 + t * t) / (t * t);
        t -= step;
        if step.abs() <= 1e-16 * t {
            break;
        }
    }
    t
}

#[cfg(test)]
mod tests {
    use super::*;

    /// inv 20° = 0.014 904 383 867 336 5 is in every gear handbook to at least six digits.
    #[test]
    fn handbook_value() {
        let t = 20_f64.to_radians().tan();
        assert!((inv_of_tangent(t) - 0.014_904_383_867_336_5).abs() < 1e-15);
    }

    #[test]
    fn inverse_undoes_the_function_over_sixteen_decades() {
        for k in -12..=8 {
            let t = 10_f64.powf(f64::from(k) / 2.0);
            let back = tangent_of_inv(inv_of_tangent(t));
            // 3 ε/t² is the conditioning of t − atan t just above the switch to the series.
            assert!((back / t - 1.0).abs() < 1e-12, "t = {t}: {back}");
        }
    }

    #[test]
    fn series_meets_the_closed_form() {
        let t = 0.05_f64;
        assert!((inv_of_tangent(t - 1e-12) - (t - t.atan())).abs() < 1e-14);
    }
}
