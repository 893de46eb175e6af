//! Kriging: responses, points and noise that violate the assumptions of a model.

use kriging::{FitOptions, Model, Nugget, Trend, Warning};
use results::report::Scale;

use super::kriging_scene::{grid, model, normal, random_points, rmse, rmse_at, values};
use crate::stability::outcome::{EntryError, Outcome};
use crate::stability::{Entry, Method};

pub(super) const ENTRIES: [Entry; 6] = [
    Entry {
        id: "kriging-linear",
        title: "A linear response",
        input: "3 + 2 x₁ − x₂ without noise at 30 points in 2 dimensions, for which the likelihood has no maximum in the \
                ranges; the same with noise",
        instead: "The search stops at its bounds, with a warning. A linear trend describes such a response exactly and \
                  extrapolates it.",
        check: linear,
        ..Entry::blank(Method::Kriging)
    },
    Entry {
        id: "kriging-cliff",
        title: "A cliff",
        input: "A step from 0 to 1 at x = 0.5 without noise at 40 evenly spaced points; a smooth function with a penalty \
                of 100 where x₁ > 0.2 at 150 random points in 2 dimensions",
        instead: "The ranges become short and the intervals wide. There is no warning, because the leave-one-out residuals \
                  look like those of a rough function.",
        check: cliff,
        ..Entry::blank(Method::Kriging)
    },
    Entry {
        id: "kriging-few-points",
        title: "Fewer points than ranges",
        input: "2, 3 and 5 points in 6 dimensions",
        instead: "All coordinates share one range, in units of their extents, with a warning.",
        check: few_points,
        ..Entry::blank(Method::Kriging)
    },
    Entry {
        id: "kriging-plane-of-points",
        title: "A trend that the points do not determine",
        input: "A linear trend for 12 points on a line in 2 dimensions, and for 3 points",
        instead: "The fit is refused with the number of coefficients. A constant trend can be fitted.",
        check: plane_of_points,
        ..Entry::blank(Method::Kriging)
    },
    Entry {
        id: "kriging-wrong-noise",
        title: "A wrong noise variance",
        input: "sin 5x with noise of standard deviation 0.2 at 60 points, stated as 0.002, 0.2 and 20",
        instead: "With too small a variance the model follows the noise. The coverage of the leave-one-out intervals shows \
                  it, and an estimated nugget finds the missing variance. Too large a variance hides the structure, with \
                  a warning.",
        check: wrong_noise,
        ..Entry::blank(Method::Kriging)
    },
    Entry {
        id: "kriging-extrapolation",
        title: "Far from the data",
        input: "sin 5x at 15 points of [0, 1], predicted at 2 and at 100",
        instead: "The prediction tends to the mean and its standard error to that of the process. There is no warning; \
                  `predict` marks such points as extrapolated.",
        check: extrapolation,
        ..Entry::blank(Method::Kriging)
    },
];

fn linear(outcome: &mut Outcome) -> Result<(), EntryError> {
    let x = random_points(30, 2, 4);
    let truth = |x: &[f64]| 3.0 + 2.0 * x[0] - x[1];
    let y: Vec<f64> = x.chunks(2).map(truth).collect();
    let at = random_points(200, 2, 5);
    let error = |model: &Model| {
        let errors = at.chunks(2).map(|x| (model.mean(x) - truth(x)).abs());
        errors.fold(0.0, f64::max)
    };
    let constant = model(&x, 2, &y, 0.0, &FitOptions::default())?;
    outcome.warned(constant.warnings(), &["RangesAtBound"]);
    outcome.at_most("largest error, constant trend", error(&constant), "", 1e-4);
    let options = FitOptions {
        trend: Trend::Linear,
        ..FitOptions::default()
    };
    let with_trend = model(&x, 2, &y, 0.0, &options)?;
    outcome.at_most("largest error, linear trend", error(&with_trend), "", 1e-12);
    let noise = normal(30, 18);
    let noisy: Vec<f64> = y.iter().zip(&noise).map(|(y, z)| y + 0.01 * z).collect();
    let with_trend = model(&x, 2, &noisy, 1e-4, &options)?;
    // The slopes have standard errors of 0.01/√(30/12) = 0.006, the prediction one of 0.025.
    let slope = with_trend.parameters().slopes[0];
    outcome.at_most(
        "error of a slope, noisy response",
        (slope - 2.0).abs(),
        "",
        0.025,
    );
    let at = [3.0, -2.0];
    let extrapolated = (with_trend.mean(&at) - truth(&at)).abs();
    outcome.at_most("error at (3, −2), noisy response", extrapolated, "", 0.1);
    Ok(())
}

