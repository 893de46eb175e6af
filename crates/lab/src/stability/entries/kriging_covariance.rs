//! Kriging: nearly singular covariance matrices and likelihoods without a maximum.

use kriging::{Data, Error, Estimator, FitOptions, Kernel, Model, Warning, fit};
use nalgebra::DMatrix;
use results::report::Scale;

use super::kriging_scene::{
    grid, kernel, model, normal, random_points, rmse, rmse_at, smooth, values,
};
use crate::stability::outcome::{EntryError, Outcome};
use crate::stability::{Entry, Method};

pub(super) const ENTRIES: [Entry; 5] = [
    Entry {
        id: "kriging-condition",
        title: "Condition number against nugget and spacing",
        input: "30 evenly spaced points on a line, spacings from a hundredth of the range to three ranges, \
                nuggets from 1e-12 to 1e-2 of the process variance",
        instead: "A nugget bounds the condition number by 1 + n/nugget at any spacing. For data without noise, jitter is \
                  added instead: 1e-12 of the process variance, and more only as far as needed.",
        check: condition,
        ..Entry::blank(Method::Kriging)
    },
    Entry {
        id: "kriging-dense-grid",
        title: "Squared exponential on dense grids",
        input: "sin 5x + x² without noise at 5 to 160 evenly spaced points, fitted with the squared exponential and with \
                Matérn 5/2; sin 3x₁ + x₂² on a grid of 30 × 30 points",
        instead: "A matrix that is singular to rounding gets jitter, with a warning, and the error stops falling. \
                  Matérn 5/2, the default, needs jitter from four times as many points on: a smooth function has a long \
                  range, in which the points are dense.",
        check: dense_grid,
        ..Entry::blank(Method::Kriging)
    },
    Entry {
        id: "kriging-flat-likelihood",
        title: "A flat likelihood",
        input: "12 points in 4 dimensions, a response that depends on the first coordinate alone, noise of \
                half its spread",
        instead: "The fit uses the ranges of the highest likelihood found, with a warning. The posterior mode determines \
                  the ranges by a weak prior.",
        check: flat_likelihood,
        ..Entry::blank(Method::Kriging)
    },
    Entry {
        id: "kriging-noise-only",
        title: "Noise without a signal",
        input: "60 points in 2 dimensions whose observations are independent of x, with their true noise \
                variance and stated as exact",
        instead: "The model predicts the mean, with intervals as wide as the uncertainty of the mean, and a warning. With \
                  refuse_no_structure the fit is refused.",
        check: noise_only,
        ..Entry::blank(Method::Kriging)
    },
    Entry {
        id: "kriging-constant",
        title: "All observations equal",
        input: "30 points in 3 dimensions with observations of 100, exact or with unequal noise variances, and every \
                covariance function",
        instead: "The model is the constant, with the variance of the weighted mean. No ranges are searched for, because \
                  the data do not determine them.",
        check: constant,
        ..Entry::blank(Method::Kriging)
    },
];

fn condition_number(kernel: Kernel, n: usize, spacing: f64, nugget: f64) -> f64 {
    let matrix = DMatrix::from_fn(n, n, |i, j| {
        let steps = i.abs_diff(j) as f64;
        let own = if i == j { nugget } else { 0.0 };
        kernel.correlation(&[steps * spacing]) + own
    });
    let eigenvalues = matrix.symmetric_eigenvalues();
    // With an eigenvalue below rounding, an f64 cannot resolve the condition number.
    eigenvalues.max() / eigenvalues.min().max(f64::EPSILON * 1e-2)
}

fn condition(outcome: &mut Outcome) -> Result<(), EntryError> {
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
    // The error of an eigenvalue is some units of rounding of the largest one, 30: 1 % of a nugget of 1e-12.
    outcome.at_most(
        "condition number over its bound 1 + n/nugget",
        worst,
        "",
        1.02,
    );
    let at_tenth = |covariance| condition_number(covariance, n, 0.1, 1e-12);
    outcome.figure(
        "condition number at a tenth of the range, squared exponential",
        at_tenth(Kernel::SquaredExponential),
        "",
    );
    outcome.figure(
        "condition number at a tenth of the range, Matérn 5/2",
        at_tenth(Kernel::Matern52),
        "",
    );
    outcome.chart(
        "Condition number of 30 points, by kernel and nugget",
        ("spacing over range", Scale::Log),
        ("condition number", Scale::Log),
        curves,
    );
    // A fit to such data.
    let x = grid(n);
    let y: Vec<f64> = x.iter().map(|x| (3.0 * x).sin()).collect();
    let model = model(&x, 1, &y, 0.0, &kernel(Kernel::SquaredExponential))?;
    outcome.warned(model.warnings(), &["Jitter"]);
    outcome.at_most(
        "error between the points with jitter",
        rmse(&model, |x| (3.0 * x).sin()),
        "",
        1e-4,
    );
    Ok(())
}

