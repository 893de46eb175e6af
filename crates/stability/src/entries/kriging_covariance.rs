//! Kriging: matrices near singular, likelihoods without a maximum.

use kriging::{Data, Error, Estimator, FitOptions, Kernel, Model, Trend, Warning, fit};
use nalgebra::DMatrix;
use rand::RngExt as _;
use rand_distr::{Distribution as _, StandardNormal};
use report::Scale;
use stats::streams::{Purpose, stream};

use crate::outcome::{Failed, Outcome};
use crate::{Entry, Method};

pub(super) const ENTRIES: [Entry; 11] = [
    Entry {
        id: "kriging-condition",
        title: "Condition number against nugget and spacing",
        input: "30 evenly spaced points on a line, spacings from a hundredth of the range to three ranges, \
                nuggets from 1e-12 to 1e-2 of the process variance",
        instead: "A nugget bounds the condition number by 1 + n/nugget, whatever the spacing. Where the data \
                  bring no noise, jitter takes its place, from 1e-12 upwards and only as much as is needed.",
        check: condition,
        ..Entry::blank(Method::Kriging)
    },
    Entry {
        id: "kriging-dense-grid",
        title: "Squared exponential on dense grids",
        input: "sin 5x + x² without noise at 5 to 160 evenly spaced points, fitted with the squared \
                exponential and with Matérn 5/2",
        instead: "Where the matrix is singular to rounding it gets jitter, which is said; the error then stops falling. \
                  Matérn 5/2, the default, needs it too, at four times as many points: so smooth a function \
                  has a long range, and its points are dense in it.",
        check: dense_grid,
        ..Entry::blank(Method::Kriging)
    },
    Entry {
        id: "kriging-flat-likelihood",
        title: "Flat likelihood",
        input: "12 points in 4 dimensions, a response that depends on the first coordinate alone, noise of \
                half its spread",
        instead: "The fit goes on with the ranges of the highest likelihood. The posterior mode settles the \
                  ranges by a weak prior.",
        check: flat_likelihood,
        ..Entry::blank(Method::Kriging)
    },
    Entry {
        id: "kriging-noise-only",
        title: "A response that is noise alone",
        input: "60 points in 2 dimensions whose observations are independent of x, with their true noise \
                variance",
        instead: "The model predicts the mean, and its intervals are about as wide as the mean is uncertain. \
                  With refuse_no_structure it is refused.",
        check: noise_only,
        ..Entry::blank(Method::Kriging)
    },
    Entry {
        id: "kriging-constant",
        title: "All observations equal",
        input: "20 points in 2 dimensions, all observations 7.5",
        instead: "The model is the constant, without a search for ranges that nothing determines.",
        check: constant,
        ..Entry::blank(Method::Kriging)
    },
    Entry {
        id: "kriging-linear",
        title: "A response that is a plane",
        input: "30 points in 2 dimensions of 3 + 2 x₁ − x₂ without noise: the likelihood grows with the \
                ranges without end",
        instead: "The search stops at its bounds and says so. A linear trend describes such a response \
                  exactly.",
        check: linear,
        ..Entry::blank(Method::Kriging)
    },
    Entry {
        id: "kriging-cliff",
        title: "A cliff",
        input: "40 evenly spaced points of a step from 0 to 1 at x = 0.5, without noise",
        instead: "The ranges become short and the intervals wide. Nothing is said: the leave-one-out \
                  residuals look like those of a rough function.",
        check: cliff,
        ..Entry::blank(Method::Kriging)
    },
    Entry {
        id: "kriging-few-points",
        title: "Fewer points than ranges",
        input: "5 points in 6 dimensions",
        instead: "All coordinates share one range, in units of their extents.",
        check: few_points,
        ..Entry::blank(Method::Kriging)
    },
    Entry {
        id: "kriging-plane-of-points",
        title: "A trend that the points do not determine",
        input: "12 points on a line in 2 dimensions, with a linear trend",
        instead: "The fit is refused with the number of coefficients; a constant trend fits.",
        check: plane_of_points,
        ..Entry::blank(Method::Kriging)
    },
    Entry {
        id: "kriging-wrong-noise",
        title: "A noise variance that is wrong",
        input: "sin 5x with noise of standard deviation 0.2 at 60 points, stated as 0.002, as 0.2 and as 20",
        instead: "Too small a variance is taken at its word, and the model follows the noise: the share of \
                  leave-one-out residuals within their 90 % intervals shows it. An estimated nugget finds the rest. \
                  Too large a one hides the structure, which is said.",
        check: wrong_noise,
        ..Entry::blank(Method::Kriging)
    },
    Entry {
        id: "kriging-extrapolation",
        title: "Far from the data",
        input: "sin 5x at 15 points of [0, 1], predicted at 2 and at 100",
        instead: "The prediction returns to the mean and its standard error to that of the process. Nothing is \
                  said; `predict` marks such points as extrapolated.",
        check: extrapolation,
        ..Entry::blank(Method::Kriging)
    },
];

