//! The user's own designs, which come first in the DoE, with their known responses and samples: `[doe] points`,
//! `responses` and `samples`, or the rows of `[doe] table`.

use crate::file::{Doe, Source, TableRows};
use crate::formulation::{Design, Problem, Quantity};
use crate::{Campaign, FileError};

/// Largest relative deviation from a bound or a discrete value that counts as rounding.
const ROUNDING: f64 = 1e-9;

/// The reason why the user's own samples are refused.
const DRAWN: &str =
    "the campaign itself draws the random numbers of each sample, so known samples cannot be used";
/// The reason why the user's own responses are refused.
const COMPUTED: &str = "the built-in model computes the responses itself";

/// The fault of one of the user's own samples; `None` if there is none.
fn sample_fault(problem: &Problem, sample: &[f64]) -> Option<String> {
    if sample.iter().any(|value| !value.is_finite()) {
        return Some("a sample has finite numbers; one that failed is left out".to_owned());
    }
    let (name, why) = problem.check_sample(sample).err()?;
    Some(format!("{name} {why}"))
}

impl Problem {
    /// The samples that the campaign file gives for a design. They replace the design's first samples.
    #[must_use]
    pub fn own_samples(&self, design: u64) -> &[Vec<f64>] {
        own(&self.campaign().doe.samples, design)
    }

    /// The deterministic responses that the campaign file gives for a design.
    #[must_use]
    pub fn own_responses(&self, design: u64) -> Option<&[f64]> {
        let known = own(&self.campaign().doe.responses, design);
        (!known.is_empty()).then_some(known)
    }
}

/// The entry of a design in this list of the campaign file; empty beyond the end of the list.
fn own<T>(known: &[Vec<T>], design: u64) -> &[T] {
    let place = usize::try_from(design).ok();
    let known = place.and_then(|place| known.get(place));
    known.map_or(&[], Vec::as_slice)
}

/// The names and places of columns.
type Columns<'a> = Vec<(&'a str, usize)>;

/// The columns of a table of designs.
struct Header<'a> {
    variables: Columns<'a>,
    responses: Columns<'a>,
    sampled: Columns<'a>,
    /// Variables that the campaign fixes, with their places among all variables.
    fixed: Vec<(&'a str, usize, usize)>,
}

impl<'a> Header<'a> {
    /// The columns for this problem. The error is their fault.
    fn of(problem: &'a Problem, columns: &csv::StringRecord) -> Result<Self, String> {
        let campaign = problem.campaign();
        let rows = campaign.doe.table_rows;
        let why = match rows {
            TableRows::Samples if campaign.has_scores() => Some(DRAWN),
            TableRows::Responses if !campaign.is_external() => Some(COMPUTED),
            TableRows::Responses if problem.responses().is_empty() => {
                Some("the campaign has no deterministic responses")
            }
            _ => None,
        };
        if let Some(why) = why {
            return Err(format!("doe.table_rows must be \"designs\": {why}"));
        }
        let variables: Vec<&str> = problem.free_names().collect();
        let names = |all: &'a [Quantity]| all.iter().map(|one| &*one.name).collect::<Vec<&str>>();
        let sampled = match rows {
            TableRows::Samples => names(problem.sampled()),
            _ => Vec::new(),
        };
        let place = |name: &str| columns.iter().position(|column| column == name);
        let twice = |name: &str| columns.iter().filter(|column| *column == name).count() > 1;
        let responses = match rows {
            TableRows::Responses => names(problem.responses()),
            // A baseline has the name of a sampled response.
            TableRows::Samples if !problem.has_baseline() => names(problem.responses()),
            _ => Vec::new(),
        };
        let are_optional = rows == TableRows::Samples;
        let responses = match are_optional && responses.iter().any(|name| place(name).is_none()) {
            true => Vec::new(),
            false => responses,
        };
        let all = [&*variables, &responses, &sampled].concat().join(", ");
        let found: Vec<&str> = columns.iter().collect();
        let found = found.join(",");
        let placed = |names: Vec<&'a str>| {
            let placed = names.into_iter().map(|name| {
                if twice(name) {
                    return Err(format!("{name} is the name of two columns"));
                }
                let place = place(name).ok_or_else(|| {
                    format!(
                        "there is no column {name} in the header {found:?}; a table of designs has the columns {all}, \
                         separated by commas"
                    )
                })?;
                Ok((name, place))
            });
            placed.collect::<Result<Columns<'a>, String>>()
        };
        let is_fixed = |name: &str| problem.gears().is_none() && !variables.contains(&name);
        let all = (0..).zip(problem.variables());
        let fixed = all.filter(|(_, one)| is_fixed(&one.name));
        let fixed = fixed.filter_map(|(which, one)| Some((&*one.name, place(&one.name)?, which)));
        Ok(Self {
            fixed: fixed.collect(),
            variables: placed(variables)?,
            responses: placed(responses)?,
            sampled: placed(sampled)?,
        })
    }
}

