//! Kriging: observations that contradict, repeat, stand out or are no numbers.

use kriging::{
    Data, Error, FitOptions, Method as FitMethod, Model, Response, Settings, Surrogate, Trend, fit,
};
use results::report::Scale;

use super::kriging_scene::{grid, model, normal, random_points, rmse};
use crate::stability::outcome::{Failed, Outcome};
use crate::stability::{Entry, Method};

pub(super) const ENTRIES: [Entry; 10] = [
    Entry {
        id: "kriging-near-duplicates",
        title: "Near-duplicates that agree",
        input: "sin 5x without noise at 20 points, and at 20 more that lie 1e-3 to 1e-12 beside them",
        instead: "The matrix is singular to rounding; jitter makes it positive definite.",
        check: near_duplicates,
        ..Entry::blank(Method::Kriging)
    },
    Entry {
        id: "kriging-contradiction",
        title: "Near-duplicates that contradict each other",
        input: "sin 5x without noise at 20 points, and one more observation 1e-12 beside the tenth that differs \
                from it by 0.5",
        instead: "The fit is refused, and the two observations are named: no smooth function has both. With an \
                  estimated nugget it is fitted.",
        check: contradiction,
        ..Entry::blank(Method::Kriging)
    },
    Entry {
        id: "kriging-duplicates",
        title: "Exact duplicates within their noise",
        input: "sin 5x with noise of known variance, 8 observations at each of 10 points",
        instead: "Observations at one point are merged into their precision-weighted mean, which changes no \
                  prediction.",
        check: duplicates,
        ..Entry::blank(Method::Kriging)
    },
    Entry {
        id: "kriging-contradictory-duplicates",
        title: "Exact duplicates that differ more than their noise permits",
        input: "Pairs of observations at each of 15 points that differ by 0.2, stated as exact",
        instead: "Their scatter is taken as noise, and its standard deviation is told.",
        check: contradictory_duplicates,
        ..Entry::blank(Method::Kriging)
    },
    Entry {
        id: "kriging-outlier",
        title: "An outlier of a million",
        input: "sin 5x at 40 points with noise of standard deviation 0.01, one observation 10⁶ too large",
        instead: "The observation is named and kept: it may be the truth. Left out, the model is as good as \
                  if it had not been there.",
        check: outlier,
        ..Entry::blank(Method::Kriging)
    },
    Entry {
        id: "kriging-ignored-coordinate",
        title: "A coordinate that never changes",
        input: "25 points in 2 dimensions that all have 0.3 in the second",
        instead: "The model does not depend on the coordinate.",
        check: ignored_coordinate,
        ..Entry::blank(Method::Kriging)
    },
    Entry {
        id: "kriging-one-point",
        title: "One point only",
        input: "Four observations at one point",
        instead: "The fit is refused: no covariance can be estimated.",
        check: one_point,
        ..Entry::blank(Method::Kriging)
    },
    Entry {
        id: "kriging-unusable-numbers",
        title: "NaN, infinity, negative variances, sizes beyond an f64",
        input: "Ten observations of which the fourth is NaN; a variance of −1; a variable from −1e308 to 1e308; \
                the logarithm of 0",
        instead: "Each is refused with its number and value.",
        check: unusable,
        ..Entry::blank(Method::Kriging)
    },
    Entry {
        id: "kriging-decades",
        title: "A response that spans decades",
        input: "exp(12 x) at 15 points, from 1 to 160 000",
        instead: "Nothing is said: the model of the response itself predicts values below zero and misses the \
                  small ones by orders of magnitude. “response = log” models the logarithm.",
        check: decades,
        ..Entry::blank(Method::Kriging)
    },
    Entry {
        id: "kriging-approximate",
        title: "The approximate method asked for what only the exact one offers",
        input: "Nearest-neighbour kriging with a linear trend, with a nugget, and as it is, of 400 points",
        instead: "It is refused. As it is, the approximation is compared with the exact model.",
        check: approximate,
        ..Entry::blank(Method::Kriging)
    },
];

fn wave(x: f64) -> f64 {
    (5.0 * x).sin()
}

fn waves(x: &[f64]) -> Vec<f64> {
    x.iter().map(|&x| wave(x)).collect()
}

fn estimated_nugget() -> FitOptions {
    FitOptions {
        nugget: kriging::Nugget::Estimated,
        ..FitOptions::default()
    }
}