/// A fit of exact or noisy observations in d coordinates, the points row-major.
pub(super) fn model(
    x: &[f64],
    d: usize,
    y: &[f64],
    noise: f64,
    options: &FitOptions,
) -> Result<Model, Error> {
    let noise_variance = vec![noise; y.len()];
    let data = Data {
        x,
        d,
        y,
        noise_variance: &noise_variance,
    };
    fit(&data, options)
}

pub(super) fn kernel(kernel: Kernel) -> FitOptions {
    FitOptions {
        kernel,
        ..FitOptions::default()
    }
}

/// n evenly spaced points of [0, 1].
pub(super) fn grid(n: usize) -> Vec<f64> {
    (0..n).map(|i| i as f64 / (n - 1) as f64).collect()
}

/// n points of the unit box in d dimensions, row-major.
pub(super) fn random_points(n: usize, d: usize, number: u64) -> Vec<f64> {
    let mut rng = stream(21, Purpose::Test, number, 0);
    (0..n * d).map(|_| rng.random()).collect()
}

/// n standard normal numbers.
pub(super) fn normal(n: usize, number: u64) -> Vec<f64> {
    let mut rng = stream(21, Purpose::Test, number, 1);
    (0..n).map(|_| StandardNormal.sample(&mut rng)).collect()
}

/// The root mean square of the model's errors on a fine grid of [0, 1].
pub(super) fn rmse(model: &Model, truth: impl Fn(f64) -> f64) -> f64 {
    let at = grid(997);
    let squares = at.iter().map(|&x| (model.mean(&[x]) - truth(x)).powi(2));
    (squares.sum::<f64>() / at.len() as f64).sqrt()
}

fn condition_number(kernel: Kernel, n: usize, spacing: f64, nugget: f64) -> f64 {
    let matrix = DMatrix::from_fn(n, n, |i, j| {
        let steps = i.abs_diff(j) as f64;
        let own = if i == j { nugget } else { 0.0 };
        kernel.correlation(&[steps * spacing]) + own
    });
    let eigenvalues = matrix.symmetric_eigenvalues();
    // An eigenvalue below rounding says that the condition number is beyond what an f64 can tell.
    eigenvalues.max() / eigenvalues.min().max(f64::EPSILON * 1e-2)
}

