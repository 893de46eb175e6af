//! Test data, and kriging written out with dense matrices and Gaussian elimination.

use kriging::{Data, Kernel, Parameters};
use rand::RngExt as _;
use stats::streams::{Purpose, stream};

/// Owned observations.
#[derive(Debug, Clone)]
pub(crate) struct Sample {
    pub(crate) x: Vec<f64>,
    pub(crate) d: usize,
    pub(crate) y: Vec<f64>,
    pub(crate) noise: Vec<f64>,
}

impl Sample {
    /// `n` random points of the unit cube, a smooth function, and noise of unequal known variance
    /// around `noise`.
    pub(crate) fn smooth(n: usize, d: usize, noise: f64) -> Self {
        let mut rng = stream(3, Purpose::Test, n as u64, d as u64);
        let x: Vec<f64> = (0..n * d).map(|_| rng.random()).collect();
        let variances: Vec<f64> = (0..n)
            .map(|_| noise * (0.5 + rng.random::<f64>()))
            .collect();
        let y = x
            .chunks(d)
            .zip(&variances)
            .map(|(x, v)| {
                let smooth = 10.0 + 3.0 * (5.0 * x[0]).sin() + x.iter().map(|x| x * x).sum::<f64>();
                // Uniform noise of variance v.
                smooth + (12.0 * v).sqrt() * (rng.random::<f64>() - 0.5)
            })
            .collect();
        Self {
            x,
            d,
            y,
            noise: variances,
        }
    }

    /// `n` random points of the unit cube of 20 dimensions and the six largest terms of the function of
    /// W. J. Welch et al., Technometrics 34 (1992) 15–25.
    pub(crate) fn welch(n: usize, seed: u64) -> Self {
        let mut rng = stream(seed, Purpose::Test, n as u64, 20);
        let x: Vec<f64> = (0..n * 20).map(|_| rng.random()).collect();
        let value = |u: &[f64]| {
            let x = |i: usize| u[i - 1] - 0.5;
            let ratio = 5.0 * x(12) / (1.0 + x(1));
            ratio + 5.0 * (x(4) - x(20)).powi(2) + x(5) + 40.0 * x(19).powi(3) - 5.0 * x(19)
        };
        Self {
            y: x.chunks(20).map(value).collect(),
            x,
            d: 20,
            noise: vec![0.0; n],
        }
    }

    pub(crate) fn data(&self) -> Data<'_> {
        Data {
            x: &self.x,
            d: self.d,
            y: &self.y,
            noise_variance: &self.noise,
        }
    }

    pub(crate) fn row(&self, i: usize) -> &[f64] {
        &self.x[i * self.d..(i + 1) * self.d]
    }

    pub(crate) fn without(&self, left_out: usize) -> Self {
        let keep = |i: &usize| *i != left_out;
        let kept: Vec<usize> = (0..self.y.len()).filter(keep).collect();
        self.pick(&kept)
    }

    pub(crate) fn pick(&self, indices: &[usize]) -> Self {
        Self {
            x: indices.iter().flat_map(|&i| self.row(i).to_vec()).collect(),
            d: self.d,
            y: indices.iter().map(|&i| self.y[i]).collect(),
            noise: indices.iter().map(|&i| self.noise[i]).collect(),
        }
    }
}

/// The correlation of two points, from the formulas of Rasmussen and Williams (2006), chapter 4.
pub(crate) fn correlation(kernel: Kernel, a: &[f64], b: &[f64], ranges: &[f64]) -> f64 {
    let distances = a.iter().zip(b).zip(ranges);
    let scaled: Vec<f64> = distances.map(|((a, b), t)| (a - b).abs() / t).collect();
    let radius = scaled.iter().map(|h| h * h).sum::<f64>().sqrt();
    let (kernel, distances) = match kernel {
        Kernel::RadialMatern52 => (Kernel::Matern52, vec![radius]),
        Kernel::RadialMatern32 => (Kernel::Matern32, vec![radius]),
        Kernel::RadialExponential => (Kernel::Exponential, vec![radius]),
        other => (other, scaled),
    };
    distances
        .iter()
        .map(|&h| match kernel {
            Kernel::Matern52 => {
                let s = 5.0_f64.sqrt() * h;
                (1.0 + s + 5.0 * h * h / 3.0) * (-s).exp()
            }
            Kernel::Matern32 => {
                let s = 3.0_f64.sqrt() * h;
                (1.0 + s) * (-s).exp()
            }
            Kernel::SquaredExponential => (-0.5 * h * h).exp(),
            Kernel::Exponential => (-h).exp(),
            _ => unreachable!("a kernel this test does not know"),
        })
        .product()
}

/// Kriging with given σ², ranges and nugget.
pub(crate) struct DenseKriging<'a> {
    kernel: Kernel,
    sample: &'a Sample,
    sigma2: f64,
    ranges: Vec<f64>,
    inverse: Vec<Vec<f64>>,
    log_determinant: f64,
    /// The trend's basis functions at the points.
    basis: Vec<Vec<f64>>,
    /// The inverse of FᵀK⁻¹F.
    normal: Vec<Vec<f64>>,
    coefficients: Vec<f64>,
    pub(crate) mu: f64,
}