fn cliff(outcome: &mut Outcome) -> Result<(), EntryError> {
    let truth = |x: f64| f64::from(u8::from(x > 0.5));
    let x = grid(40);
    let y: Vec<f64> = x.iter().map(|&x| truth(x)).collect();
    let fitted = model(&x, 1, &y, 0.0, &FitOptions::default())?;
    outcome.warned(fitted.warnings(), &[]);
    let far: Vec<f64> = grid(997)
        .into_iter()
        .filter(|x| (x - 0.5).abs() > 0.1)
        .collect();
    let errors = far.iter().map(|&x| (fitted.mean(&[x]) - truth(x)).abs());
    outcome.at_most(
        "largest error further than 0.1 from the cliff",
        errors.fold(0.0, f64::max),
        "",
        0.05,
    );
    let all = grid(997);
    let means: Vec<f64> = all.iter().map(|&x| fitted.mean(&[x])).collect();
    let beyond = means.iter().map(|m| (m - 1.0).max(-m).max(0.0));
    outcome.at_most(
        "overshoot beside the cliff",
        beyond.fold(0.0, f64::max),
        "",
        0.25,
    );
    outcome.figure(
        "range over spacing",
        fitted.parameters().ranges[0] * 39.0,
        "",
    );
    let curve = |values: &[f64]| all.iter().zip(values).map(|(&x, &y)| [x, y]).collect();
    let truths: Vec<f64> = all.iter().map(|&x| truth(x)).collect();
    outcome.chart(
        "A step and its model",
        ("x", Scale::Linear),
        ("response", Scale::Linear),
        vec![("model", curve(&means)), ("truth", curve(&truths))],
    );
    let penalised = |x: &[f64]| {
        let smooth = 2.0 * (3.0 * x[0]).sin() + (2.0 * x[1]).cos() + 0.3 * (x[0] + x[1]);
        if x[0] > 0.2 { 100.0 } else { smooth }
    };
    let x = random_points(150, 2, 19);
    let fitted = model(
        &x,
        2,
        &values(&x, 2, penalised),
        0.0,
        &FitOptions::default(),
    )?;
    let at = random_points(300, 2, 20);
    // 4 % of the points lie within 0.02 of the cliff: 100 √0.04/2 is 10.
    let error = rmse_at(&fitted, &at, 2, penalised);
    outcome.at_most("RMS error with the penalty", error, "", 10.0);
    let is_far = |x: &&[f64]| x[0] > 0.5;
    let far: Vec<f64> = at.chunks(2).filter(is_far).flatten().copied().collect();
    let error = rmse_at(&fitted, &far, 2, penalised);
    outcome.at_most("RMS error with the penalty, where x₁ > 0.5", error, "", 4.0);
    Ok(())
}

fn few_points(outcome: &mut Outcome) -> Result<(), EntryError> {
    let dimensions = 6;
    for distinct in [2, 3, 5] {
        let x = random_points(distinct, dimensions, 6);
        let y = values(&x, dimensions, |x| x.iter().sum());
        let fitted = model(&x, dimensions, &y, 0.0, &FitOptions::default())?;
        outcome.warned(fitted.warnings(), &["SharedRange", "FewPoints"]);
        // One range for all coordinates, σ² and the mean.
        let parameters = 3;
        let numbers = [
            Warning::SharedRange {
                distinct,
                dimensions,
            },
            Warning::FewPoints {
                distinct,
                parameters,
            },
        ];
        let warnings = fitted.warnings();
        let carries = numbers.iter().all(|number| warnings.contains(number));
        outcome.holds(
            "the warnings carry the numbers of points and parameters",
            carries,
        );
        let low = y.iter().copied().fold(f64::INFINITY, f64::min);
        let high = y.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let at = random_points(150, dimensions, 22);
        let mut predictions = at.chunks(dimensions).map(|x| fitted.predict(x));
        outcome.holds(
            "predictions stay within 0.5 of the observations and have a variance",
            predictions
                .all(|one| (low - 0.5..=high + 0.5).contains(&one.mean) && one.variance > 0.0),
        );
        let left_out = fitted.leave_one_out().residuals.len();
        outcome.holds(
            "every observation has a leave-one-out residual",
            left_out == distinct,
        );
    }
    Ok(())
}