fn condition(found: &mut Outcome) -> Result<(), Failed> {
    let n = 30;
    let spacings: Vec<f64> = (0..=24)
        .map(|i| 0.01 * 300_f64.powf(f64::from(i) / 24.0))
        .collect();
    let mut curves = Vec::new();
    let mut worst: f64 = 0.0;
    for (name, covariance, nugget) in [
        ("squared exp., 1e-12", Kernel::SquaredExponential, 1e-12),
        ("squared exp., 1e-6", Kernel::SquaredExponential, 1e-6),
        ("squared exp., 1e-2", Kernel::SquaredExponential, 1e-2),
        ("Matérn 5/2, 1e-12", Kernel::Matern52, 1e-12),
        ("Matérn 5/2, 1e-6", Kernel::Matern52, 1e-6),
    ] {
        let points: Vec<[f64; 2]> = spacings
            .iter()
            .map(|&h| [h, condition_number(covariance, n, h, nugget)])
            .collect();
        let bound = 1.0 + n as f64 / nugget;
        worst = points.iter().map(|p| p[1] / bound).fold(worst, f64::max);
        curves.push((name, points));
    }
    // Eigenvalues are right to some units of rounding of the largest, 30: 1 % of a nugget of 1e-12.
    found.at_most("condition number over its bound 1 + n/nugget", worst, "", 1.02);
    let at_tenth = |covariance| condition_number(covariance, n, 0.1, 1e-12);
    found.figure(
        "condition number at a tenth of the range, squared exponential",
        at_tenth(Kernel::SquaredExponential),
        "",
    );
    found.figure(
        "condition number at a tenth of the range, Matérn 5/2",
        at_tenth(Kernel::Matern52),
        "",
    );
    found.chart(
        "Condition number of 30 points, by kernel and nugget",
        ("spacing over range", Scale::Log),
        ("condition number", Scale::Log),
        curves,
    );
    // What the library does with such data.
    let x = grid(n);
    let y: Vec<f64> = x.iter().map(|x| (3.0 * x).sin()).collect();
    let model = model(&x, 1, &y, 0.0, &kernel(Kernel::SquaredExponential))?;
    found.warned(model.warnings(), &["Jitter"]);
    found.at_most(
        "error between the points with jitter",
        rmse(&model, |x| (3.0 * x).sin()),
        "",
        1e-4,
    );
    Ok(())
}

fn dense_grid(found: &mut Outcome) -> Result<(), Failed> {
    let truth = |x: f64| (5.0 * x).sin() + x * x;
    let (mut smooth, mut rough) = (Vec::new(), Vec::new());
    let mut first_jitter = [f64::NAN; 2];
    for n in [5, 7, 10, 14, 20, 28, 40, 80, 160] {
        let x = grid(n);
        let y: Vec<f64> = x.iter().map(|&x| truth(x)).collect();
        for (covariance, curve) in [
            (Kernel::SquaredExponential, &mut smooth),
            (Kernel::Matern52, &mut rough),
        ] {
            let model = model(&x, 1, &y, 0.0, &kernel(covariance))?;
            curve.push([n as f64, rmse(&model, truth)]);
            let is_smooth = covariance == Kernel::SquaredExponential;
            if is_smooth && n == 160 {
                found.warned(model.warnings(), &["Jitter"]);
            }
            let has_jitter = |w: &Warning| matches!(w, Warning::Jitter { .. });
            let first = &mut first_jitter[usize::from(!is_smooth)];
            if first.is_nan() && model.warnings().iter().any(has_jitter) {
                *first = n as f64;
            }
        }
    }
    let worst = |curve: &[[f64; 2]]| {
        let dense = curve.iter().filter(|p| p[0] >= 20.0);
        dense.map(|p| p[1]).fold(0.0, f64::max)
    };
    found.at_most(
        "largest error from 20 points on, squared exponential",
        worst(&smooth),
        "",
        1e-4,
    );
    found.at_most(
        "largest error from 20 points on, Matérn 5/2",
        worst(&rough),
        "",
        1e-3,
    );
    found.at_most("points from which the squared exponential needs jitter", first_jitter[0], "", 40.0);
    found.at_least("points from which Matérn 5/2 needs jitter", first_jitter[1], "", 40.0);
    found.chart(
        "Error against the number of points",
        ("points", Scale::Log),
        ("RMS error", Scale::Log),
        vec![("squared exponential", smooth), ("Matérn 5/2", rough)],
    );
    Ok(())
}

fn flat_likelihood(found: &mut Outcome) -> Result<(), Failed> {
    let (n, d) = (12, 4);
    let x = random_points(n, d, 1);
    let noise = normal(n, 1);
    let y: Vec<f64> = (0..n).map(|i| x[i * d] + 0.15 * noise[i]).collect();
    let likelihood = model(&x, d, &y, 0.15 * 0.15, &FitOptions::default())?;
    found.warned(likelihood.warnings(), &["FlatRanges"]);
    let options = FitOptions {
        estimator: Estimator::PosteriorMode,
        ..FitOptions::default()
    };
    let posterior = model(&x, d, &y, 0.15 * 0.15, &options)?;
    let spread = |model: &Model| {
        let ranges = &model.parameters().ranges;
        let longest = ranges.iter().copied().fold(0.0, f64::max);
        longest / ranges.iter().copied().fold(f64::INFINITY, f64::min)
    };
    found.figure("longest over shortest range, likelihood", spread(&likelihood), "");
    found.at_most(
        "longest over shortest range, posterior mode",
        spread(&posterior),
        "",
        100.0,
    );
    Ok(())
}

