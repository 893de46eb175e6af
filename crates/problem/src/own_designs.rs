//! Designs of the user's own, which come first in the DoE: `[doe] points`, or the rows of `[doe] table`.

use crate::file::Source;
use crate::formulation::Problem;
use crate::{Campaign, FileError};

/// The largest relative error of a bound or a discrete value that is taken for rounding.
const ROUNDING: f64 = 1e-9;

/// The designs of a table with a column for each free variable; other columns are not read. `file` names the table in
/// errors.
pub(crate) fn of_table(
    problem: &Problem,
    file: &str,
    text: &str,
) -> Result<Vec<Vec<f64>>, FileError> {
    let wrong = |line: u64, message: String| FileError::Syntax {
        file: file.to_owned(),
        line: usize::try_from(line).unwrap_or(usize::MAX),
        message,
    };
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let header = reader
        .headers()
        .map_err(|error| wrong(1, error.to_string()))?;
    let place = |name: &str| {
        let place = header.iter().position(|column| column == name);
        place.ok_or_else(|| {
            let names: Vec<&str> = problem.free_names().collect();
            let names = names.join(", ");
            wrong(
                1,
                format!("there is no column {name}; a table of designs has the columns {names}"),
            )
        })
    };
    let places = problem.free_names().map(|name| Ok((name, place(name)?)));
    let places = places.collect::<Result<Vec<_>, FileError>>()?;
    let mut points = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|error| {
            let line = error.position().map_or(1, csv::Position::line);
            wrong(line, error.to_string())
        })?;
        let line = record.position().map_or(1, csv::Position::line);
        let most = problem.campaign().doe.designs;
        if points.len() == most as usize {
            return Err(wrong(
                line,
                format!("there are more designs than doe.designs, which is {most}"),
            ));
        }
        let value = |&(name, place): &(&str, usize)| {
            let text = &record[place];
            let number = text.parse::<f64>();
            number.map_err(|_| wrong(line, format!("{name} is {text:?}, which is not a number")))
        };
        let point = places.iter().map(value).collect::<Result<Vec<f64>, _>>()?;
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
    }
    Ok(points)
}

/// Checks the designs that the campaign file itself has.
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