fn dense_grid(outcome: &mut Outcome) -> Result<(), EntryError> {
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
                outcome.warned(model.warnings(), &["Jitter"]);
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
    outcome.at_most(
        "largest error from 20 points on, squared exponential",
        worst(&smooth),
        "",
        1e-4,
    );
    outcome.at_most(
        "largest error from 20 points on, Matérn 5/2",
        worst(&rough),
        "",
        1e-3,
    );
    outcome.at_most(
        "points from which the squared exponential needs jitter",
        first_jitter[0],
        "",
        40.0,
    );
    outcome.at_least(
        "points from which Matérn 5/2 needs jitter",
        first_jitter[1],
        "",
        40.0,
    );
    let x: Vec<f64> = grid(30)
        .iter()
        .flat_map(|&a| grid(30).into_iter().flat_map(move |b| [a, b]))
        .collect();
    let truth = |x: &[f64]| (3.0 * x[0]).sin() + x[1] * x[1];
    let options = kernel(Kernel::SquaredExponential);
    let fitted = model(&x, 2, &values(&x, 2, truth), 0.0, &options)?;
    outcome.warned(fitted.warnings(), &["Jitter"]);
    let error = rmse_at(&fitted, &random_points(150, 2, 16), 2, truth);
    outcome.at_most("error on the grid of 30 × 30", error, "", 1e-7);
    outcome.chart(
        "Error against the number of points",
        ("points", Scale::Log),
        ("RMS error", Scale::Log),
        vec![("squared exponential", smooth), ("Matérn 5/2", rough)],
    );
    Ok(())
}

fn flat_likelihood(outcome: &mut Outcome) -> Result<(), EntryError> {
    let (n, d) = (12, 4);
    let x = random_points(n, d, 1);
    let noise = normal(n, 1);
    let y: Vec<f64> = (0..n).map(|i| x[i * d] + 0.15 * noise[i]).collect();
    let likelihood = model(&x, d, &y, 0.15 * 0.15, &FitOptions::default())?;
    outcome.warned(likelihood.warnings(), &["FlatRanges"]);
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
    outcome.figure(
        "longest over shortest range, likelihood",
        spread(&likelihood),
        "",
    );
    outcome.at_most(
        "longest over shortest range, posterior mode",
        spread(&posterior),
        "",
        100.0,
    );
    Ok(())
}

fn noise_only(outcome: &mut Outcome) -> Result<(), EntryError> {
    let n = 60;
    let x = random_points(n, 2, 2);
    let y = normal(n, 2);
    let fitted = model(&x, 2, &y, 1.0, &FitOptions::default())?;
    outcome.warned(fitted.warnings(), &["NoStructure"]);
    let prediction = fitted.predict(&[0.5, 0.5]);
    outcome.at_most(
        "prediction, where the truth is 0",
        prediction.mean.abs(),
        "",
        0.5,
    );
    outcome.figure(
        "standard error of the prediction",
        prediction.variance.sqrt(),
        "",
    );
    let options = FitOptions {
        refuse_no_structure: true,
        ..FitOptions::default()
    };
    let refusal = model(&x, 2, &y, 1.0, &options);
    let gains_little =
        matches!(&refusal, Err(Error::NoStructure { gain, needed }) if gain < needed);
    outcome.holds("the gain in likelihood is less than needed", gains_little);
    outcome.refused(refusal, "NoStructure");
    outcome.refused(model(&x, 2, &[1.0; 60], 1.0, &options), "NoStructure");
    let exact = model(&x, 2, &y, 0.0, &FitOptions::default())?;
    outcome.warned(exact.warnings(), &["NoStructure"]);
    let x = random_points(80, 3, 17);
    let noise = normal(80, 17);
    let y: Vec<f64> = x
        .chunks(3)
        .zip(&noise)
        .map(|(x, z)| smooth(x) + 0.22 * z)
        .collect();
    let fitted = model(&x, 3, &y, 0.05, &options)?;
    let is_noise = |warning: &Warning| matches!(warning, Warning::NoStructure { .. });
    let is_recognised = !fitted.warnings().iter().any(is_noise);
    outcome.holds(
        "a smooth function with a little noise has structure",
        is_recognised,
    );
    Ok(())
}

fn constant(outcome: &mut Outcome) -> Result<(), EntryError> {
    let x = random_points(30, 3, 3);
    let mut worst = 0.0_f64;
    for noise in [0.0, 0.02] {
        let noise_variance: Vec<f64> = (0..30)
            .map(|i| noise * (0.5 + f64::from(i) / 30.0))
            .collect();
        let of_mean = 1.0
            / noise_variance
                .iter()
                .map(|variance| 1.0 / variance)
                .sum::<f64>();
        let data = Data {
            x: &x,
            d: 3,
            y: &[100.0; 30],
            noise_variance: &noise_variance,
        };
        for covariance in Kernel::ALL {
            let fitted = fit(&data, &kernel(covariance))?;
            outcome.warned(fitted.warnings(), &["ConstantResponse"]);
            let prediction = fitted.predict(&[0.2, 0.4, 2.0]);
            worst = worst.max((prediction.mean - 100.0).abs());
            outcome.holds(
                "the variance is that of the weighted mean",
                (prediction.variance - of_mean).abs() <= 1e-6 * of_mean + 1e-300,
            );
            let left_out = fitted.leave_one_out();
            let is_small = |residual: &f64| residual.abs() < 1e-12;
            outcome.holds(
                "the leave-one-out residuals are 0, with Q² 0 and coverage 1",
                left_out.residuals.iter().all(is_small)
                    && (left_out.q2, left_out.coverage90) == (0.0, 1.0),
            );
            let likelihood = fitted.negative_log_likelihood();
            outcome.holds("the likelihood is finite", likelihood.is_finite());
        }
    }
    outcome.at_most("largest error of a prediction", worst, "", 1e-12);
    Ok(())
}
