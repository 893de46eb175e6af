use std::borrow::Cow;

use kriging::{Data, Guidance, Names, Nugget, Settings, Surrogate};

use crate::modelling::summary::{self, Origin, Summary};
use crate::modelling::table::{Content, UnusedColumn};
use crate::modelling::{Error, ModelFile, Quantity, Table, far};

/// The columns to fit, and the settings of the fit.
#[derive(Debug, Clone)]
pub struct Request {
    /// The column of observations.
    pub response: String,
    /// The column of the observations' noise variances, in units of the response squared; without one
    /// the known noise is zero.
    pub variance: Option<String>,
    /// The columns of the inputs. If none are named, all other columns with different numbers are inputs,
    /// unless they count the rows.
    pub inputs: Option<Vec<String>>,
    /// Whether rows in which a column of the model has no value are left out instead of refused.
    pub skip_missing: bool,
    /// Whether a nugget is estimated; by default if there is no column of noise variances.
    pub nugget: Option<Nugget>,
    /// Settings of the fit. The nugget's setting is replaced by the one above.
    pub settings: Settings,
}

/// A fitted model and its summary.
#[derive(Debug, Clone)]
pub struct Fit {
    pub model: ModelFile,
    /// The model's parameters and validation.
    pub summary: Summary,
}

/// The columns that a request chooses.
struct Columns {
    inputs: Vec<Quantity>,
    response: Quantity,
    unused: Vec<UnusedColumn>,
}

impl Columns {
    /// The names of the columns that the model is made from.
    fn names<'a>(&'a self, request: &'a Request) -> Vec<&'a str> {
        let inputs = self.inputs.iter().map(|input| input.name.as_str());
        let others = [Some(&request.response), request.variance.as_ref()];
        inputs
            .chain(others.into_iter().flatten().map(String::as_str))
            .collect()
    }
}

/// Fits a model to columns of a table and validates it by leaving out each observation in turn.
///
/// # Errors
///
/// A column is missing or holds something else than numbers, a noise variance is negative, the settings
/// contradict each other, or no model can be fitted.
pub fn fit(table: &Table, request: &Request) -> Result<Fit, Error> {
    let columns = choose(table, request)?;
    let nugget = request.nugget.unwrap_or(match request.variance {
        Some(_) => Nugget::Known,
        None => Nugget::Estimated,
    });
    let mut settings = request.settings.clone();
    settings.fit.nugget = nugget;

    let mut table = Cow::Borrowed(table);
    let mut skipped = Vec::new();
    if request.skip_missing {
        skipped = table.to_mut().skip_missing(&columns.names(request))?;
    }
    let table = &*table;
    let n = table.len();
    let d = columns.inputs.len();
    let mut x = vec![0.0; n * d];
    for (j, input) in columns.inputs.iter().enumerate() {
        for (i, value) in table.numbers(&input.name)?.into_iter().enumerate() {
            x[i * d + j] = value;
        }
    }
    let y = table.numbers(&request.response)?;
    let noise_variance = match &request.variance {
        Some(name) => variances(table, name)?,
        None => vec![0.0; n],
    };
    let data = Data {
        x: &x,
        d,
        y: &y,
        noise_variance: &noise_variance,
    };
    let mut far = Vec::new();
    for name in columns.names(request) {
        far.extend(far::warning(name, &table.numbers(name)?, |row| {
            table.line(row)
        }));
    }
    let (surrogate, of_fit) = guided(table, &columns, &settings, |guidance| {
        let surrogate = Surrogate::fit(&data, &settings).map_err(|error| Error::Fit {
            file: table.file().to_owned(),
            reason: guidance.error(&error).unwrap_or_else(|| error.to_string()),
        })?;
        let warnings = surrogate.warnings().iter();
        let warnings: Vec<String> = warnings.map(|w| guidance.warning(w)).collect();
        Ok::<_, Error>((surrogate, warnings))
    })?;
    let mut model = ModelFile::new(&columns.inputs, columns.response, surrogate);
    // The mean noise variance of all observations, before those of one point are merged.
    let of_one = |(v, y): (&f64, &f64)| match settings.response {
        kriging::Response::Plain => *v,
        kriging::Response::Log => v / (y * y),
    };
    let known = noise_variance.iter().zip(&y).map(of_one).sum::<f64>() / n as f64;
    model.noise_variance = model.surrogate.parameters().nugget + known;
    let origin = Origin {
        table,
        variance: request.variance.clone(),
        unused: columns.unused,
        skipped,
        warnings: far.into_iter().chain(of_fit).collect(),
    };
    let summary = summary::of(&model, &settings, origin);
    Ok(Fit { model, summary })
}

