use serde::Serialize;

use crate::modelling::file::ModelInput;
use crate::modelling::table::SkippedRows;
use crate::modelling::{Error, InputError, ModelFile, Quantity, Table};

/// The response at the rows of a table, as a model predicts it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Predictions {
    pub response: Quantity,
    /// The probability of `quantile`.
    pub level: f64,
    /// The probability of the intervals.
    pub interval: f64,
    /// The noise variance of a new observation, see [`ModelFile::noise_variance`].
    pub noise_variance: f64,
    /// The names of the inputs, in the order of each row's `at`.
    pub inputs: Vec<String>,
    /// Columns of the table that are not inputs.
    pub unused: Vec<String>,
    /// Rows that the caller left out of the table, by the input that has no value there.
    pub skipped: Vec<SkippedRows>,
    /// One prediction for each row, in its order.
    pub rows: Vec<PointPrediction>,
}

/// A prediction at one point, of the noise-free response unless said otherwise, in the response's unit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PointPrediction {
    /// The row's line in the file, from 1.
    pub line: u64,
    /// The point.
    pub at: Vec<f64>,
    /// The kriging mean; the median if ln y is modelled.
    pub mean: f64,
    /// The standard error: the root of the kriging variance.
    pub standard_error: f64,
    /// The quantile of the distribution that mean and variance give the response.
    pub quantile: f64,
    /// The interval of the noise-free response.
    pub mean_interval: [f64; 2],
    /// The interval of a new observation, its noise included.
    pub observation_interval: [f64; 2],
    /// Whether the point lies outside the box of the fitted points.
    pub extrapolates: bool,
}

/// Predicts the response at each row of a table, whose columns are found by the inputs' names.
///
/// # Errors
///
/// A column is missing or holds something else than numbers, or `level` or `interval` is not between 0 and 1.
pub fn predict(
    model: &ModelFile,
    table: &Table,
    level: f64,
    interval: f64,
) -> Result<Predictions, Error> {
    for (what, value) in [("level", level), ("interval", interval)] {
        if !(value > 0.0 && value < 1.0) {
            return Err(Error::Settings(format!(
                "the {what} is {value}, but must be above 0 and below 1"
            )));
        }
    }
    let names: Vec<String> = model.inputs.iter().map(|i| i.name.clone()).collect();
    let not_among = |of: &[String], others: &[String]| -> Vec<String> {
        let missing = |name: &&String| !others.contains(name);
        of.iter().filter(missing).cloned().collect()
    };
    let missing = not_among(&names, table.columns());
    let unused = not_among(table.columns(), &names);
    if !missing.is_empty() {
        let unknown = if unused.is_empty() {
            String::new()
        } else {
            format!("; its other columns are {}", unused.join(", "))
        };
        let message = format!(
            "has no column {}, but the model's inputs are {}{unknown}",
            missing.join(", "),
            names.join(", ")
        );
        return Err(InputError::in_file(table.file(), message).into());
    }
    let columns = names.iter().map(|name| table.numbers(name));
    let columns = columns.collect::<Result<Vec<_>, _>>()?;
    let points = (0..table.len()).map(|i| columns.iter().map(|column| column[i]).collect());
    let points: Vec<Vec<f64>> = points.collect();
    let predictions = model.surrogate.predict_many(&points.concat())?;
    let rows = points.into_iter().zip(predictions).enumerate();
    // An upper level that rounds to 1 would be at infinity.
    let upper = (0.5 + 0.5 * interval).min(1.0 - 0.5 * f64::EPSILON);
    let ends = [0.5 - 0.5 * interval, upper];
    let surrogate = &model.surrogate;
    let rows = rows.map(|(row, (at, prediction))| {
        let observation = surrogate.observed(prediction, model.noise_variance);
        PointPrediction {
            line: table.line(row),
            extrapolates: is_outside(&model.inputs, &at),
            at,
            mean: prediction.mean,
            standard_error: prediction.variance.sqrt(),
            quantile: surrogate.quantile(prediction, level),
            mean_interval: ends.map(|end| surrogate.quantile(prediction, end)),
            observation_interval: ends.map(|end| surrogate.quantile(observation, end)),
        }
    });
    Ok(Predictions {
        response: model.response.clone(),
        level,
        interval,
        noise_variance: model.noise_variance,
        inputs: names,
        unused,
        skipped: Vec::new(),
        rows: rows.collect(),
    })
}