fn noise_only(found: &mut Outcome) -> Result<(), Failed> {
    let n = 60;
    let x = random_points(n, 2, 2);
    let y = normal(n, 2);
    let fitted = model(&x, 2, &y, 1.0, &FitOptions::default())?;
    found.warned(fitted.warnings(), &["NoStructure"]);
    let prediction = fitted.predict(&[0.5, 0.5]);
    found.at_most("prediction, where the truth is 0", prediction.mean.abs(), "", 0.5);
    found.figure("standard error of the prediction", prediction.variance.sqrt(), "");
    let options = FitOptions {
        refuse_no_structure: true,
        ..FitOptions::default()
    };
    found.refused(model(&x, 2, &y, 1.0, &options), "NoStructure");
    Ok(())
}

fn constant(found: &mut Outcome) -> Result<(), Failed> {
    let x = random_points(20, 2, 3);
    let fitted = model(&x, 2, &[7.5; 20], 0.0, &FitOptions::default())?;
    found.warned(fitted.warnings(), &["ConstantResponse"]);
    let prediction = fitted.predict(&[0.3, 0.9]);
    found.at_most("error of the prediction", (prediction.mean - 7.5).abs(), "", 0.0);
    found.at_most("standard error", prediction.variance.sqrt(), "", 1e-100);
    Ok(())
}

fn linear(found: &mut Outcome) -> Result<(), Failed> {
    let x = random_points(30, 2, 4);
    let truth = |x: &[f64]| 3.0 + 2.0 * x[0] - x[1];
    let y: Vec<f64> = x.chunks(2).map(truth).collect();
    let at = random_points(200, 2, 5);
    let error = |model: &Model| {
        let errors = at.chunks(2).map(|x| (model.mean(x) - truth(x)).abs());
        errors.fold(0.0, f64::max)
    };
    let constant = model(&x, 2, &y, 0.0, &FitOptions::default())?;
    found.warned(constant.warnings(), &["RangesAtBound"]);
    found.at_most("largest error, constant trend", error(&constant), "", 1e-4);
    let options = FitOptions {
        trend: Trend::Linear,
        ..FitOptions::default()
    };
    let with_trend = model(&x, 2, &y, 0.0, &options)?;
    found.at_most("largest error, linear trend", error(&with_trend), "", 1e-12);
    Ok(())
}

fn cliff(found: &mut Outcome) -> Result<(), Failed> {
    let truth = |x: f64| f64::from(u8::from(x > 0.5));
    let x = grid(40);
    let y: Vec<f64> = x.iter().map(|&x| truth(x)).collect();
    let fitted = model(&x, 1, &y, 0.0, &FitOptions::default())?;
    found.warned(fitted.warnings(), &[]);
    let far: Vec<f64> = grid(997).into_iter().filter(|x| (x - 0.5).abs() > 0.1).collect();
    let errors = far.iter().map(|&x| (fitted.mean(&[x]) - truth(x)).abs());
    found.at_most(
        "largest error further than 0.1 from the cliff",
        errors.fold(0.0, f64::max),
        "",
        0.05,
    );
    let all = grid(997);
    let means: Vec<f64> = all.iter().map(|&x| fitted.mean(&[x])).collect();
    let beyond = means.iter().map(|m| (m - 1.0).max(-m).max(0.0));
    found.at_most("overshoot beside the cliff", beyond.fold(0.0, f64::max), "", 0.25);
    found.figure("range over spacing", fitted.parameters().ranges[0] * 39.0, "");
    let curve = |values: &[f64]| all.iter().zip(values).map(|(&x, &y)| [x, y]).collect();
    let truths: Vec<f64> = all.iter().map(|&x| truth(x)).collect();
    found.chart(
        "A step and its model",
        ("x", Scale::Linear),
        ("response", Scale::Linear),
        vec![("model", curve(&means)), ("truth", curve(&truths))],
    );
    Ok(())
}