fn choose(table: &Table, request: &Request) -> Result<Columns, Error> {
    let is_taken = |name: &String| {
        *name == request.response || request.variance.as_ref().is_some_and(|v| v == name)
    };
    for name in [Some(&request.response), request.variance.as_ref()] {
        name.map_or(Ok(0), |name| table.position(name))?;
    }
    if request.variance.as_ref() == Some(&request.response) {
        return Err(Error::Settings(format!(
            "column {:?} cannot be both the response and its variance",
            request.response
        )));
    }
    let mut unused: Vec<UnusedColumn> = table.index().cloned().into_iter().collect();
    let mut leave_out = |column: &String, reason: String| {
        let column = column.clone();
        unused.push(UnusedColumn { column, reason });
    };
    let names = match &request.inputs {
        Some(names) => {
            for (number, name) in names.iter().enumerate() {
                table.position(name)?;
                if is_taken(name) || names[..number].contains(name) {
                    return Err(Error::Settings(format!(
                        "column {name:?} cannot be an input: it is named twice, or it is the response or \
                         its variance"
                    )));
                }
            }
            let other = |name: &&String| !is_taken(name) && !names.contains(name);
            for name in table.columns().iter().filter(other) {
                leave_out(name, "not among --inputs".to_owned());
            }
            names.clone()
        }
        None => {
            let mut names = Vec::new();
            let others = table.columns().iter().enumerate();
            for (position, name) in others.filter(|(_, name)| !is_taken(name)) {
                match reason_against(table, position) {
                    None => names.push(name.clone()),
                    Some(reason) => leave_out(name, reason),
                }
            }
            names
        }
    };
    if names.is_empty() {
        let unused = unused
            .iter()
            .map(|UnusedColumn { column, reason }| format!("; {column}: {reason}"));
        return Err(Error::Settings(format!(
            "{} has no inputs: it must have a column of differing numbers beside the response {:?}{}",
            table.file(),
            request.response,
            unused.collect::<String>()
        )));
    }
    let quantity = |name: &String| -> Result<Quantity, Error> {
        let unit = table.unit(table.position(name)?).map(str::to_owned);
        let named = Quantity::new(name);
        Ok(Quantity {
            unit: unit.or(named.unit),
            ..named
        })
    };
    Ok(Columns {
        inputs: names.iter().map(quantity).collect::<Result<_, _>>()?,
        response: quantity(&request.response)?,
        unused,
    })
}

/// Why a column that nobody named is not an input.
fn reason_against(table: &Table, position: usize) -> Option<String> {
    match table.content(position) {
        Content::Numbers if table.counts_rows(position) => {
            Some("it counts the rows; name it in --inputs to use it".to_owned())
        }
        Content::Numbers => None,
        Content::Constant(value) => Some(format!("constant, {value} in all rows")),
        Content::Text(cell, line) => Some(format!("text, such as {cell:?} in line {line}")),
        Content::Empty => Some("it has no values".to_owned()),
    }
}

fn variances(table: &Table, name: &str) -> Result<Vec<f64>, Error> {
    let values = table.numbers(name)?;
    match values.iter().position(|value| *value < 0.0) {
        None => Ok(values),
        Some(row) => {
            let message = format!("{} is negative, but a variance must not be", values[row]);
            let error = crate::modelling::InputError::in_file(table.file(), message);
            Err(error.at_line(table.line(row)).in_column(name).into())
        }
    }
}