fn is_outside(inputs: &[ModelInput], at: &[f64]) -> bool {
    let mut pairs = inputs.iter().zip(at);
    pairs.any(|(input, value)| !(input.low..=input.high).contains(value))
}

impl Predictions {
    /// The predictions as CSV: the inputs, `mean`, `standard_error`, `quantile`, the ends of both intervals and
    /// `extrapolates` (0 or 1).
    ///
    /// # Errors
    ///
    /// Never for predictions of [`predict()`]: each has all inputs.
    pub fn to_csv(&self) -> Result<Vec<u8>, csv::Error> {
        let mut out = csv::Writer::from_writer(Vec::new());
        let figures = [
            "mean",
            "standard_error",
            "quantile",
            "mean_low",
            "mean_high",
            "observation_low",
            "observation_high",
            "extrapolates",
        ]
        .map(str::to_owned);
        out.write_record(self.inputs.iter().chain(&figures))?;
        for row in &self.rows {
            let figures = [row.mean, row.standard_error, row.quantile];
            let intervals = row.mean_interval.iter().chain(&row.observation_interval);
            let numbers = row
                .at
                .iter()
                .chain(&figures)
                .chain(intervals)
                .map(f64::to_string);
            let mark = u8::from(row.extrapolates).to_string();
            out.write_record(numbers.chain([mark]))?;
        }
        out.into_inner().map_err(|error| error.into_error().into())
    }
}

#[cfg(test)]
mod tests {
    use kriging::{Response, Settings};

    use super::*;
    use crate::modelling::{Request, fit};

    /// A model of y = exp(a − 2 b) on a grid, without noise.
    fn model(response: Response) -> ModelFile {
        let mut text = String::from("a_mm,b,y\n");
        for i in 0..49 {
            let (a, b) = ((i % 7) as f64 / 6.0, (i / 7) as f64 / 6.0);
            text += &format!("{a},{b},{}\n", (a - 2.0 * b).exp());
        }
        let table = Table::parse("data.csv", &text).unwrap();
        let request = Request {
            response: "y".to_owned(),
            variance: None,
            inputs: None,
            skip_missing: false,
            nugget: Some(kriging::Nugget::Known),
            settings: Settings {
                response,
                ..Settings::default()
            },
        };
        fit(&table, &request).unwrap().model
    }

    #[test]
    fn predictions_are_the_functions_in_any_order_of_columns() {
        for scale in [Response::Plain, Response::Log] {
            let model = model(scale);
            let at = "note,b,a_mm\nx,0.3,0.4\ny,0.3,1.2\n";
            let at = Table::parse("at.csv", at).unwrap();
            let found = predict(&model, &at, 0.9, 0.95).unwrap();
            assert_eq!(found.unused, ["note"]);
            let truth = (0.4_f64 - 0.6).exp();
            let PointPrediction {
                mean,
                standard_error,
                quantile,
                ..
            } = found.rows[0];
            assert!((mean / truth - 1.0).abs() < 1e-3, "{mean} {truth}");
            assert!(standard_error > 0.0 && quantile > mean);
            let upper = quantile - mean;
            // z(0.9) = 1.2816; a log-normal quantile is a little further from the median.
            assert!((upper / standard_error - 1.2816).abs() < 0.01, "{upper}");
            let marks: Vec<bool> = found.rows.iter().map(|row| row.extrapolates).collect();
            assert_eq!(marks, [false, true]);
            let text = String::from_utf8(found.to_csv().unwrap()).unwrap();
            let mut lines = text.lines();
            assert_eq!(
                lines.next().unwrap(),
                "a_mm,b,mean,standard_error,quantile,mean_low,mean_high,observation_low,observation_high,\
                 extrapolates"
            );
            assert!(lines.next().unwrap().starts_with("0.4,0.3,"), "{text}");
        }
    }

