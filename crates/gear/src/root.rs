//! Zeros of functions of one variable.

/// A zero of `f` between `a` and `b` by the Illinois variant of the false position, kept inside
/// its bracket. Where the ends have the same sign the end with the smaller |f| is returned.
pub(crate) fn root(a: f64, b: f64, f: impl Fn(f64) -> f64) -> f64 {
    let (mut a, mut b) = (a, b);
    let (mut fa, mut fb) = (f(a), f(b));
    if fa * fb > 0.0 {
        return if fa.abs() < fb.abs() { a } else { b };
    }
    let width = (b - a).abs();
    let mut side = 0_i8;
    for _ in 0..100 {
        if (b - a).abs() <= 1e-14 * width || fa == fb {
            break;
        }
        let c = (fb * a - fa * b) / (fb - fa);
        let fc = f(c);
        if fc == 0.0 {
            return c;
        }
        if (fc > 0.0) == (fb > 0.0) {
            if (b - c).abs() <= 1e-15 * width {
                return c;
            }
            (b, fb) = (c, fc);
            if side == -1 {
                fa *= 0.5;
            }
            side = -1;
        } else {
            if (a - c).abs() <= 1e-15 * width {
                return c;
            }
            (a, fa) = (c, fc);
            if side == 1 {
                fb *= 0.5;
            }
            side = 1;
        }
    }
    if fa.abs() < fb.abs() { a } else { b }
}