/// The numbers of a row in these columns. The error is the fault of one.
fn numbers(record: &csv::StringRecord, columns: &Columns<'_>) -> Result<Vec<f64>, String> {
    let number = |&(name, place): &(&str, usize)| {
        let text = &record[place];
        let number = text.parse::<f64>();
        number.map_err(|_| format!("{name} is {text:?}, which is not a number"))
    };
    columns.iter().map(number).collect()
}

/// The fault of a row that was measured at another value of a variable than that of its design; `None` if there is
/// none.
fn elsewhere(record: &csv::StringRecord, header: &Header<'_>, design: &Design) -> Option<String> {
    header.fixed.iter().find_map(|&(name, place, which)| {
        let (text, value) = (&record[place], design.values()[which]);
        let is_same = |given: f64| (given - value).abs() <= ROUNDING * value.abs();
        (!text.parse().is_ok_and(is_same)).then(|| {
            format!("{name} is {text}, but the campaign has the one value {value:?} for it")
        })
    })
}

/// The numbers of a row in these columns; none if all are empty.
fn known(record: &csv::StringRecord, columns: &Columns<'_>) -> Result<Option<Vec<f64>>, String> {
    let is_known = columns.iter().any(|&(_, place)| !record[place].is_empty());
    is_known.then(|| numbers(record, columns)).transpose()
}

/// The section with the designs of its table. The table has a column for each free variable and for each known
/// quantity; a column of a fixed variable must have its value, and other columns are not read. `file` names the table in
/// errors.
pub(crate) fn of_table(problem: &Problem, file: &str, text: &str) -> Result<Doe, FileError> {
    let wrong = |line: u64, message: String| FileError::Syntax {
        file: file.to_owned(),
        line: usize::try_from(line).unwrap_or(usize::MAX),
        message,
    };
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let columns = reader
        .headers()
        .map_err(|error| wrong(1, error.to_string()))?;
    let header = Header::of(problem, columns).map_err(|why| wrong(1, why))?;
    let mut doe = Doe {
        points: Vec::new(),
        samples: Vec::new(),
        responses: Vec::new(),
        table: None,
        table_rows: TableRows::Designs,
        ..problem.campaign().doe
    };
    for record in reader.records() {
        let record = record.map_err(|error| {
            let line = error.position().map_or(1, csv::Position::line);
            wrong(line, error.to_string())
        })?;
        let line = record.position().map_or(1, csv::Position::line);
        let wrong = |message: String| wrong(line, message);
        let point = numbers(&record, &header.variables).map_err(wrong)?;
        let design = problem.design(&point, problem.base());
        if let Some(why) = elsewhere(&record, &header, &design) {
            return Err(wrong(why));
        }
        let sample = known(&record, &header.sampled).map_err(wrong)?;
        if let Some(why) = sample.as_ref().and_then(|one| sample_fault(problem, one)) {
            return Err(wrong(why));
        }
        let responses = known(&record, &header.responses).map_err(wrong)?;
        if let Some(responses) = &responses {
            problem.check_responses(responses).map_err(wrong)?;
        }
        let responses = responses.unwrap_or_default();
        // A row with the variables of an earlier row is a further sample of the same design.
        let twin = doe.points.iter().position(|other| *other == point);
        if let (Some(twin), Some(sample)) = (twin, &sample) {
            if doe.responses[twin] != responses {
                let names = header.responses.iter().map(|(name, _)| *name);
                let names = names.collect::<Vec<&str>>().join(", ");
                let message = format!("{names} must be the same in all rows of a design");
                return Err(wrong(message));
            }
            doe.samples[twin].push(sample.clone());
            continue;
        }
        let most = doe.designs;
        if doe.points.len() == most as usize {
            let message = format!("there are more designs than doe.designs, which is {most}");
            return Err(wrong(message));
        }
        if let Some((name, found, expected)) = fault(problem, &point, &doe.points) {
            return Err(FileError::Value {
                file: file.to_owned(),
                line: usize::try_from(line).unwrap_or(usize::MAX),
                key: name,
                found,
                expected,
            });
        }
        doe.points.push(point);
        doe.samples.push(sample.into_iter().collect());
        doe.responses.push(responses);
    }
    forget_empty_ends(&mut doe.samples);
    forget_empty_ends(&mut doe.responses);
    Ok(doe)
}

