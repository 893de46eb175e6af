//! A random matrix whose expectation is the inverse of a covariance matrix.

use rand::RngExt as _;
use stats::streams::{Purpose, stream};

use crate::panels::{Column, Lower, Narrow, transposed_half_solve};

/// Random vectors the mean of whose squares is C⁻¹: see [`Probes::new`].
pub(crate) struct Probes(Narrow);

impl Probes {
    /// `count` vectors s = L⁻ᵀz, z of random signs, L the factor of C. The mean of ssᵀ over them is a
    /// random matrix whose expectation is C⁻¹.
    ///
    /// A trace tr(C⁻¹ ∂C) estimated by it errs by √(2 Σ_{i≠j} Aᵢⱼ²/`count`), A = L⁻¹ ∂C L⁻ᵀ (M. F.
    /// Hutchinson, Commun. Statist. Simula. 19 (1990) 433–450). The likelihood's derivative is half the
    /// trace and its expected information ½ Σ Aᵢⱼ², so that it errs by no more than 1/√`count` of its own
    /// standard deviation over data: a Newton step then ends that share of the parameters' standard
    /// errors off.
    pub(crate) fn new(factor: &Lower, count: usize) -> Self {
        let n = factor.len();
        let mut rng = stream(0, Purpose::Fit, 3, n as u64);
        let size = (count as f64).sqrt().recip();
        let mut vectors: Vec<f64> = (0..n * count)
            .map(|_| if rng.random() { size } else { -size })
            .collect();
        transposed_half_solve(factor, &mut vectors);
        Self(Narrow::new(&vectors, n))
    }

    /// Writes panel p of the mean's lower triangle to `to`.
    pub(crate) fn panel(&self, p: usize, to: &mut [Column]) {
        self.0.square_panel(p, to);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::panels::{ROWS, Upper, factorise, invert_transposed, square};

    /// The mean over samples of the sampled matrix is the inverse, and a trace by it errs as little as
    /// its documentation says.
    #[test]
    fn a_sampled_inverse_is_right_on_average() {
        let n = 60;
        let mut factor = Lower::from_fn(n, |i, j| {
            (-0.2 * (i - j) as f64).exp() + if i == j { 0.1 } else { 0.0 }
        });
        factorise(&mut factor).unwrap();
        let (mut upper, mut exact) = (Upper::default(), Lower::default());
        invert_transposed(&factor, &mut upper);
        square(&upper, &mut exact);
        let count = 20_000;
        let probes = Probes::new(&factor, count);
        for p in 0..n.div_ceil(ROWS) {
            let mut panel = exact.panel(p).to_vec();
            probes.panel(p, &mut panel);
            for i in p * ROWS..n.min((p + 1) * ROWS) {
                for (k, column) in panel[..=i].iter().enumerate() {
                    let (a, b) = (exact.get(i, k), column.0[i - p * ROWS]);
                    // The standard error of a mean of products is at most √(2 C⁻¹ᵢᵢ C⁻¹ₖₖ/count).
                    let scale = (exact.get(k, k) * exact.get(i, i)).sqrt();
                    let error = (2.0 / count as f64).sqrt() * scale;
                    assert!((a - b).abs() < 5.0 * error, "{i} {k}: {a} {b}");
                }
            }
        }
    }
}
