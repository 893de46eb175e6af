//! Chebyshev series of degree twelve: through values, integrated, and as polynomials.

/// Degree of the interpolating polynomials.
pub(crate) const N: usize = 12;
/// Coefficients of the integral of one.
const TERMS: usize = N + 2;

/// cos(jπ/12) for j = 0 … 6.
const QUARTER: [f64; 7] = [
    1.0,
    0.965_925_826_289_068_3,
    0.866_025_403_784_438_6,
    std::f64::consts::FRAC_1_SQRT_2,
    0.5,
    0.258_819_045_102_520_8,
    0.0,
];

/// cos(jkπ/N): the Chebyshev polynomial of degree k at the point j, counted down from 1 to −1.
pub(crate) const CHEBYSHEV: [[f64; TERMS]; N + 1] = {
    let mut table = [[0.0; TERMS]; N + 1];
    let mut j = 0;
    while j <= N {
        let mut k = 0;
        while k < TERMS {
            // Fold the angle jkπ/12 into the first quarter.
            let turn = (j * k) % (2 * N);
            let half = if turn > N { 2 * N - turn } else { turn };
            table[j][k] = if half > N / 2 {
                -QUARTER[N - half]
            } else {
                QUARTER[half]
            };
            k += 1;
        }
        j += 1;
    }
    table
};

pub(crate) type Values = [f64; N + 1];
pub(crate) type Series = [f64; TERMS];

/// Chebyshev coefficients of the polynomial through `values` at the points.
pub(crate) fn expand(values: &Values) -> Values {
    let mut c = [0.0; N + 1];
    for (j, (value, row)) in values.iter().zip(&CHEBYSHEV).enumerate() {
        let ends = if j == 0 || j == N { 0.5 } else { 1.0 };
        for (c, t) in c.iter_mut().zip(row) {
            *c += ends * value * t;
        }
    }
    for (k, c) in c.iter_mut().enumerate() {
        *c *= if k == 0 || k == N { 1.0 } else { 2.0 } / N as f64;
    }
    c
}

/// The integral from −1 of a series, times `half`, the panel's half length.
pub(crate) fn integrate(c: &Values, half: f64) -> Series {
    let at = |k: usize| c.get(k).copied().unwrap_or(0.0);
    let mut b = [0.0; TERMS];
    b[1] = half * (at(0) - 0.5 * at(2));
    for (k, b) in b.iter_mut().enumerate().skip(2) {
        *b = half * (at(k - 1) - at(k + 1)) / (2 * k) as f64;
    }
    let at_start: f64 = b[1..]
        .iter()
        .zip([-1.0, 1.0].into_iter().cycle())
        .map(|(b, sign)| b * sign)
        .sum();
    b[0] = -at_start;
    b
}

/// The series at the points.
pub(crate) fn at_points(series: &Series) -> Values {
    CHEBYSHEV.map(|row| row.iter().zip(series).map(|(t, b)| t * b).sum())
}

/// A polynomial of u, as coefficients of its powers. Powers take half the time of the Chebyshev series. They lose five
/// digits, which the tolerance of the quadrature permits.
#[derive(Debug, Clone)]
pub(crate) struct Polynomial {
    terms: usize,
    /// The coefficients, from that of u⁰.
    pub(crate) c: Series,
}

impl Polynomial {
    /// The series without its last terms that are below `small`.
    pub(crate) fn new(series: &Series, small: f64) -> Self {
        let mut terms = TERMS;
        while terms > 3 && series[terms - 1].abs() < small {
            terms -= 1;
        }
        // Clenshaw's recurrence on polynomials.
        let (mut b1, mut b2) = ([0.0; TERMS], [0.0; TERMS]);
        for &c in series[1..terms].iter().rev() {
            let mut b = [0.0; TERMS];
            for k in 0..TERMS {
                let risen = if k > 0 { b1[k - 1] } else { 0.0 };
                b[k] = 2.0 * risen - b2[k];
            }
            b[0] += c;
            (b1, b2) = (b, b1);
        }
        let mut c = [0.0; TERMS];
        for k in 0..TERMS {
            c[k] = if k > 0 { b1[k - 1] } else { series[0] } - b2[k];
        }
        Self { terms, c }
    }

    #[inline(always)]
    pub(crate) fn at<const L: usize>(&self, u: [f64; L]) -> [f64; L] {
        self.with_slope(u).0
    }

    /// The values and their derivatives.
    #[inline(always)]
    pub(crate) fn with_slope<const L: usize>(&self, u: [f64; L]) -> ([f64; L], [f64; L]) {
        let (mut sum, mut slope) = ([0.0; L], [0.0; L]);
        for c in self.c[..self.terms].iter().rev() {
            for l in 0..L {
                slope[l] = slope[l] * u[l] + sum[l];
                sum[l] = sum[l] * u[l] + c;
            }
        }
        (sum, slope)
    }
}