/// Removes the empty lists at the end.
fn forget_empty_ends<T>(lists: &mut Vec<Vec<T>>) {
    let last = lists.iter().rposition(|list| !list.is_empty());
    lists.truncate(last.map_or(0, |last| last + 1));
}

/// Checks the designs that the campaign file itself lists, and their samples.
pub(crate) fn check(campaign: &Campaign, source: Source<'_>) -> Result<(), FileError> {
    let points = &campaign.doe.points;
    if points.is_empty() {
        return Ok(());
    }
    let problem = Problem::new(campaign.clone());
    for (index, point) in points.iter().enumerate() {
        if let Some((name, found, expected)) = fault(&problem, point, &points[..index]) {
            let expected = format!("{expected} (row {}: {name} is {found})", index + 1);
            return Err(source.refuse("doe.points", point, expected));
        }
    }
    let (samples, responses) = (&campaign.doe.samples, &campaign.doe.responses);
    if !samples.is_empty() && campaign.has_scores() {
        return Err(source.refuse("doe.samples", samples.len(), format!("absent: {DRAWN}")));
    }
    if !responses.is_empty() && !campaign.is_external() {
        let expected = format!("absent: {COMPUTED}");
        return Err(source.refuse("doe.responses", responses.len(), expected));
    }
    for (index, of) in responses.iter().enumerate() {
        if of.is_empty() {
            continue;
        }
        if let Err(why) = problem.check_responses(of) {
            let expected = format!("the responses of the design (list {}: {why})", index + 1);
            return Err(source.refuse("doe.responses", of, expected));
        }
    }
    for (index, sample) in samples
        .iter()
        .enumerate()
        .flat_map(|(i, all)| all.iter().map(move |one| (i, one)))
    {
        if let Some(why) = sample_fault(&problem, sample) {
            let expected = format!("a sample of the design (list {}: {why})", index + 1);
            return Err(source.refuse("doe.samples", sample, expected));
        }
    }
    Ok(())
}

/// The fault of a design, given those `before` it: the variable, its value, and the valid values.
fn fault(
    problem: &Problem,
    point: &[f64],
    before: &[Vec<f64>],
) -> Option<(String, String, String)> {
    let names: Vec<&str> = problem.free_names().collect();
    if point.len() != names.len() {
        let expected = format!("rows of {} numbers: {}", names.len(), names.join(", "));
        return Some((
            "the row".to_owned(),
            format!("of {} numbers", point.len()),
            expected,
        ));
    }
    let ranges = problem.free_ranges().zip(problem.coordinates());
    for ((name, value), ([low, high], coordinate)) in names.iter().zip(point).zip(ranges) {
        let near = ROUNDING * (high - low);
        let is_possible = match &coordinate.values[..] {
            [] => (low - near..=high + near).contains(value),
            values => values.iter().any(|one| (one - value).abs() <= near),
        };
        if !is_possible {
            let expected = match &coordinate.values[..] {
                [] => format!("a number from {low:?} to {high:?}"),
                values => format!("one of the values {values:?}"),
            };
            return Some(((*name).to_owned(), format!("{value:?}"), expected));
        }
    }
    let twin = before.iter().position(|other| other == point)?;
    let expected = "designs that differ".to_owned();
    Some((
        "the row".to_owned(),
        format!("that of design {twin} again"),
        expected,
    ))
}

#[cfg(test)]
mod tests;
