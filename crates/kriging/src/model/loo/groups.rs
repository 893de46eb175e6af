//! Leave-one-out residuals of points that are left out together, because they are nearly the same.

use crate::linalg::{LowerTriangle, dot};
use crate::model::Model;
use crate::model::loo::Residual;

/// Relative length of a vector's remainder below which the other vectors span it: the other points'
/// observations then do not determine the trend.
const SPANNED: f64 = 1e-12;

impl Model {
    /// The residual of each observation, not calibrated, given the observations of all points that are not
    /// nearly the same; and the number of points, nearly equal ones counted once.
    ///
    /// With C = LLᵀ, W = L⁻¹ and P = Wᵀ(I − QQᵀ)W, Q an orthonormal basis of WF, the residuals of
    /// a group are the coefficients of the least squares fit of W(y − Fμ) by the group's columns of
    /// (I − QQᵀ)W: P_GG itself would lose the digits in which nearly equal points differ.
    pub(crate) fn residuals_of_points(&self) -> (Vec<Residual>, usize) {
        let n = self.points.len();
        let mut residuals = self.residuals();
        let groups = self.coordinates.near_groups(self.kernel);
        if groups.is_empty() {
            return (residuals, n);
        }
        let factorisation = self.factorisation();
        let mut whitened: Vec<f64> = (0..n)
            .map(|i| self.points.y[i] - self.trend_at(self.points.row(i)))
            .collect();
        factorisation.factor.half_solve(&mut whitened);
        let mut basis = self.basis();
        factorisation.factor.half_solve(&mut basis);
        let mut trend: Vec<Vec<f64>> = Vec::new();
        for column in basis.chunks(n) {
            let mut column = column.to_vec();
            let (_, length) = orthogonalise(&mut column, &[&trend]);
            if length > 0.0 {
                column.iter_mut().for_each(|v| *v /= length);
                trend.push(column);
            }
        }
        let half = factorisation.factor.half_inverse(Vec::new());
        let mut distinct = n;
        for group in groups {
            distinct -= group.len() - 1;
            let Some(left_out) = group_residuals(&group, &half, &trend, &whitened, n) else {
                continue;
            };
            for (i, (residual, unit)) in group.into_iter().zip(left_out) {
                residuals[i].residual = residual;
                residuals[i].variance = self.parameters.sigma2 * unit;
            }
        }
        (residuals, distinct)
    }
}

/// The residuals of a group's points, and their variances over the process variance. `None` if the other points
/// do not determine the trend.
fn group_residuals(
    group: &[usize],
    half: &LowerTriangle,
    trend: &[Vec<f64>],
    whitened: &[f64],
    n: usize,
) -> Option<Vec<(f64, f64)>> {
    let m = group.len();
    // R column by column, with as many numbers as the column has above and on the diagonal.
    let mut factor: Vec<Vec<f64>> = Vec::with_capacity(m);
    let mut own: Vec<Vec<f64>> = Vec::with_capacity(m);
    for &i in group {
        let mut column = vec![0.0; n];
        column[i..].copy_from_slice(half.column(i));
        let whole = dot(&column, &column).sqrt();
        let (mut shares, length) = orthogonalise(&mut column, &[trend, &own]);
        if length.is_nan() || length <= SPANNED * whole {
            return None;
        }
        column.iter_mut().for_each(|v| *v /= length);
        own.push(column);
        let mut of_own = shares.split_off(trend.len());
        of_own.push(length);
        factor.push(of_own);
    }
    // e = R⁻¹Qᵀz, and the rows of R⁻¹, from the last one up.
    let mut residuals = vec![0.0; m];
    let mut inverse = vec![vec![0.0; m]; m];
    for k in (0..m).rev() {
        let mut residual = dot(&own[k], whitened);
        let mut row = vec![0.0; m];
        row[k] = 1.0;
        for l in k + 1..m {
            residual -= factor[l][k] * residuals[l];
            for (value, below) in row.iter_mut().zip(&inverse[l]) {
                *value -= factor[l][k] * below;
            }
        }
        let pivot = factor[k][k];
        residuals[k] = residual / pivot;
        inverse[k] = row.into_iter().map(|value| value / pivot).collect();
    }
    let variances = inverse.iter().map(|row| dot(row, row));
    Some(residuals.into_iter().zip(variances).collect())
}

/// Subtracts from `column` its projections on the orthonormal `vectors`, twice against rounding. Returns the
/// coefficient of each projection and the length of the remainder.
fn orthogonalise(column: &mut [f64], vectors: &[&[Vec<f64>]]) -> (Vec<f64>, f64) {
    let mut shares = vec![0.0; vectors.iter().map(|some| some.len()).sum()];
    for _ in 0..2 {
        let all = vectors.iter().flat_map(|some| some.iter());
        for (share, vector) in shares.iter_mut().zip(all) {
            let part = dot(column, vector);
            *share += part;
            column
                .iter_mut()
                .zip(vector)
                .for_each(|(c, v)| *c -= part * v);
        }
    }
    let length = dot(column, column).sqrt();
    (shares, length)
}

