//! Kriging: responses, points and noise that a model does not expect.

use kriging::{FitOptions, Model, Nugget, Trend};
use results::report::Scale;

use super::kriging_scene::{grid, model, normal, random_points, rmse};
use crate::stability::outcome::{Failed, Outcome};
use crate::stability::{Entry, Method};

pub(super) const ENTRIES: [Entry; 6] = [
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
                  said; “predict” marks such points as extrapolated.",
        check: extrapolation,
        ..Entry::blank(Method::Kriging)
    },
];

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
    let far: Vec<f64> = grid(997)
        .into_iter()
        .filter(|x| (x - 0.5).abs() > 0.1)
        .collect();
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
    found.at_most(
        "overshoot beside the cliff",
        beyond.fold(0.0, f64::max),
        "",
        0.25,
    );
    found.figure(
        "range over spacing",
        fitted.parameters().ranges[0] * 39.0,
        "",
    );
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
    found.at_least(
        "standard error at the centre",
        one.variance.sqrt(),
        "",
        1e-6,
    );
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
    found.warned(large.warnings(), &["NoStructure"]);
    found.figure("error with the right variance", rmse(&right, truth), "");
    found.figure(
        "error with a variance 10 000 times too small",
        rmse(&small, truth),
        "",
    );
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
    found.figure(
        "nugget found, as a standard deviation",
        with_nugget.parameters().nugget.sqrt(),
        "",
    );
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
    found.at_most(
        "distance from the mean at 100",
        (far.mean - parameters.mu).abs() / sd,
        "σ",
        1e-9,
    );
    found.at_least("standard error at 100", far.variance.sqrt() / sd, "σ", 1.0);
    let near = fitted.predict(&[2.0]);
    let error = (near.mean - 10_f64.sin()).abs() / near.variance.sqrt();
    found.at_most("error at 2, in standard errors", error, "", 3.0);
    Ok(())
}
