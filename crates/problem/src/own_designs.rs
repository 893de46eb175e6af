//! Designs of the user's own, which come first in the DoE, and what is known of them: `[doe] points` and `samples`, or
//! the rows of `[doe] table`.

use crate::file::{Doe, Source, TableRows};
use crate::formulation::Problem;
use crate::{Campaign, FileError};

/// The largest relative error of a bound or a discrete value that is taken for rounding.
const ROUNDING: f64 = 1e-9;

/// Why samples of one's own are refused.
const DRAWN: &str = "the samples follow from random numbers of the campaign, which those of another program do not have";

/// The check of a sample of one's own: what is wrong with it.
fn sample_fault(problem: &Problem, sample: &[f64]) -> Option<String> {
    if sample.iter().any(|value| !value.is_finite()) {
        return Some("a sample has finite numbers; one that failed is left out".to_owned());
    }
    let (name, why) = problem.check_sample(sample).err()?;
    Some(format!("{name} {why}"))
}

impl Problem {
    /// The samples that the campaign file has of a design. They are its first ones.
    #[must_use]
    pub fn own_samples(&self, design: u64) -> &[Vec<f64>] {
        let place = usize::try_from(design).ok();
        let samples = place.and_then(|place| self.campaign().doe.samples.get(place));
        samples.map_or(&[], Vec::as_slice)
    }
}

/// The section with the designs of its table, which has a column for each free variable and, if its rows are samples, for
/// each sampled response; other columns are not read. `file` names the table in errors.
pub(crate) fn of_table(problem: &Problem, file: &str, text: &str) -> Result<Doe, FileError> {
    let wrong = |line: u64, message: String| FileError::Syntax {
        file: file.to_owned(),
        line: usize::try_from(line).unwrap_or(usize::MAX),
        message,
    };
    let names = match problem.campaign().doe.table_rows {
        TableRows::Designs => &[],
        TableRows::Samples => problem.sampled(),
    };
    if !names.is_empty() && problem.campaign().has_scores() {
        return Err(wrong(
            1,
            format!("doe.table_rows must be \"designs\": {DRAWN}"),
        ));
    }
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let header = reader
        .headers()
        .map_err(|error| wrong(1, error.to_string()))?;
    let place = |name: &str| {
        let place = header.iter().position(|column| column == name);
        place.ok_or_else(|| {
            let sampled = names.iter().map(|one| &*one.name);
            let all: Vec<&str> = problem.free_names().chain(sampled).collect();
            let names = all.join(", ");
            wrong(
                1,
                format!("there is no column {name}; a table of designs has the columns {names}"),
            )
        })
    };
    let places = problem.free_names().map(|name| Ok((name, place(name)?)));
    let places = places.collect::<Result<Vec<_>, FileError>>()?;
    let responses = names.iter().map(|one| Ok((&*one.name, place(&one.name)?)));
    let responses = responses.collect::<Result<Vec<_>, FileError>>()?;
    let (mut points, mut samples) = (Vec::<Vec<f64>>::new(), Vec::<Vec<Vec<f64>>>::new());
    for record in reader.records() {
        let record = record.map_err(|error| {
            let line = error.position().map_or(1, csv::Position::line);
            wrong(line, error.to_string())
        })?;
        let line = record.position().map_or(1, csv::Position::line);
        let value = |&(name, place): &(&str, usize)| {
            let text = &record[place];
            let number = text.parse::<f64>();
            number.map_err(|_| wrong(line, format!("{name} is {text:?}, which is not a number")))
        };
        let point = places.iter().map(value).collect::<Result<Vec<f64>, _>>()?;
        let is_known = responses
            .iter()
            .any(|&(_, place)| !record[place].is_empty());
        let sample = match is_known {
            true => Some(
                responses
                    .iter()
                    .map(value)
                    .collect::<Result<Vec<f64>, _>>()?,
            ),
            false => None,
        };
        if let Some(why) = sample.as_ref().and_then(|one| sample_fault(problem, one)) {
            return Err(wrong(line, why));
        }
        // A further sample of a design stands in a row of its own.
        let twin = points.iter().position(|other| *other == point);
        if let (Some(twin), Some(sample)) = (twin, &sample) {
            samples[twin].push(sample.clone());
            continue;
        }
        let most = problem.campaign().doe.designs;
        if points.len() == most as usize {
            return Err(wrong(
                line,
                format!("there are more designs than doe.designs, which is {most}"),
            ));
        }
        if let Some((name, found, expected)) = fault(problem, &point, &points) {
            return Err(FileError::Value {
                file: file.to_owned(),
                line: usize::try_from(line).unwrap_or(usize::MAX),
                key: name,
                found,
                expected,
            });
        }
        points.push(point);
        samples.push(sample.into_iter().collect());
    }
    samples.truncate(
        samples
            .iter()
            .rposition(|known| !known.is_empty())
            .map_or(0, |last| last + 1),
    );
    Ok(Doe {
        points,
        samples,
        table: None,
        table_rows: TableRows::Designs,
        ..problem.campaign().doe
    })
}