#[cfg(test)]
mod tests {
    use rand::RngExt as _;
    use stats::streams::{Purpose, stream};

    use crate::data;
    use crate::data::Data;
    use crate::model::Model;
    use crate::{FitOptions, Nugget, Trend, fit};

    /// Points of two coordinates with three observations each, `apart` from each other, and five single ones.
    fn replicates(apart: f64, noise: f64) -> (Vec<f64>, Vec<f64>) {
        let mut rng = stream(5, Purpose::Test, 1, 0);
        let (mut x, mut y) = (Vec::new(), Vec::new());
        for point in 0..17 {
            let at = [rng.random::<f64>(), rng.random::<f64>()];
            for copy in 0..if point < 12 { 3 } else { 1 } {
                x.extend([at[0] + apart * f64::from(copy), at[1]]);
                y.push((6.0 * at[0]).sin() + at[1] * at[1] + noise * (rng.random::<f64>() - 0.5));
            }
        }
        (x, y)
    }

    #[test]
    fn a_point_is_left_out_with_its_replicates() {
        for (apart, noise, nugget, trend) in [
            (0.0, 0.3, Nugget::Estimated, Trend::Constant),
            (0.0, 0.3, Nugget::Estimated, Trend::Linear),
            (1e-9, 0.3, Nugget::Estimated, Trend::Constant),
            (1e-8, 0.0, Nugget::Estimated, Trend::Constant),
            (1e-6, 0.0, Nugget::Known, Trend::Constant),
        ] {
            let (x, y) = replicates(apart, noise);
            let data = |rows: &[usize]| {
                let x: Vec<f64> = rows
                    .iter()
                    .flat_map(|&i| [x[2 * i], x[2 * i + 1]])
                    .collect();
                let y: Vec<f64> = rows.iter().map(|&i| y[i]).collect();
                (x, y, vec![0.0; rows.len()])
            };
            let points = |(x, y, noise_variance): &(Vec<f64>, Vec<f64>, Vec<f64>)| {
                data::points(
                    &Data {
                        x,
                        d: 2,
                        y,
                        noise_variance,
                    },
                    true,
                )
                .unwrap()
                .0
            };
            let all: Vec<usize> = (0..y.len()).collect();
            let (ax, ay, av) = data(&all);
            let options = FitOptions {
                nugget,
                trend,
                ..FitOptions::default()
            };
            let whole = Data {
                x: &ax,
                d: 2,
                y: &ay,
                noise_variance: &av,
            };
            let model = fit(&whole, &options).unwrap();
            let loo = model.leave_one_out();
            assert_eq!((loo.points, loo.residuals.len()), (17, 41));
            for group in (0..12)
                .map(|p| 3 * p..3 * p + 3)
                .chain((36..41).map(|i| i..i + 1))
            {
                let others: Vec<usize> =
                    all.iter().copied().filter(|i| !group.contains(i)).collect();
                let parameters = model.parameters().clone();
                let jitter = model.jitter;
                let without = Model::new(
                    model.kernel,
                    trend,
                    points(&data(&others)),
                    parameters,
                    jitter,
                )
                .unwrap();
                for i in group {
                    let p = without.predict(&[x[2 * i], x[2 * i + 1]]);
                    let expected = y[i] - p.mean;
                    // Without noise the covariance has a condition of 1e12: single points lose digits, too.
                    let tolerance = if noise > 0.0 { 1e-6 } else { 5e-2 };
                    let error = (loo.residuals[i] - expected).abs();
                    let sd = (p.variance + model.parameters().nugget).sqrt();
                    assert!(
                        error < tolerance * sd,
                        "{apart} {i}: {} {expected}",
                        loo.residuals[i]
                    );
                    let standardised = loo.standardised[i] * sd - expected;
                    assert!(
                        standardised.abs() < 2.0 * tolerance * sd,
                        "{apart} {i}: {standardised}"
                    );
                }
            }
        }
    }

    #[test]
    fn distinct_points_are_left_out_one_by_one() {
        let mut rng = stream(6, Purpose::Test, 1, 0);
        // The fourth pair lies closer together than others do by chance, but not nearly at one place.
        let mut x: Vec<f64> = (0..60).map(|_| rng.random()).collect();
        x[8] = x[6] + 1e-2;
        x[9] = x[7];
        let y: Vec<f64> = x.chunks(2).map(|x| (5.0 * x[0]).sin() * x[1]).collect();
        let noise_variance = vec![1e-6; 30];
        let data = Data {
            x: &x,
            d: 2,
            y: &y,
            noise_variance: &noise_variance,
        };
        let model = fit(&data, &FitOptions::default()).unwrap();
        let (found, distinct) = model.residuals_of_points();
        assert_eq!(distinct, 30);
        for (a, b) in found.iter().zip(model.residuals()) {
            assert_eq!(a.residual.to_bits(), b.residual.to_bits());
        }
    }
}
