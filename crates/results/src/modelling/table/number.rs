//! The numbers in the cells of a table.

use super::text::is_error_value;

/// Decimal and thousands separators of a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum Style {
    /// 1234.5
    #[default]
    Point,
    /// 1,234.5
    GroupedPoint,
    /// 1234,5
    Comma,
    /// 1.234,5
    GroupedComma,
}

impl Style {
    /// The difference from the usual style, in words.
    pub(super) const fn name(self) -> Option<&'static str> {
        match self {
            Self::Point => None,
            Self::GroupedPoint => Some("commas between thousands"),
            Self::Comma => Some("decimal commas"),
            Self::GroupedComma => Some("decimal commas, points between thousands"),
        }
    }

    /// The finite number that a cell holds.
    pub(super) fn number(self, cell: &str) -> Option<f64> {
        let mut text = cell.replace('\u{2212}', "-");
        let (decimal, group) = match self {
            Self::Point => ('.', None),
            Self::GroupedPoint => ('.', Some(',')),
            Self::Comma => (',', None),
            Self::GroupedComma => (',', Some('.')),
        };
        if let Some(group) = group
            && text.contains(group)
        {
            if !is_grouped(&text, group, decimal) {
                return None;
            }
            text = text.replace(group, "");
        }
        if decimal == ',' {
            if text.contains('.') {
                return None;
            }
            text = text.replace(',', ".");
        }
        // Fortran writes the exponent of a double with a D. `parse` knows words such as "inf", too.
        let is_number = |c: char| c.is_ascii_digit() || "+-.eEdD".contains(c);
        if !text.chars().all(is_number) {
            return None;
        }
        let value = text.replace(['d', 'D'], "e").parse().ok();
        value.filter(|value: &f64| value.is_finite())
    }
}

/// Whether a cell is a mark of a missing value.
pub(super) fn is_missing(cell: &str) -> bool {
    let words = [
        "",
        "na",
        "n/a",
        "nan",
        "-nan",
        "+nan",
        "null",
        "none",
        "nil",
        "missing",
        "-",
        "--",
        "?",
        ".",
        "1.#qnan",
        "-1.#ind",
        "1.#ind",
        "nan(ind)",
        "-nan(ind)",
    ];
    words.contains(&cell.to_ascii_lowercase().as_str()) || is_error_value(cell)
}

/// Whether the digits before `decimal` stand in groups of three.
fn is_grouped(text: &str, group: char, decimal: char) -> bool {
    let text = text.trim_start_matches(['+', '-']);
    let end = text.find([decimal, 'e', 'E']).unwrap_or(text.len());
    let mut groups = text[..end].split(group);
    let digits = |part: &str| part.bytes().all(|byte| byte.is_ascii_digit());
    let first = groups.next().unwrap_or_default();
    let is_first = matches!(first.len(), 1..=3) && digits(first) && !first.starts_with('0');
    is_first && groups.all(|part| part.len() == 3 && digits(part)) && !text[end..].contains(group)
}

/// The possible meanings of the separators in a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Shape {
    /// No separator.
    Whole,
    /// One style alone, by name.
    Only(Style),
    /// 1,234: a decimal comma, or a comma between thousands.
    Either,
}

fn shape(cell: &str) -> Option<Shape> {
    let fits = |style: Style| style.number(cell).is_some();
    if fits(Style::Point) {
        // A point between thousands is assumed only where a decimal comma shows it.
        let whole = !cell.contains('.');
        return Some(if whole {
            Shape::Whole
        } else {
            Shape::Only(Style::Point)
        });
    }
    match (fits(Style::Comma), fits(Style::GroupedPoint)) {
        (true, true) => Some(Shape::Either),
        (true, false) => Some(Shape::Only(Style::Comma)),
        (false, true) => Some(Shape::Only(Style::GroupedPoint)),
        (false, false) => fits(Style::GroupedComma).then_some(Shape::Only(Style::GroupedComma)),
    }
}