/// Checks the designs that the campaign file itself has, and their samples.
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
    let samples = &campaign.doe.samples;
    if !samples.is_empty() && campaign.has_scores() {
        return Err(source.refuse("doe.samples", samples.len(), format!("absent: {DRAWN}")));
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

/// What is wrong with a design beside those `before` it: the variable, its value, and what would be right.
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
mod tests {
    use super::*;
    use crate::accuracy::CampaignFile;

    const TEXT: &str = include_str!("../../../campaigns/cantilever/campaign.toml");

    fn with(doe: &str) -> Result<CampaignFile, String> {
        let text = TEXT.replacen("[doe]\n", &format!("[doe]\n{doe}\n"), 1);
        CampaignFile::parse("beam.toml", &text).map_err(|error| error.to_string())
    }

    #[test]
    fn own_designs_are_read_from_the_file_or_a_table() {
        let own = with("points = [[2.0, 3.0], [1.5, 3.5]]").unwrap();
        let file = with("table = \"points.csv\"").unwrap();
        assert_eq!(file.campaign.doe.table.as_deref(), Some("points.csv"));
        let table = "thickness,area,width\n3, 6.0 ,2\n3.5,,1.5\n";
        let file = file.with_designs("points.csv", table).unwrap();
        assert_eq!(file.campaign, own.campaign);
        assert_eq!(
            CampaignFile::parse("again", &file.text).unwrap().campaign,
            own.campaign
        );
        assert_ne!(
            own.campaign.values_digest(),
            with("").unwrap().campaign.values_digest()
        );
    }

    #[test]
    fn samples_of_own_designs_are_read_from_the_file_or_a_table() {
        let own = "points = [[2.0, 3.0], [1.5, 3.5]]\nsamples = [[[0.1], [0.2]]]";
        let own = with(own).unwrap();
        let samples = "table = \"points.csv\"\ntable_rows = \"samples\"";
        let file = with(samples).unwrap();
        let table = "width,thickness,displacement\n2,3,0.1\n1.5,3.5,\n2,3,0.2\n";
        let file = file.with_designs("points.csv", table).unwrap();
        assert_eq!(file.campaign, own.campaign);
        let text = &file.text;
        assert_eq!(
            CampaignFile::parse("again", text).unwrap().campaign,
            own.campaign
        );
        let problem = Problem::new(own.campaign);
        assert_eq!(problem.own_samples(0), [[0.1], [0.2]]);
        assert!(problem.own_samples(1).is_empty());
    }

    #[test]
    fn what_is_wrong_with_a_sample_is_told_with_its_place() {
        for (samples, says) in [
            (
                "[[[0.1, 0.2]]]",
                "list 1: displacement is one of 1 sampled responses, and the sample has 2",
            ),
            ("[[[nan]]]", "list 1: a sample has finite numbers"),
            ("[[[inf]]]", "list 1: a sample has finite numbers"),
            ("[[], [[0.1]]]", "at most a list for each of doe.points, 1"),
        ] {
            let error = with(&format!("points = [[2.0, 3.0]]\nsamples = {samples}")).unwrap_err();
            assert!(
                error.contains(says) && error.contains("doe.samples"),
                "{error}"
            );
        }
        let table = |text: &str| {
            let samples = "table = \"points.csv\"\ntable_rows = \"samples\"";
            let file = with(samples).unwrap();
            file.with_designs("points.csv", text)
                .unwrap_err()
                .to_string()
        };
        let error = table("width,thickness,displacement\n2,3,0.1\n2,3,much\n");
        assert!(
            error.contains("points.csv, line 3: displacement is \"much\""),
            "{error}"
        );
        let error = table("width,thickness,displacement\n2,3,0.1\n2,3,\n");
        assert!(error.contains("designs that differ"), "{error}");
        let error = table("width,thickness\n2,3\n");
        assert!(error.contains("there is no column displacement; a table of designs has the columns width, thickness, displacement"), "{error}");
        let random = include_str!("../../../campaigns/bracket/campaign.toml");
        let own = "[doe]\npoints = [[20.0, 30.0]]\nsamples = [[[1.0, 2.0, 3.0]]]\n";
        let random = random.replacen("[doe]", own, 1);
        let error = CampaignFile::parse("b.toml", &random)
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("doe.samples is 1, but must be absent: the samples follow from"),
            "{error}"
        );
    }

    #[test]
    fn what_is_wrong_with_a_design_is_told_with_its_place() {
        for (points, says) in [
            ("[[2.0, 9.0]]", "row 1: thickness is 9.0"),
            ("[[2.0, 3.0], [2.0]]", "rows of 2 numbers: width, thickness"),
            ("[[2.0, 3.0], [2.0, 3.0]]", "designs that differ"),
        ] {
            let error = with(&format!("points = {points}")).unwrap_err();
            assert!(
                error.contains(says) && error.contains("doe.points"),
                "{error}"
            );
        }
        for (table, says) in [
            (
                "width\n2\n",
                "points.csv, line 1: there is no column thickness",
            ),
            (
                "width,thickness\n2,3\n2,thin\n",
                "points.csv, line 3: thickness is \"thin\"",
            ),
            (
                "width,thickness\n2,3\n2,nan\n",
                "points.csv, line 3: thickness is NaN, but must be a number from",
            ),
        ] {
            let file = with("table = \"points.csv\"").unwrap();
            let error = file
                .with_designs("points.csv", table)
                .unwrap_err()
                .to_string();
            assert!(error.contains(says), "{error}");
        }
        let many: String = (0..41)
            .map(|i| format!("{},2\n", 1.0 + 0.01 * f64::from(i)))
            .collect();
        let file = with("table = \"points.csv\"").unwrap();
        let error = file.with_designs("points.csv", &format!("width,thickness\n{many}"));
        let error = error.unwrap_err().to_string();
        assert!(
            error.contains("points.csv, line 42: there are more designs"),
            "{error}"
        );
        let both = with("points = [[2.0, 3.0]]\ntable = \"points.csv\"").unwrap_err();
        assert!(both.contains("doe.table"), "{both}");
    }
}