/// Calls `with` with guidance in the names of the table and the options of `fit`.
fn guided<T>(
    table: &Table,
    columns: &Columns,
    settings: &Settings,
    with: impl FnOnce(&Guidance<'_>) -> T,
) -> T {
    let line = |observation: usize| table.line(observation);
    with(&Guidance {
        names: Names {
            coordinate: &|j| format!("column {:?}", columns.inputs[j].name),
            observation: &|i| format!("line {}", line(i)),
        },
        responses: "responses",
        unit: &columns.response.spaced_unit(),
        setting: &|key, value| match key {
            "response" => format!("--response-scale {value}"),
            key => format!("--{key} {value}"),
        },
        without: &|observations| {
            let lines = observations.iter().map(|&i| line(i).to_string());
            let lines: Vec<String> = lines.collect();
            Some(format!("a table without line {}", lines.join(", ")))
        },
        nugget: settings.fit.nugget,
        more_points: "more rows",
        less_noise: "less noisy observations",
    })
}

#[cfg(test)]
mod tests {
    use kriging::Method;

    use super::*;

    /// A table of y = 3 + sin 3a + b² with a little scatter. `row` may give a row another text.
    fn table(row: impl Fn(usize) -> Option<String>) -> Table {
        let mut text = String::from("name,a [mm],b,y_um\n");
        for i in 0..60 {
            let (a, b) = ((i % 10) as f64 / 9.0, (i as f64 * 0.618_034) % 1.0);
            let scatter = 0.02 * (12.9898 * i as f64).sin();
            let y = 3.0 + (3.0 * a).sin() + b * b + scatter;
            let plain = || format!("p{i},{a},{b},{y}");
            text += &(row(i).unwrap_or_else(plain) + "\n");
        }
        Table::parse("data.csv", &text).unwrap()
    }

    fn request() -> Request {
        Request {
            response: "y_um".to_owned(),
            variance: None,
            inputs: None,
            skip_missing: false,
            nugget: None,
            settings: Settings::default(),
        }
    }

    #[test]
    fn a_table_is_fitted_and_summarised() {
        let Fit { model, summary } = fit(&table(|_| None), &request()).unwrap();
        let [unused] = &summary.unused[..] else {
            panic!("{:?}", summary.unused);
        };
        assert_eq!(unused.column, "name");
        assert_eq!(unused.reason, "text, such as \"p0\" in line 2");
        assert_eq!(
            (summary.observations, summary.nugget_is_estimated),
            (60, true)
        );
        let inputs: Vec<&str> = summary.inputs.iter().map(|i| i.name.as_str()).collect();
        assert_eq!(inputs, ["a [mm]", "b"]);
        assert_eq!((summary.inputs[0].low, summary.inputs[0].high), (0.0, 1.0));
        assert!(
            summary.leave_one_out.q2 > 0.99,
            "{:?}",
            summary.leave_one_out
        );
        // The scatter's variance is 0.0002.
        assert!(
            (1e-4..4e-4).contains(&summary.nugget_variance),
            "{summary:?}"
        );
        let at = model.surrogate.mean(&[0.5, 0.5]);
        assert!((at - (3.25 + 1.5_f64.sin())).abs() < 0.03, "{at}");
        let text = summary::describe(&summary);
        for part in ["a [mm]", "estimated", "Q²", "95 %", "line ", "not used"] {
            assert!(text.contains(part), "no {part:?} in\n{text}");
        }
    }

    #[test]
    fn outliers_are_named_by_their_line() {
        let table = table(|i| (i == 30).then(|| "bad,0.11,0.55,40.0".to_owned()));
        let mut request = request();
        request.settings.method = Method::Exact;
        let found = fit(&table, &request).unwrap().summary;
        assert_eq!(found.leave_one_out.largest.line, 32, "{found:?}");
        let warning = found
            .warnings
            .iter()
            .find(|text| text.contains("line 32 lies"));
        let warning = warning.unwrap_or_else(|| panic!("{:?}", found.warnings));
        assert!(
            warning.contains("a table without line 32 fits"),
            "{warning}"
        );
    }

    #[test]
    fn what_cannot_be_fitted_is_refused_with_its_place() {
        let whole = table(|_| None);
        let with = |change: &dyn Fn(&mut Request)| {
            let mut request = request();
            change(&mut request);
            fit(&whole, &request).unwrap_err().to_string()
        };
        assert!(with(&|r| r.response = "z".to_owned()).contains("\"z\""));
        let text = with(&|r| r.inputs = Some(vec!["name".to_owned()]));
        assert!(text.contains("line 2, column \"name\": \"p0\""), "{text}");
        let text = with(&|r| r.inputs = Some(vec!["y_um".to_owned()]));
        assert!(text.contains("cannot be an input"), "{text}");

        let broken = table(|i| (i == 7).then(|| "p7,0.5,x,1".to_owned()));
        let text = fit(&broken, &request()).unwrap_err().to_string();
        assert!(text.contains("data.csv, line 9, column \"b\""), "{text}");
        let negative = table(|i| (i == 3).then(|| "p3,0.5,-0.1,1".to_owned()));
        let mut noisy = request();
        noisy.variance = Some("b".to_owned());
        let text = fit(&negative, &noisy).unwrap_err().to_string();
        assert!(
            text.contains("line 5, column \"b\": -0.1 is negative"),
            "{text}"
        );
        let mut logarithm = request();
        logarithm.settings.response = kriging::Response::Log;
        let below = table(|i| (i == 4).then(|| "p4,0.5,0.1,-1".to_owned()));
        let text = fit(&below, &logarithm).unwrap_err().to_string();
        assert!(
            text.contains("line 6 is -1 µm") && text.contains("--response-scale plain"),
            "{text}"
        );
    }
}