/// Two cells that contradict each other, or one that can be read in two ways, by their positions.
#[derive(Debug, Clone, Copy)]
pub(super) enum Conflict {
    /// A cell with a decimal point, and one with a decimal comma.
    Mixed([usize; 2]),
    /// 1,234, if no other cell shows the meaning of the comma.
    Unclear(usize),
}

/// The style of the cells that look like numbers. `commas_delimit`: commas separate the fields, so a comma within a
/// cell may separate decimals or thousands. Otherwise it is a decimal comma.
pub(super) fn style<'a>(
    cells: impl Iterator<Item = &'a str>,
    commas_delimit: bool,
) -> Result<Style, Conflict> {
    let mut seen: [Option<usize>; 4] = [None; 4];
    let mut either = None;
    for (position, cell) in cells.enumerate() {
        match shape(cell) {
            Some(Shape::Only(style)) => {
                seen[style as usize].get_or_insert(position);
            }
            Some(Shape::Either) => {
                either.get_or_insert(position);
            }
            Some(Shape::Whole) | None => {}
        }
    }
    let [point, grouped_point, comma, grouped_comma] = seen;
    let points = point.or(grouped_point);
    let commas = comma.or(grouped_comma);
    match (points, commas, either) {
        (Some(point), Some(comma), _) => Err(Conflict::Mixed([point, comma])),
        (_, Some(_), _) if grouped_comma.is_some() => Ok(Style::GroupedComma),
        (None, Some(_), _) => Ok(Style::Comma),
        (Some(_), None, _) if grouped_point.or(either).is_some() => Ok(Style::GroupedPoint),
        (Some(_), None, _) => Ok(Style::Point),
        (None, None, Some(cell)) if commas_delimit => Err(Conflict::Unclear(cell)),
        (None, None, Some(_)) => Ok(Style::Comma),
        (None, None, None) => Ok(Style::Point),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_in_the_style_of_their_table() {
        for (cells, commas_delimit, expected, numbers) in [
            (vec!["1.5", "2"], true, Style::Point, vec![1.5, 2.0]),
            (
                vec!["1.0D+01", "-2d-1"],
                true,
                Style::Point,
                vec![10.0, -0.2],
            ),
            (
                vec!["\u{2212}1.5", "+2."],
                true,
                Style::Point,
                vec![-1.5, 2.0],
            ),
            (vec!["0,5", "1,234"], false, Style::Comma, vec![0.5, 1.234]),
            (
                vec!["1,234", "0.5"],
                true,
                Style::GroupedPoint,
                vec![1234.0, 0.5],
            ),
            (
                vec!["1,234,567", "8"],
                true,
                Style::GroupedPoint,
                vec![1_234_567.0, 8.0],
            ),
            (
                vec!["1.234,5", "1,5e3"],
                false,
                Style::GroupedComma,
                vec![1234.5, 1500.0],
            ),
            (
                vec!["1,234", "5,678"],
                false,
                Style::Comma,
                vec![1.234, 5.678],
            ),
        ] {
            let found = style(cells.iter().copied(), commas_delimit).unwrap();
            assert_eq!(found, expected, "{cells:?}");
            let read: Vec<f64> = cells.iter().map(|c| found.number(c).unwrap()).collect();
            assert_eq!(read, numbers, "{cells:?}");
        }
        let mixed = style(["0.5", "0,5"].into_iter(), false);
        assert!(matches!(mixed, Err(Conflict::Mixed([0, 1]))), "{mixed:?}");
        let unclear = style(["7", "1,234"].into_iter(), true);
        assert!(matches!(unclear, Err(Conflict::Unclear(1))), "{unclear:?}");
    }

    #[test]
    fn words_and_infinities_are_no_numbers() {
        for cell in [
            "inf",
            "NaN",
            "1e400",
            "infinity",
            "0.5%",
            "1.2.3",
            "2024-01-02",
            "e5",
            "D",
        ] {
            assert_eq!(Style::Point.number(cell), None, "{cell}");
        }
        for cell in ["", "NA", "#N/A", "-", "nan", "NULL", "#DIV/0!"] {
            assert!(is_missing(cell), "{cell}");
        }
        assert!(!is_missing("inf") && !is_missing("steel") && !is_missing("0"));
    }
}
