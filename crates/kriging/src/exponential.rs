//! e^−x with the same bits on every machine.
//!
//! The C library's `exp` may differ in the last bit between processors and versions, and an optimiser
//! that runs on several machines must see one function. This one uses additions, multiplications and
//! fused ones only, which IEEE 754 fixes, and the compiler can vectorise it.
//!
//! Method: x = k ln 2 + r with |r| ≤ ln 2/2 (ln 2 in two parts, as in fdlibm's `e_exp.c`, so that the
//! reduction is exact enough), a polynomial of degree 11 for e^r (remainder 4·10⁻¹⁸), and the factor 2^k
//! written into the exponent's bits. The error is below 2 units in the last place.

/// Beyond this, e^−x counts as zero. It keeps 2^k a normal number.
const NEGLIGIBLE: f64 = 700.0;

const LN2_HIGH: f64 = 6.931_471_803_691_238e-1;
const LN2_LOW: f64 = 1.908_214_929_270_587_7e-10;

/// 1.5 · 2⁵²: adding it rounds to an integer and leaves that integer in the lowest bits.
const ROUNDER: f64 = 6_755_399_441_055_744.0;

/// Coefficients of r¹¹ … r⁰. Given the last two, they are those of the least relative error for
/// |r| ≤ ln 2/2, found by Remez's algorithm with 50 digits and rounded.
const POLYNOMIAL: [f64; 12] = [
    2.500_007_161_483_410_6e-8,
    2.763_023_390_224_084e-7,
    2.755_758_626_852_154e-6,
    2.480_149_313_623_713_2e-5,
    1.984_126_950_677_741e-4,
    1.388_888_894_359_764_9e-3,
    8.333_333_333_494_335e-3,
    4.166_666_666_653_026_7e-2,
    1.666_666_666_666_641_3e-1,
    5.000_000_000_000_011e-1,
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
        let shifted = x.mul_add(std::f64::consts::LOG2_E, ROUNDER);
        let k = shifted - ROUNDER;
        let r = k.mul_add(-LN2_LOW, k.mul_add(-LN2_HIGH, x));
        let mut sum = POLYNOMIAL[0];
        for coefficient in &POLYNOMIAL[1..] {
            sum = sum.mul_add(r, *coefficient);
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