    /// The noise of a new observation is the nugget, or the mean of the known variances.
    #[test]
    fn intervals_of_the_mean_and_of_a_new_observation() {
        let mut text = String::from("x,v,y\n");
        for i in 0..200 {
            let x = f64::from(i) / 199.0;
            let scatter = 0.1 * 2.0_f64.sqrt() * (12.9898 * f64::from(i)).sin();
            let v = if i % 2 == 0 { 0.004 } else { 0.016 };
            // Each point twice: merged observations have half the variance.
            for sign in [-1.0, 1.0] {
                text += &format!("{x},{v},{}\n", 5.0 + (3.0 * x).sin() + sign * scatter);
            }
        }
        let table = Table::parse("data.csv", &text).unwrap();
        for variance in [None, Some("v".to_owned())] {
            for scale in [Response::Plain, Response::Log] {
                let request = Request {
                    response: "y".to_owned(),
                    variance: variance.clone(),
                    inputs: Some(vec!["x".to_owned()]),
                    skip_missing: false,
                    nugget: None,
                    settings: Settings {
                        response: scale,
                        ..Settings::default()
                    },
                };
                let model = fit(&table, &request).unwrap().model;
                let at = Table::parse("at.csv", "x\n0.5\n").unwrap();
                let found = predict(&model, &at, 0.9, 0.95).unwrap();
                let PointPrediction {
                    mean,
                    standard_error,
                    mean_interval,
                    observation_interval,
                    ..
                } = found.rows[0];
                let half = |[low, high]: [f64; 2]| (high - low) / (2.0 * 1.959_964);
                assert!((half(mean_interval) / standard_error - 1.0).abs() < 0.01);
                assert!(mean_interval[0] < mean && mean < mean_interval[1]);
                let noise = half(observation_interval).powi(2) - standard_error.powi(2);
                assert!(
                    (noise.sqrt() / 0.1 - 1.0).abs() < 0.1,
                    "{scale:?} {variance:?}: {noise}"
                );
                let read =
                    ModelFile::from_json("m", &model.to_json().unwrap().to_string()).unwrap();
                assert_eq!(read.noise_variance, model.noise_variance);
            }
        }
    }

    #[test]
    fn a_model_file_predicts_what_its_model_did() {
        let model = model(Response::Log);
        let text = model.to_json().unwrap().to_string();
        let read = ModelFile::from_json("m.json", &text).unwrap();
        assert_eq!(read.inputs, model.inputs);
        assert_eq!(read.inputs[0].unit.as_deref(), Some("mm"));
        let at = Table::parse("at.csv", "a_mm,b\n0.21,0.77\n").unwrap();
        let predicted = |model| predict(model, &at, 0.5, 0.95).unwrap();
        assert_eq!(
            predicted(&read).rows[0].mean,
            predicted(&model).rows[0].mean
        );

        for (from, to, part) in [
            ("\"schema_version\":1", "\"schema_version\":9", "is 9, but"),
            ("\"name\":\"b\"", "\"name\":\"a_mm\"", "\"a_mm\" twice"),
            ("\"response\":{", "\"respond\":{", "is not a model file"),
            ("\"dimensions\":2", "\"dimensions\":3", "cannot be read"),
            (
                "\"dimensions\":2",
                "\"dimensions\":3,\"dimensions\":2",
                "duplicate field `dimensions`",
            ),
        ] {
            let broken = text.replacen(from, to, 1);
            assert_ne!(broken, text, "{from}");
            let error = ModelFile::from_json("m.json", &broken).unwrap_err();
            assert!(error.to_string().contains(part), "{error}");
        }
    }

    #[test]
    fn missing_and_unknown_columns_are_named() {
        let model = model(Response::Plain);
        let at = Table::parse("at.csv", "A_mm,b\n0.5,0.5\n").unwrap();
        let error = predict(&model, &at, 0.9, 0.95).unwrap_err().to_string();
        for part in [
            "at.csv",
            "no column a_mm",
            "are a_mm, b",
            "other columns are A_mm",
        ] {
            assert!(error.contains(part), "no {part:?} in {error}");
        }
        let at = Table::parse("at.csv", "a_mm,b\n0.5,?\n").unwrap();
        let error = predict(&model, &at, 0.9, 0.95).unwrap_err().to_string();
        assert!(error.contains("line 2, column \"b\""), "{error}");
        assert!(predict(&model, &at, 1.0, 0.95).is_err());
    }
}
