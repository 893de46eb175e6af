//! Kriging: observations that repeat or contradict each other, outliers, and NaN.

use kriging::{
    Data, Error, FitOptions, Kernel, Method as FitMethod, Response, Settings, Surrogate, Trend,
    VecchiaOptions, Warning, fit, fit_vecchia,
};
use results::report::Scale;

use super::kriging_scene::{
    grid, kernel, model, normal, random_points, rmse, rmse_at, smooth, values,
};
use crate::stability::outcome::{EntryError, Outcome};
use crate::stability::{Entry, Method};

pub(super) const ENTRIES: [Entry; 10] = [
    Entry {
        id: "kriging-near-duplicates",
        title: "Near-duplicates that agree",
        input: "sin 5x without noise at 20 points, and at 20 more that lie 1e-3 to 1e-12 beside them; a cluster of 30 \
                points in 2 dimensions that is 1e-6 wide, and 30 points elsewhere",
        instead: "The covariance matrix is singular to rounding, and jitter makes it positive definite.",
        check: near_duplicates,
        ..Entry::blank(Method::Kriging)
    },
    Entry {
        id: "kriging-contradiction",
        title: "Near-duplicates that contradict each other",
        input: "sin 5x without noise at 20 points, and one more observation at a distance of 1e-10 to 3e-16 from number \
                10 that differs from it by 0.5",
        instead: "The fit is refused, exact or by nearest neighbours, and names the two observations: no smooth function \
                  has both values. With an estimated nugget the data are fitted.",
        check: contradiction,
        ..Entry::blank(Method::Kriging)
    },
    Entry {
        id: "kriging-duplicates",
        title: "Exact duplicates",
        input: "sin 5x with noise of known variance, 8 observations at each of 10 points; a smooth function without noise \
                at 20 points of which two are repeated",
        instead: "Observations at one point are merged into their precision-weighted mean, which changes no \
                  prediction.",
        check: duplicates,
        ..Entry::blank(Method::Kriging)
    },
    Entry {
        id: "kriging-contradictory-duplicates",
        title: "Exact duplicates that differ by more than their noise permits",
        input: "Three observations at each of 15 points, 0.1 apart and stated as exact",
        instead: "Their scatter is used as the noise variance. The warning has its standard deviation.",
        check: contradictory_duplicates,
        ..Entry::blank(Method::Kriging)
    },
    Entry {
        id: "kriging-outlier",
        title: "An outlier of a million",
        input: "sin 5x at 40 points with noise of standard deviation 0.01, one observation 10⁶ too large",
        instead: "The warning names the observation. The fit keeps it, since it may be right. A fit without it is as good \
                  as if it had never been there.",
        check: outlier,
        ..Entry::blank(Method::Kriging)
    },
    Entry {
        id: "kriging-ignored-coordinate",
        title: "A coordinate without variation",
        input: "25 points in 2 dimensions that all have 0.3 in the second",
        instead: "The model does not depend on the coordinate, with a warning.",
        check: ignored_coordinate,
        ..Entry::blank(Method::Kriging)
    },
    Entry {
        id: "kriging-one-point",
        title: "A single point",
        input: "One observation; four observations at one point, with known noise and with an estimated nugget",
        instead: "The fit is refused, because no covariance can be estimated.",
        check: one_point,
        ..Entry::blank(Method::Kriging)
    },
    Entry {
        id: "kriging-unusable-numbers",
        title: "NaN, infinity, negative variances, ranges beyond an f64",
        input: "Ten observations in 2 dimensions with one value that is NaN, infinite or negative; coordinates or \
                observations with a range beyond an f64; arrays of unequal length; the logarithm of 0",
        instead: "Each is refused with the number and the value of the observation.",
        check: unusable,
        ..Entry::blank(Method::Kriging)
    },
    Entry {
        id: "kriging-decades",
        title: "A response that spans decades",
        input: "exp(12 x) at 15 points, from 1 to 160 000",
        instead: "There is no warning: the model of the response itself predicts negative values and is wrong by orders of \
                  magnitude at small ones. “response = log” models the logarithm.",
        check: decades,
        ..Entry::blank(Method::Kriging)
    },
    Entry {
        id: "kriging-approximate",
        title: "An option that nearest-neighbour kriging does not have",
        input: "Nearest-neighbour kriging of 400 points, with a linear trend and with a constant one",
        instead: "The linear trend is refused. With a constant trend the approximation is close to the exact model.",
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

fn near_duplicates(outcome: &mut Outcome) -> Result<(), EntryError> {
    let mut curve = Vec::new();
    for power in 3..=12 {
        let gap = 10_f64.powi(-power);
        let x: Vec<f64> = grid(20).iter().flat_map(|&x| [x, x + gap]).collect();
        let fitted = model(&x, 1, &waves(&x), 0.0, &FitOptions::default())?;
        if power == 9 {
            outcome.warned(fitted.warnings(), &["Jitter"]);
        }
        curve.push([gap, rmse(&fitted, wave)]);
    }
    let worst = curve.iter().map(|p| p[1]).fold(0.0, f64::max);
    outcome.at_most("largest error at any gap", worst, "", 5e-3);
    let alone = model(&grid(20), 1, &waves(&grid(20)), 0.0, &FitOptions::default())?;
    outcome.figure("error without the duplicates", rmse(&alone, wave), "");
    let mut x = random_points(60, 2, 14);
    x[..60].iter_mut().for_each(|x| *x = 0.4 + 1e-6 * *x);
    let y = values(&x, 2, smooth);
    let at = random_points(100, 2, 15);
    let (mut worst, mut jitter) = (0.0_f64, 0.0_f64);
    for covariance in Kernel::ALL {
        let fitted = model(&x, 2, &y, 0.0, &kernel(covariance))?;
        worst = worst.max(rmse_at(&fitted, &at, 2, smooth));
        if matches!(covariance, Kernel::Matern52 | Kernel::SquaredExponential) {
            outcome.warned(fitted.warnings(), &["Jitter"]);
            for warning in fitted.warnings() {
                if let Warning::Jitter { relative } = warning {
                    jitter = jitter.max(*relative);
                }
            }
        }
    }
    // The function has a range of 8. The exponential covariance, the roughest, sets the limit.
    outcome.at_most(
        "largest error with the cluster, any covariance",
        worst,
        "",
        0.8,
    );
    outcome.at_most("largest jitter with the cluster", jitter, "", 1e-8);
    outcome.chart(
        "Error against the gap between duplicates",
        ("gap", Scale::Log),
        ("RMS error", Scale::Log),
        vec![("with jitter where needed", curve)],
    );
    Ok(())
}

fn contradiction(outcome: &mut Outcome) -> Result<(), EntryError> {
    let sound = grid(20);
    let mut y = waves(&sound);
    y.push(y[10] + 0.5);
    for gap in [1e-10, -1e-12, 3e-16] {
        let x = [&sound[..], &[sound[10] + gap]].concat();
        let data = Data {
            x: &x,
            d: 1,
            y: &y,
            noise_variance: &[0.0; 21],
        };
        let exact = fit(&data, &FitOptions::default()).map(|_| ());
        let near = fit_vecchia(&data, &VecchiaOptions::default()).map(|_| ());
        for refusal in [exact, near] {
            let is_pair = matches!(&refusal, Err(Error::Contradiction { first: 10, second: 20, difference, permitted })
                if (difference - 0.5).abs() < 1e-9 && *permitted < 0.1);
            outcome.holds(
                "observations 10 and 20 and their difference are named",
                is_pair,
            );
            outcome.refused(refusal, "Contradiction");
        }
        let with_nugget = model(&x, 1, &y, 0.0, &estimated_nugget())?;
        outcome.warned(with_nugget.warnings(), &[]);
        outcome.at_most(
            &format!("error with an estimated nugget, gap {gap:e}"),
            rmse(&with_nugget, wave),
            "",
            0.15,
        );
    }
    Ok(())
}

fn duplicates(outcome: &mut Outcome) -> Result<(), EntryError> {
    let x: Vec<f64> = grid(10).iter().flat_map(|&x| [x; 8]).collect();
    let noise = normal(80, 11);
    let y: Vec<f64> = x
        .iter()
        .zip(&noise)
        .map(|(&x, z)| wave(x) + 0.1 * z)
        .collect();
    let merged = model(&x, 1, &y, 0.01, &FitOptions::default())?;
    outcome.warned(merged.warnings(), &["MergedDuplicates"]);
    let means: Vec<f64> = y.chunks(8).map(|y| y.iter().sum::<f64>() / 8.0).collect();
    let of_means = model(&grid(10), 1, &means, 0.01 / 8.0, &FitOptions::default())?;
    let differences = grid(101)
        .into_iter()
        .map(|x| (merged.mean(&[x]) - of_means.mean(&[x])).abs());
    outcome.at_most(
        "largest difference from the model of the means",
        differences.fold(0.0, f64::max),
        "",
        1e-6,
    );
    outcome.at_most("error", rmse(&merged, wave), "", 0.05);
    let x = random_points(20, 2, 23);
    let repeated = [&x[..], &x[6..8], &x[6..8], &x[14..16]].concat();
    let distinct = Warning::MergedDuplicates {
        observations: 23,
        distinct: 20,
    };
    for covariance in [
        Kernel::Matern52,
        Kernel::SquaredExponential,
        Kernel::RadialMatern52,
    ] {
        let once = model(&x, 2, &values(&x, 2, smooth), 0.0, &kernel(covariance))?;
        let merged = model(
            &repeated,
            2,
            &values(&repeated, 2, smooth),
            0.0,
            &kernel(covariance),
        )?;
        let at = [0.4, 0.4];
        outcome.holds(
            "repeated exact observations change no parameter and no prediction",
            once.parameters() == merged.parameters() && once.mean(&at) == merged.mean(&at),
        );
        let carries = merged.warnings().contains(&distinct);
        outcome.holds("the warning carries the numbers of observations", carries);
        let interpolates = x
            .chunks(2)
            .all(|x| (merged.mean(x) - smooth(x)).abs() < 1e-6);
        outcome.holds("the model passes through the observations", interpolates);
    }
    Ok(())
}

fn contradictory_duplicates(outcome: &mut Outcome) -> Result<(), EntryError> {
    let x: Vec<f64> = grid(15).iter().flat_map(|&x| [x; 3]).collect();
    let y: Vec<f64> = grid(15)
        .iter()
        .flat_map(|&x| [-0.1, 0.0, 0.1].map(|off| wave(x) + off))
        .collect();
    let fitted = model(&x, 1, &y, 0.0, &FitOptions::default())?;
    outcome.warned(fitted.warnings(), &["ContradictoryDuplicates"]);
    let has_scatter = |warning: &Warning| match warning {
        Warning::ContradictoryDuplicates { points: 15, sd } => (sd - 0.1).abs() < 1e-12,
        _ => false,
    };
    let carries = fitted.warnings().iter().any(has_scatter);
    outcome.holds(
        "the warning carries 15 points and a standard deviation of 0.1",
        carries,
    );
    outcome.at_most("error", rmse(&fitted, wave), "", 0.05);
    Ok(())
}

fn outlier(outcome: &mut Outcome) -> Result<(), EntryError> {
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
    outcome.warned(with.warnings(), &["Outliers"]);
    let named = with.leave_one_out().outliers();
    outcome.holds("observation 17 alone is an outlier", named == [17]);
    let clean = model(&x, 1, &sound, variance, &FitOptions::default())?;
    let is_clean = clean.leave_one_out().outliers().is_empty();
    outcome.holds("without the error there is no outlier", is_clean);
    let left: Vec<usize> = (0..n).filter(|i| !named.contains(i)).collect();
    let take = |values: &[f64]| left.iter().map(|&i| values[i]).collect::<Vec<f64>>();
    let without = model(&take(&x), 1, &take(&y), variance, &FitOptions::default())?;
    outcome.at_most(
        "error without the observations named",
        rmse(&without, wave),
        "",
        0.02,
    );
    outcome.figure("error with the outlier", rmse(&with, wave), "");
    let with_nugget = model(&x, 1, &y, variance, &estimated_nugget())?;
    // No worse than a constant, except for the outlier's share in the mean.
    outcome.at_most(
        "error with the outlier and an estimated nugget",
        rmse(&with_nugget, wave),
        "",
        1.0 + 1e6 / n as f64,
    );
    for fitted in [&with, &with_nugget] {
        let outlier = fitted.warnings().iter().find_map(|warning| match warning {
            Warning::Outliers { worst, .. } => Some((worst[0].observation, warning.to_string())),
            _ => None,
        });
        let is_named = outlier
            .is_some_and(|(number, text)| number == 17 && text.contains("observation 17 lies"));
        outcome.holds("the warning names observation 17 as the worst", is_named);
    }
    Ok(())
}

fn ignored_coordinate(outcome: &mut Outcome) -> Result<(), EntryError> {
    let x: Vec<f64> = grid(25).iter().flat_map(|&x| [x, 0.3]).collect();
    let fitted = model(&x, 2, &waves(&grid(25)), 0.0, &FitOptions::default())?;
    outcome.warned(fitted.warnings(), &["IgnoredCoordinate"]);
    let is_second = fitted
        .warnings()
        .contains(&Warning::IgnoredCoordinate { coordinate: 1 });
    let range = fitted.parameters().ranges[1];
    outcome.holds(
        "the second coordinate has an infinite range",
        is_second && range == f64::INFINITY,
    );
    let difference = fitted.mean(&[0.42, -1e6]) - fitted.mean(&[0.42, 0.3]);
    outcome.at_most(
        "difference that the coordinate makes",
        difference.abs(),
        "",
        0.0,
    );
    Ok(())
}

fn one_point(outcome: &mut Outcome) -> Result<(), EntryError> {
    let x = [0.5; 4];
    let y = [1.0, 1.1, 0.9, 1.0];
    for (count, options) in [
        (1, FitOptions::default()),
        (4, FitOptions::default()),
        (4, estimated_nugget()),
    ] {
        let refusal = model(&x[..count], 1, &y[..count], 0.01, &options);
        outcome.refused_with(refusal, "TooFewPoints", "1 distinct points");
    }
    Ok(())
}

fn unusable(outcome: &mut Outcome) -> Result<(), EntryError> {
    type Change = fn(&mut [f64], &mut [f64], &mut [f64]);
    let sound = (random_points(10, 2, 24), waves(&grid(10)), vec![0.01; 10]);
    let changes: [(&str, &str, Change); 6] = [
        ("NonFinite", "y number 7 is NaN", |_, y, _| y[7] = f64::NAN),
        ("NonFinite", "x number 13 is inf", |x, _, _| {
            x[13] = f64::INFINITY
        }),
        ("NonFinite", "number 3 is NaN", |_, _, noise| {
            noise[3] = f64::NAN
        }),
        ("NegativeNoise", "observation 2 is -1", |_, _, noise| {
            noise[2] = -1.0
        }),
        ("Extent", "x spans", |x, _, _| {
            (x[0], x[2]) = (f64::MAX, f64::MIN)
        }),
        ("Extent", "y spans", |_, y, _| y[0] = 1e200),
    ];
    for (expected, values, change) in changes {
        let (mut x, mut y, mut noise_variance) = sound.clone();
        change(&mut x, &mut y, &mut noise_variance);
        let data = Data {
            x: &x,
            d: 2,
            y: &y,
            noise_variance: &noise_variance,
        };
        outcome.refused_with(fit(&data, &FitOptions::default()), expected, values);
    }
    let (x, y, noise_variance) = (&sound.0, &sound.1, &sound.2);
    let data = Data {
        x,
        d: 2,
        y,
        noise_variance,
    };
    let short = fit(&Data { x: &x[1..], ..data }, &FitOptions::default());
    outcome.refused_with(short, "Shape", "x has 19 numbers, expected 20");
    let flat = fit(&Data { d: 0, ..data }, &FitOptions::default());
    outcome.holds("points without coordinates are refused", flat.is_err());
    let fitted = fit(&data, &FitOptions::default())?;
    outcome.refused_with(
        fitted.predict_many(&[0.1, 0.2, 0.3]),
        "Shape",
        "x has 3 numbers",
    );
    let settings = Settings {
        response: Response::Log,
        ..Settings::default()
    };
    outcome.refused_with(
        Surrogate::fit(&data, &settings),
        "Logarithm",
        "observation 0 is 0",
    );
    Ok(())
}

fn decades(outcome: &mut Outcome) -> Result<(), EntryError> {
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
    outcome.warned(plain.warnings(), &[]);
    outcome.at_most(
        "largest relative error, logarithm",
        worst(&of_log),
        "",
        1e-3,
    );
    outcome.at_least(
        "largest relative error, response itself",
        worst(&of_plain),
        "",
        0.1,
    );
    outcome.chart(
        "Relative error of the two models",
        ("x", Scale::Linear),
        ("relative error", Scale::Log),
        vec![("response itself", of_plain), ("logarithm", of_log)],
    );
    Ok(())
}

fn approximate(outcome: &mut Outcome) -> Result<(), EntryError> {
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
    outcome.refused_with(approximate(trend), "ExactOnly", "a linear trend");
    let (exact, near) = (
        fit(&data, &FitOptions::default())?,
        approximate(FitOptions::default())?,
    );
    let differences = x.chunks(2).map(|x| (exact.mean(x) - near.mean(x)).abs());
    outcome.at_most(
        "largest difference from the exact model",
        differences.fold(0.0, f64::max),
        "",
        0.02,
    );
    Ok(())
}