fn plane_of_points(outcome: &mut Outcome) -> Result<(), EntryError> {
    let x: Vec<f64> = grid(12).iter().flat_map(|&t| [t, 2.0 * t]).collect();
    let y: Vec<f64> = grid(12).iter().map(|t| (5.0 * t).sin()).collect();
    let options = FitOptions {
        trend: Trend::Linear,
        ..FitOptions::default()
    };
    let refusal = model(&x, 2, &y, 0.0, &options);
    outcome.refused_with(
        refusal,
        "Trend",
        "12 distinct points do not determine a trend of 3",
    );
    let few = random_points(3, 2, 21);
    let refusal = model(&few, 2, &y[..3], 0.0, &options);
    outcome.refused_with(refusal, "Trend", "3 distinct points");
    let constant = model(&x, 2, &y, 0.0, &FitOptions::default())?;
    let error = (constant.mean(&[0.33, 0.66]) - 1.65_f64.sin()).abs();
    outcome.at_most("error on the line, constant trend", error, "", 0.01);
    Ok(())
}

fn wrong_noise(outcome: &mut Outcome) -> Result<(), EntryError> {
    let truth = |x: f64| (5.0 * x).sin();
    let (n, sd) = (60, 0.2);
    let x = grid(n);
    let noise = normal(n, 7);
    let y: Vec<f64> = x
        .iter()
        .zip(&noise)
        .map(|(&x, z)| truth(x) + sd * z)
        .collect();
    let fitted = |stated: f64, nugget| {
        let options = FitOptions {
            nugget,
            ..FitOptions::default()
        };
        model(&x, 1, &y, stated * stated, &options)
    };
    let right = fitted(sd, Nugget::Known)?;
    let small = fitted(0.01 * sd, Nugget::Known)?;
    let with_nugget = fitted(0.01 * sd, Nugget::Estimated)?;
    let large = fitted(100.0 * sd, Nugget::Known)?;
    outcome.warned(large.warnings(), &["NoStructure"]);
    outcome.figure("error with the right variance", rmse(&right, truth), "");
    outcome.figure(
        "error with a variance 10 000 times too small",
        rmse(&small, truth),
        "",
    );
    outcome.at_most(
        "error with an estimated nugget",
        rmse(&with_nugget, truth),
        "",
        1.5 * rmse(&right, truth),
    );
    let within = |model: &Model| 100.0 * model.leave_one_out().coverage90;
    outcome.warned(small.warnings(), &[]);
    outcome.at_most(
        "leave-one-out residuals within 90 % intervals, variance too small",
        within(&small),
        "%",
        85.0,
    );
    outcome.at_least(
        "leave-one-out residuals within 90 % intervals, estimated nugget",
        within(&with_nugget),
        "%",
        85.0,
    );
    outcome.figure(
        "nugget found, as a standard deviation",
        with_nugget.parameters().nugget.sqrt(),
        "",
    );
    Ok(())
}

fn extrapolation(outcome: &mut Outcome) -> Result<(), EntryError> {
    let x = grid(15);
    let y: Vec<f64> = x.iter().map(|x| (5.0 * x).sin()).collect();
    let fitted = model(&x, 1, &y, 0.0, &FitOptions::default())?;
    outcome.warned(fitted.warnings(), &[]);
    let parameters = fitted.parameters();
    let far = fitted.predict(&[100.0]);
    let sd = parameters.sigma2.sqrt();
    outcome.at_most(
        "distance from the mean at 100",
        (far.mean - parameters.mu).abs() / sd,
        "σ",
        1e-9,
    );
    outcome.at_least("standard error at 100", far.variance.sqrt() / sd, "σ", 1.0);
    let near = fitted.predict(&[2.0]);
    let error = (near.mean - 10_f64.sin()).abs() / near.variance.sqrt();
    outcome.at_most("error at 2, in standard errors", error, "", 3.0);
    Ok(())
}