fn few_points(found: &mut Outcome) -> Result<(), Failed> {
    let x = random_points(5, 6, 6);
    let y: Vec<f64> = x.chunks(6).map(|x| x.iter().sum()).collect();
    let fitted = model(&x, 6, &y, 0.0, &FitOptions::default())?;
    found.warned(fitted.warnings(), &["SharedRange"]);
    let [one] = [fitted.predict(&[0.5; 6])];
    found.at_most("error at the centre", (one.mean - 3.0).abs(), "", 1.0);
    found.at_least("standard error at the centre", one.variance.sqrt(), "", 1e-6);
    Ok(())
}

fn plane_of_points(found: &mut Outcome) -> Result<(), Failed> {
    let x: Vec<f64> = grid(12).iter().flat_map(|&t| [t, 2.0 * t]).collect();
    let y: Vec<f64> = grid(12).iter().map(|t| (5.0 * t).sin()).collect();
    let options = FitOptions {
        trend: Trend::Linear,
        ..FitOptions::default()
    };
    found.refused(model(&x, 2, &y, 0.0, &options), "Trend");
    let constant = model(&x, 2, &y, 0.0, &FitOptions::default())?;
    let error = (constant.mean(&[0.33, 0.66]) - 1.65_f64.sin()).abs();
    found.at_most("error on the line, constant trend", error, "", 0.01);
    Ok(())
}

fn wrong_noise(found: &mut Outcome) -> Result<(), Failed> {
    let truth = |x: f64| (5.0 * x).sin();
    let (n, sd) = (60, 0.2);
    let x = grid(n);
    let noise = normal(n, 7);
    let y: Vec<f64> = x.iter().zip(&noise).map(|(&x, z)| truth(x) + sd * z).collect();
    let fitted = |stated: f64, nugget| {
        let options = FitOptions {
            nugget,
            ..FitOptions::default()
        };
        model(&x, 1, &y, stated * stated, &options)
    };
    let right = fitted(sd, false)?;
    let small = fitted(0.01 * sd, false)?;
    let with_nugget = fitted(0.01 * sd, true)?;
    let large = fitted(100.0 * sd, false)?;
    found.warned(large.warnings(), &["NoStructure"]);
    found.figure("error with the right variance", rmse(&right, truth), "");
    found.figure("error with a variance 10 000 times too small", rmse(&small, truth), "");
    found.at_most(
        "error with an estimated nugget",
        rmse(&with_nugget, truth),
        "",
        1.5 * rmse(&right, truth),
    );
    let within = |model: &Model| 100.0 * model.leave_one_out().coverage90;
    found.warned(small.warnings(), &[]);
    found.at_most(
        "leave-one-out residuals within 90 % intervals, variance too small",
        within(&small),
        "%",
        85.0,
    );
    found.at_least(
        "leave-one-out residuals within 90 % intervals, estimated nugget",
        within(&with_nugget),
        "%",
        85.0,
    );
    found.figure("nugget found, as a standard deviation", with_nugget.parameters().nugget.sqrt(), "");
    Ok(())
}

fn extrapolation(found: &mut Outcome) -> Result<(), Failed> {
    let x = grid(15);
    let y: Vec<f64> = x.iter().map(|x| (5.0 * x).sin()).collect();
    let fitted = model(&x, 1, &y, 0.0, &FitOptions::default())?;
    found.warned(fitted.warnings(), &[]);
    let parameters = fitted.parameters();
    let far = fitted.predict(&[100.0]);
    let sd = parameters.sigma2.sqrt();
    found.at_most("distance from the mean at 100", (far.mean - parameters.mu).abs() / sd, "σ", 1e-9);
    found.at_least("standard error at 100", far.variance.sqrt() / sd, "σ", 1.0);
    let near = fitted.predict(&[2.0]);
    let error = (near.mean - 10_f64.sin()).abs() / near.variance.sqrt();
    found.at_most("error at 2, in standard errors", error, "", 3.0);
    Ok(())
}
