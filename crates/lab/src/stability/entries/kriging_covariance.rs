//! Kriging: matrices near singular, likelihoods without a maximum.

use kriging::{Estimator, FitOptions, Kernel, Model, Warning};
use nalgebra::DMatrix;
use results::report::Scale;

use super::kriging_scene::{grid, kernel, model, normal, random_points, rmse};
use crate::stability::outcome::{Failed, Outcome};
use crate::stability::{Entry, Method};

pub(super) const ENTRIES: [Entry; 5] = [
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
];

fn condition_number(kernel: Kernel, n: usize, spacing: f64, nugget: f64) -> f64 {
    let matrix = DMatrix::from_fn(n, n, |i, j| {
        let steps = i.abs_diff(j) as f64;
        let own = if i == j { nugget } else { 0.0 };
        kernel.correlation(&[steps * spacing]) + own
    });
    let eigenvalues = matrix.symmetric_eigenvalues();
    // An eigenvalue below rounding means that an f64 cannot resolve the condition number.
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
    found.at_most(
        "condition number over its bound 1 + n/nugget",
        worst,
        "",
        1.02,
    );
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
    // The library's behaviour with such data.
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
    found.at_most(
        "points from which the squared exponential needs jitter",
        first_jitter[0],
        "",
        40.0,
    );
    found.at_least(
        "points from which Matérn 5/2 needs jitter",
        first_jitter[1],
        "",
        40.0,
    );
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
    found.figure(
        "longest over shortest range, likelihood",
        spread(&likelihood),
        "",
    );
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
    found.at_most(
        "prediction, where the truth is 0",
        prediction.mean.abs(),
        "",
        0.5,
    );
    found.figure(
        "standard error of the prediction",
        prediction.variance.sqrt(),
        "",
    );
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
    found.at_most(
        "error of the prediction",
        (prediction.mean - 7.5).abs(),
        "",
        0.0,
    );
    found.at_most("standard error", prediction.variance.sqrt(), "", 1e-100);
    Ok(())
}