fn near_duplicates(found: &mut Outcome) -> Result<(), Failed> {
    let mut curve = Vec::new();
    for power in 3..=12 {
        let gap = 10_f64.powi(-power);
        let x: Vec<f64> = grid(20).iter().flat_map(|&x| [x, x + gap]).collect();
        let fitted = model(&x, 1, &waves(&x), 0.0, &FitOptions::default())?;
        if power == 9 {
            found.warned(fitted.warnings(), &["Jitter"]);
        }
        curve.push([gap, rmse(&fitted, wave)]);
    }
    let worst = curve.iter().map(|p| p[1]).fold(0.0, f64::max);
    found.at_most("largest error at any gap", worst, "", 5e-3);
    let alone = model(&grid(20), 1, &waves(&grid(20)), 0.0, &FitOptions::default())?;
    found.figure("error without the duplicates", rmse(&alone, wave), "");
    found.chart(
        "Error against the gap between duplicates",
        ("gap", Scale::Log),
        ("RMS error", Scale::Log),
        vec![("with jitter where needed", curve)],
    );
    Ok(())
}

fn contradiction(found: &mut Outcome) -> Result<(), Failed> {
    let mut x = grid(20);
    let mut y = waves(&x);
    x.push(x[10] + 1e-12);
    y.push(y[10] + 0.5);
    let refused = model(&x, 1, &y, 0.0, &FitOptions::default());
    let names_both = matches!(
        &refused,
        Err(Error::Contradiction {
            first: 10,
            second: 20,
            ..
        })
    );
    found.refused(refused, "Contradiction");
    found.holds("observations 10 and 20 are named", names_both);
    let with_nugget = model(&x, 1, &y, 0.0, &estimated_nugget())?;
    found.warned(with_nugget.warnings(), &[]);
    let at = with_nugget.mean(&[x[10]]) - y[10];
    found.figure(
        "prediction above the first of the two, with a nugget",
        at,
        "",
    );
    found.at_most(
        "error with an estimated nugget",
        rmse(&with_nugget, wave),
        "",
        0.15,
    );
    Ok(())
}

fn duplicates(found: &mut Outcome) -> Result<(), Failed> {
    let x: Vec<f64> = grid(10).iter().flat_map(|&x| [x; 8]).collect();
    let noise = normal(80, 11);
    let y: Vec<f64> = x
        .iter()
        .zip(&noise)
        .map(|(&x, z)| wave(x) + 0.1 * z)
        .collect();
    let merged = model(&x, 1, &y, 0.01, &FitOptions::default())?;
    found.warned(merged.warnings(), &["MergedDuplicates"]);
    let means: Vec<f64> = y.chunks(8).map(|y| y.iter().sum::<f64>() / 8.0).collect();
    let of_means = model(&grid(10), 1, &means, 0.01 / 8.0, &FitOptions::default())?;
    let differences = grid(101)
        .into_iter()
        .map(|x| (merged.mean(&[x]) - of_means.mean(&[x])).abs());
    found.at_most(
        "largest difference from the model of the means",
        differences.fold(0.0, f64::max),
        "",
        1e-6,
    );
    found.at_most("error", rmse(&merged, wave), "", 0.05);
    Ok(())
}

fn contradictory_duplicates(found: &mut Outcome) -> Result<(), Failed> {
    let x: Vec<f64> = grid(15).iter().flat_map(|&x| [x; 2]).collect();
    let signs = [-0.1, 0.1].into_iter().cycle();
    let y: Vec<f64> = x
        .iter()
        .zip(signs)
        .map(|(&x, sign)| wave(x) + sign)
        .collect();
    let fitted = model(&x, 1, &y, 0.0, &FitOptions::default())?;
    found.warned(fitted.warnings(), &["ContradictoryDuplicates"]);
    found.at_most("error", rmse(&fitted, wave), "", 0.05);
    Ok(())
}

fn outlier(found: &mut Outcome) -> Result<(), Failed> {
    let n = 40;
    let x = grid(n);
    let noise = normal(n, 12);
    let sound: Vec<f64> = x
        .iter()
        .zip(&noise)
        .map(|(&x, z)| wave(x) + 0.01 * z)
        .collect();
    let mut y = sound.clone();
    y[17] += 1e6;
    let variance = 1e-4;
    let with = model(&x, 1, &y, variance, &FitOptions::default())?;
    found.warned(with.warnings(), &["Outliers"]);
    let named = with.leave_one_out().outliers();
    found.holds("observation 17 is named, and no other", named == [17]);
    let left: Vec<usize> = (0..n).filter(|i| !named.contains(i)).collect();
    let take = |values: &[f64]| left.iter().map(|&i| values[i]).collect::<Vec<f64>>();
    let without = model(&take(&x), 1, &take(&y), variance, &FitOptions::default())?;
    found.at_most(
        "error without the observations named",
        rmse(&without, wave),
        "",
        0.02,
    );
    found.figure("error with the outlier", rmse(&with, wave), "");
    let with_nugget = model(&x, 1, &y, variance, &estimated_nugget())?;
    found.figure(
        "error with the outlier and an estimated nugget",
        rmse(&with_nugget, wave),
        "",
    );
    Ok(())
}