/// 1, and the coordinates if the trend is linear.
fn basis(x: &[f64], linear: bool) -> Vec<f64> {
    let mut f = vec![1.0];
    if linear {
        f.extend(x);
    }
    f
}

impl<'a> DenseKriging<'a> {
    pub(crate) fn new(kernel: Kernel, sample: &'a Sample, parameters: &Parameters) -> Self {
        Self::build(kernel, sample, parameters, false)
    }

    /// With a linear trend.
    pub(crate) fn with_trend(kernel: Kernel, sample: &'a Sample, parameters: &Parameters) -> Self {
        Self::build(kernel, sample, parameters, true)
    }

    fn build(kernel: Kernel, sample: &'a Sample, parameters: &Parameters, linear: bool) -> Self {
        let n = sample.y.len();
        let Parameters {
            sigma2,
            ranges,
            nugget,
            ..
        } = parameters.clone();
        let covariance = |i: usize, j: usize| {
            let k = sigma2 * correlation(kernel, sample.row(i), sample.row(j), &ranges);
            if i == j {
                k + sample.noise[i] + nugget
            } else {
                k
            }
        };
        let matrix = (0..n)
            .map(|i| (0..n).map(|j| covariance(i, j)).collect())
            .collect();
        let (inverse, log_determinant) = invert(matrix);
        let basis: Vec<Vec<f64>> = (0..n).map(|i| basis(sample.row(i), linear)).collect();
        let p = basis[0].len();
        let column = |k: usize| -> Vec<f64> { basis.iter().map(|f| f[k]).collect() };
        let solved: Vec<Vec<f64>> = (0..p)
            .map(|k| inverse.iter().map(|row| dot(row, &column(k))).collect())
            .collect();
        let (normal, _) = invert(
            (0..p)
                .map(|i| (0..p).map(|j| dot(&column(i), &solved[j])).collect())
                .collect(),
        );
        let right: Vec<f64> = solved.iter().map(|s| dot(s, &sample.y)).collect();
        let coefficients: Vec<f64> = normal.iter().map(|row| dot(row, &right)).collect();
        Self {
            kernel,
            sample,
            sigma2,
            ranges,
            inverse,
            log_determinant,
            mu: coefficients[0],
            basis,
            normal,
            coefficients,
        }
    }

    fn centred(&self) -> Vec<f64> {
        let pairs = self.sample.y.iter().zip(&self.basis);
        pairs.map(|(y, f)| y - dot(f, &self.coefficients)).collect()
    }

    /// Equations (19) and (20), or those of universal kriging.
    pub(crate) fn predict(&self, x: &[f64]) -> (f64, f64) {
        let n = self.sample.y.len();
        let k: Vec<f64> = (0..n)
            .map(|i| self.sigma2 * correlation(self.kernel, x, self.sample.row(i), &self.ranges))
            .collect();
        let solved: Vec<f64> = self.inverse.iter().map(|row| dot(row, &k)).collect();
        let f = basis(x, self.coefficients.len() > 1);
        let mean = dot(&f, &self.coefficients) + dot(&solved, &self.centred());
        let short: Vec<f64> = (0..f.len())
            .map(|j| {
                let column: Vec<f64> = self.basis.iter().map(|f| f[j]).collect();
                f[j] - dot(&column, &solved)
            })
            .collect();
        let along: Vec<f64> = self.normal.iter().map(|row| dot(row, &short)).collect();
        (mean, self.sigma2 - dot(&k, &solved) + dot(&short, &along))
    }

    pub(crate) fn negative_log_likelihood(&self) -> f64 {
        let centred = self.centred();
        let solved: Vec<f64> = self.inverse.iter().map(|row| dot(row, &centred)).collect();
        let n = centred.len() as f64;
        0.5 * (n * std::f64::consts::TAU.ln() + self.log_determinant + dot(&centred, &solved))
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Inverse and log determinant by Gauss–Jordan elimination with pivoting.
fn invert(mut a: Vec<Vec<f64>>) -> (Vec<Vec<f64>>, f64) {
    let n = a.len();
    for (i, row) in a.iter_mut().enumerate() {
        row.extend((0..n).map(|j| f64::from(u8::from(i == j))));
    }
    let mut log_determinant = 0.0;
    for k in 0..n {
        let pivot = (k..n)
            .max_by(|i, j| a[*i][k].abs().total_cmp(&a[*j][k].abs()))
            .unwrap();
        a.swap(k, pivot);
        let scale = a[k][k];
        log_determinant += scale.abs().ln();
        a[k].iter_mut().for_each(|v| *v /= scale);
        let row = a[k].clone();
        for (i, other) in a.iter_mut().enumerate() {
            let factor = other[k];
            if i != k && factor != 0.0 {
                other
                    .iter_mut()
                    .zip(&row)
                    .for_each(|(o, r)| *o -= factor * r);
            }
        }
    }
    (
        a.into_iter().map(|row| row[n..].to_vec()).collect(),
        log_determinant,
    )
}

/// A model as JSON.
pub(crate) fn written(model: impl Into<kriging::Surrogate>) -> String {
    model.into().to_json().unwrap()
}

/// The exact model that [`written`] wrote.
pub(crate) fn read(text: &str) -> Result<kriging::Model, kriging::Error> {
    let stored = kriging::Surrogate::from_json(text)?;
    Ok(stored.exact().unwrap().clone())
}
