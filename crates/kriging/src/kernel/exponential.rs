//! e^−x with the same bits on every machine.
//!
//! The C library's `exp` may differ in the last bit between processors and versions, and an optimiser
//! that runs on several machines must see one function. This one uses additions and multiplications
//! only, which IEEE 754 fixes, and the compiler can vectorise it.
//!
//! Method: x = k ln 2 + r with |r| ≤ ln 2/2 (ln 2 in two parts, as in fdlibm's `e_exp.c`, so that the
//! reduction is exact enough), the Taylor polynomial of e^r to degree 13 (remainder 4·10⁻¹⁸), and the
//! factor 2^k written into the exponent's bits. The error is below 2 units in the last place.

/// Beyond this, e^−x counts as zero. It keeps 2^k a normal number.
const NEGLIGIBLE: f64 = 700.0;

const LN2_HIGH: f64 = 6.931_471_803_691_238e-1;
const LN2_LOW: f64 = 1.908_214_929_270_587_7e-10;

/// 1.5 · 2⁵²: adding it rounds to an integer and leaves that integer in the lowest bits.
const ROUNDER: f64 = 6_755_399_441_055_744.0;

/// 1/k! for k = 13 … 0.
const TAYLOR: [f64; 14] = [
    1.0 / 6_227_020_800.0,
    1.0 / 479_001_600.0,
    1.0 / 39_916_800.0,
    1.0 / 3_628_800.0,
    1.0 / 362_880.0,
    1.0 / 40_320.0,
    1.0 / 5_040.0,
    1.0 / 720.0,
    1.0 / 120.0,
    1.0 / 24.0,
    1.0 / 6.0,
    0.5,
    1.0,
    1.0,
];

/// Multiplies each of `values` by e^−x of its x ≥ 0 in `exponents`; the product is 0 where x exceeds
/// 700, whatever the value, and NaN where x is NaN.
#[inline(always)]
pub(crate) fn multiply_by_exp_of_minus(exponents: &[f64], values: &mut [f64]) {
    for (value, &exponent) in values.iter_mut().zip(exponents) {
        let negligible = exponent > NEGLIGIBLE;
        let x = if negligible { -NEGLIGIBLE } else { -exponent };
        let shifted = x * std::f64::consts::LOG2_E + ROUNDER;
        let k = shifted - ROUNDER;
        let r = (x - k * LN2_HIGH) - k * LN2_LOW;
        let mut sum = TAYLOR[0];
        for coefficient in &TAYLOR[1..] {
            sum = sum * r + coefficient;
        }
        // Only the lowest 12 bits, k + 1023, stay: a positive number's biased exponent.
        let power = f64::from_bits(shifted.to_bits().wrapping_add(1023) << 52);
        *value = if negligible {
            0.0
        } else {
            *value * (sum * power)
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn exp_of_minus(x: f64) -> f64 {
        let mut value = [1.0];
        multiply_by_exp_of_minus(&[x], &mut value);
        value[0]
    }

    #[test]
    fn agrees_with_the_standard_library() {
        for i in 0..700_000 {
            let x = f64::from(i) * 0.001 + 1e-5 * f64::from(i % 7);
            let exact = (-x).exp();
            // Two units in the last place, and the standard library's own half.
            assert!(
                (exp_of_minus(x) / exact - 1.0).abs() < 2.5 * f64::EPSILON,
                "{x}"
            );
        }
    }

    #[test]
    fn ends_of_the_range() {
        assert_eq!(exp_of_minus(0.0), 1.0);
        assert_eq!(exp_of_minus(1e-300), 1.0);
        assert!(exp_of_minus(NEGLIGIBLE) > 0.0);
        assert_eq!(exp_of_minus(700.1), 0.0);
        assert_eq!(exp_of_minus(f64::INFINITY), 0.0);
        assert!(exp_of_minus(f64::NAN).is_nan());
        let mut infinite = [f64::INFINITY];
        multiply_by_exp_of_minus(&[1e9], &mut infinite);
        assert_eq!(infinite, [0.0]);
    }

    /// Pins the bits: a change of them changes every kriging mean. These two are the exact values,
    /// computed with 40 digits, correctly rounded.
    #[test]
    fn the_bits_are_pinned() {
        assert_eq!(exp_of_minus(1.0).to_bits(), 4_600_298_746_774_613_816);
        assert_eq!(exp_of_minus(12.345).to_bits(), 4_526_751_318_660_336_514);
    }
}