fn ignored_coordinate(found: &mut Outcome) -> Result<(), Failed> {
    let x: Vec<f64> = grid(25).iter().flat_map(|&x| [x, 0.3]).collect();
    let fitted = model(&x, 2, &waves(&grid(25)), 0.0, &FitOptions::default())?;
    found.warned(fitted.warnings(), &["IgnoredCoordinate"]);
    let difference = fitted.mean(&[0.42, -1e6]) - fitted.mean(&[0.42, 0.3]);
    found.at_most(
        "difference that the coordinate makes",
        difference.abs(),
        "",
        0.0,
    );
    Ok(())
}

fn one_point(found: &mut Outcome) -> Result<(), Failed> {
    let x = [0.5; 4];
    let y = [1.0, 1.1, 0.9, 1.0];
    found.refused(
        model(&x, 1, &y, 0.01, &FitOptions::default()),
        "TooFewPoints",
    );
    found.refused(model(&x, 1, &y, 0.01, &estimated_nugget()), "TooFewPoints");
    Ok(())
}

fn unusable(found: &mut Outcome) -> Result<(), Failed> {
    let (x, y) = (grid(10), waves(&grid(10)));
    let mut bad = y.clone();
    bad[3] = f64::NAN;
    let fitted = |x: &[f64], y: &[f64], noise| -> Result<Model, Error> {
        model(x, 1, y, noise, &FitOptions::default())
    };
    found.refused(fitted(&x, &bad, 0.0), "NonFinite");
    found.refused(fitted(&x, &y, -1.0), "NegativeNoise");
    let wide: Vec<f64> = x.iter().map(|x| 1e308 * (2.0 * x - 1.0)).collect();
    found.refused(fitted(&wide, &y, 0.0), "Extent");
    let settings = Settings {
        response: Response::Log,
        ..Settings::default()
    };
    let data = Data {
        x: &x,
        d: 1,
        y: &y,
        noise_variance: &[0.0; 10],
    };
    found.refused(Surrogate::fit(&data, &settings), "Logarithm");
    Ok(())
}

fn decades(found: &mut Outcome) -> Result<(), Failed> {
    let truth = |x: f64| (12.0 * x).exp();
    let x = grid(15);
    let y: Vec<f64> = x.iter().map(|&x| truth(x)).collect();
    let data = Data {
        x: &x,
        d: 1,
        y: &y,
        noise_variance: &[0.0; 15],
    };
    let fitted = |response| {
        let settings = Settings {
            response,
            ..Settings::default()
        };
        Surrogate::fit(&data, &settings)
    };
    let (plain, log) = (fitted(Response::Plain)?, fitted(Response::Log)?);
    let curve = |model: &Surrogate| -> Vec<[f64; 2]> {
        let at = grid(200);
        at.iter()
            .map(|&x| [x, (model.mean(&[x]) / truth(x) - 1.0).abs()])
            .collect()
    };
    let worst = |curve: &[[f64; 2]]| curve.iter().map(|p| p[1]).fold(0.0, f64::max);
    let (of_plain, of_log) = (curve(&plain), curve(&log));
    found.warned(plain.warnings(), &[]);
    found.at_most(
        "largest relative error, logarithm",
        worst(&of_log),
        "",
        1e-3,
    );
    found.at_least(
        "largest relative error, response itself",
        worst(&of_plain),
        "",
        0.1,
    );
    found.chart(
        "Relative error of the two models",
        ("x", Scale::Linear),
        ("relative error", Scale::Log),
        vec![("response itself", of_plain), ("logarithm", of_log)],
    );
    Ok(())
}

fn approximate(found: &mut Outcome) -> Result<(), Failed> {
    let n = 400;
    let x = random_points(n, 2, 13);
    let truth = |x: &[f64]| (5.0 * x[0]).sin() + (3.0 * x[1]).cos();
    let noise = normal(n, 13);
    let y: Vec<f64> = x
        .chunks(2)
        .zip(&noise)
        .map(|(x, z)| truth(x) + 0.05 * z)
        .collect();
    let variances = vec![0.0025; n];
    let data = Data {
        x: &x,
        d: 2,
        y: &y,
        noise_variance: &variances,
    };
    let approximate = |fit| {
        let settings = Settings {
            fit,
            method: FitMethod::Vecchia,
            ..Settings::default()
        };
        Surrogate::fit(&data, &settings)
    };
    let trend = FitOptions {
        trend: Trend::Linear,
        ..FitOptions::default()
    };
    found.refused(approximate(trend), "ExactOnly");
    let (exact, near) = (
        fit(&data, &FitOptions::default())?,
        approximate(FitOptions::default())?,
    );
    let differences = x.chunks(2).map(|x| (exact.mean(x) - near.mean(x)).abs());
    found.at_most(
        "largest difference from the exact model",
        differences.fold(0.0, f64::max),
        "",
        0.02,
    );
    Ok(())
}
