//! The dialect of a table: delimiter, header and style of numbers.

use std::collections::HashSet;

use super::number::{self, Conflict, Style};
use super::text::{Delimiter, Record, Records, decode};
use super::{Table, UnusedColumn};
use crate::modelling::InputError;

/// Number of lines from which the delimiter is found.
const SAMPLE: usize = 200;

/// Characters of the longest unit: a longer text below the header is a cell that should be a number.
const LONGEST_UNIT: usize = 16;

pub(super) fn read(file: &str, bytes: &[u8]) -> Result<Table, InputError> {
    let wrong = |message: String| InputError::in_file(file, message);
    let (text, encoding) = decode(file, bytes)?;
    let text = text.trim_start_matches('\u{feff}');
    let (delimiter, body) = match declared_delimiter(text) {
        Some((delimiter, body)) => (delimiter, body),
        None => (delimiter(text), text),
    };
    let mut reader = Records::new(body, delimiter);
    let mut rows: Vec<Record> = reader.by_ref().collect();
    if let Some(line) = reader.open_quote {
        let message = "a quotation mark is opened, but not closed".to_owned();
        return Err(wrong(message).at_line(line));
    }
    if rows.is_empty() {
        let message = "is empty, but must have a header line and rows of numbers";
        return Err(wrong(message.to_owned()));
    }
    let comments = reader.comments;
    let style = style(file, &rows, delimiter)?;

    // Some programs write the names as a comment.
    let first = &rows[0];
    let names_line = comments.iter().rfind(|(line, text)| {
        *line < first.line && delimiter.split(text).len() == first.fields.len()
    });
    let mut format = Vec::new();
    let head = if !lacks_header(&rows, style) {
        rows.remove(0)
    } else if let Some((line, text)) = names_line {
        format.push(format!("names in the comment of line {line}"));
        Record {
            line: *line,
            fields: delimiter.split(text),
        }
    } else {
        let names: Vec<String> = (1..=first.fields.len()).map(|i| format!("c{i}")).collect();
        let message = format!(
            "has numbers where the columns' names must be: put a header line above it, such as {}",
            names.join(",")
        );
        return Err(wrong(message).at_line(first.line));
    };
    if rows.is_empty() {
        return Err(wrong("has a header, but no rows".to_owned()));
    }
    let mut table = Table {
        file: file.to_owned(),
        units: vec![None; head.fields.len()],
        header: head.fields,
        rows,
        style,
        format: Vec::new(),
        index: None,
    };
    fit_widths(&mut table, head.line, delimiter)?;
    drop_nameless(&mut table, head.line)?;
    if let Some(line) = take_units(&mut table) {
        format.push(format!("units in line {line}"));
    }
    if table.rows.is_empty() {
        return Err(wrong("has a header, but no rows".to_owned()));
    }
    if delimiter != Delimiter::Is(',') {
        format.insert(0, format!("{} between fields", delimiter.name()));
    }
    format.extend(style.name().map(str::to_owned));
    format.extend(encoding.map(str::to_owned));
    let skipped = comments.len() - usize::from(format.iter().any(|f| f.starts_with("names in")));
    match skipped {
        0 => {}
        1 => format.push("1 comment line".to_owned()),
        count => format.push(format!("{count} comment lines")),
    }
    table.format = format;
    Ok(table)
}

/// The delimiter that a spreadsheet declares in the first line, `sep=;`. The body begins with that line's end,
/// so that lines keep their numbers.
fn declared_delimiter(text: &str) -> Option<(Delimiter, &str)> {
    let end = text.find(['\n', '\r'])?;
    let declared = text[..end].trim_matches('"').strip_prefix("sep=")?;
    let known = Delimiter::ALL.into_iter();
    let mut known = known.filter(|known| match known {
        Delimiter::Is(c) => declared.chars().eq([*c]),
        Delimiter::Blanks => declared == " ",
    });
    Some((known.next()?, &text[end..]))
}

/// The delimiter by which most fields are numbers in rows as long as the first one. A first row may lack one
/// field, the name of an index.
fn delimiter(text: &str) -> Delimiter {
    let end = text.match_indices(['\n', '\r']).nth(SAMPLE);
    let sample = &text[..end.map_or(text.len(), |(position, _)| position)];
    let styles = [
        Style::Point,
        Style::Comma,
        Style::GroupedPoint,
        Style::GroupedComma,
    ];
    let numbers = |delimiter: Delimiter, fields: &[String]| {
        let is_number = |field: &&String| {
            let mut styles = styles.iter().filter(|style| {
                delimiter != Delimiter::Is(',')
                    || !field.contains(',')
                    || style.number(field).is_some()
            });
            styles.any(|style| style.number(field).is_some())
        };
        fields.iter().filter(is_number).count()
    };
    let score = |delimiter: Delimiter| {
        let mut records = Records::new(sample, delimiter);
        let width = records.next().map_or(0, |first| first.fields.len());
        let fits = |row: &Record| {
            let count = row.fields.len();
            count == width || (count == width + 1 && (width > 1 || delimiter == Delimiter::Blanks))
        };
        let rows = records.filter(fits);
        // A delimiter that splits nothing is worse than one that does.
        let numbers: usize = rows.map(|row| numbers(delimiter, &row.fields)).sum();
        (numbers, width > 1)
    };
    let mut best = (Delimiter::Is(','), score(Delimiter::Is(',')));
    for delimiter in Delimiter::ALL {
        let found = score(delimiter);
        if found > best.1 {
            best = (delimiter, found);
        }
    }
    best.0
}

/// The style of all numbers; a file with two is refused.
fn style(file: &str, rows: &[Record], delimiter: Delimiter) -> Result<Style, InputError> {
    let cells = rows
        .iter()
        .flat_map(|row| row.fields.iter().map(move |cell| (row.line, cell)));
    let place = |position: usize| {
        let (line, cell) = cells.clone().nth(position).expect("a position of a cell");
        (line, cell.clone())
    };
    let commas_delimit = delimiter == Delimiter::Is(',');
    number::style(cells.clone().map(|(_, cell)| cell.as_str()), commas_delimit).map_err(|conflict| {
        let (line, message) = match conflict {
            Conflict::Mixed([point, comma]) => {
                let ((line, point), (other, comma)) = (place(point), place(comma));
                let message = format!(
                    "{point:?} has a decimal point, but {comma:?} in line {other} has a decimal comma: write \
                     all numbers in one way"
                );
                (line, message)
            }
            Conflict::Unclear(cell) => {
                let (line, cell) = place(cell);
                let message = format!(
                    "{cell:?} is unclear, since its comma may be a decimal one or stand between thousands: \
                     write numbers with decimal points and without other marks"
                );
                (line, message)
            }
        };
        InputError::in_file(file, message).at_line(line)
    })
}

/// Whether the first row has a number in each column that has numbers below.
fn lacks_header(rows: &[Record], style: Style) -> bool {
    let first = &rows[0].fields;
    // Names such as 0, 1, 2 behind an index without a name are those of a data frame without names.
    let counts = first
        .iter()
        .skip(1)
        .zip(0..)
        .all(|(name, i)| *name == i.to_string());
    if first[0].is_empty() && counts {
        return false;
    }
    let is_number = |cell: &String| style.number(cell).is_some();
    let below = |column: usize| {
        let mut cells = rows[1..].iter().filter_map(|row| row.fields.get(column));
        rows.len() == 1 || cells.any(is_number)
    };
    let mut of_numbers = (0..first.len()).filter(|&column| below(column)).peekable();
    of_numbers.peek().is_some() && of_numbers.all(|column| is_number(&first[column]))
}

/// Makes header and rows equally long, or names the row that is not.
fn fit_widths(table: &mut Table, head_line: u64, delimiter: Delimiter) -> Result<(), InputError> {
    let width = table.header.len();
    let one_more = table.rows.iter().all(|row| row.fields.len() == width + 1);
    if one_more && table.rows.iter().all(|row| row.fields[width].is_empty()) {
        for row in &mut table.rows {
            row.fields.pop();
        }
    } else if one_more && delimiter != Delimiter::Is(',')
        || one_more && width > 1 && is_index(table)
    {
        // Names of rows, for which the header has no field.
        table.header.insert(0, String::new());
        table.units.push(None);
    }
    let width = table.header.len();
    let Some(row) = table.rows.iter().find(|row| row.fields.len() != width) else {
        return Ok(());
    };
    let commas = if delimiter == Delimiter::Is(',') && row.fields.len() == 2 * width {
        "; if its commas are decimal ones, separate the fields by semicolons"
    } else {
        ""
    };
    let message = format!(
        "has {} fields between {}, but must have {width}, as the header in line {head_line}{commas}",
        row.fields.len(),
        delimiter.name()
    );
    Err(InputError::in_file(&table.file, message).at_line(row.line))
}

/// Whether the first fields of the rows count them or are texts.
fn is_index(table: &Table) -> bool {
    let first = table
        .rows
        .iter()
        .map(|row| table.style.number(&row.fields[0]));
    let numbers: Vec<f64> = first.flatten().collect();
    numbers.is_empty()
        || numbers.len() == table.rows.len()
            && numbers.windows(2).all(|pair| pair[1] - pair[0] == 1.0)
}

/// Drops a first column without a name, and last ones without names and values; refuses other
/// nameless columns and names that are given twice.
fn drop_nameless(table: &mut Table, head_line: u64) -> Result<(), InputError> {
    let wrong = |message: String| InputError::in_file(&table.file, message).at_line(head_line);
    while table.header.len() > 1
        && table.header.last().is_some_and(String::is_empty)
        && table
            .rows
            .iter()
            .all(|row| row.fields.last().is_some_and(String::is_empty))
    {
        table.header.pop();
        table.units.pop();
        table.rows.iter_mut().for_each(|row| drop(row.fields.pop()));
    }
    let is_index = |name: &String| name.is_empty() || name == "Unnamed: 0";
    if table.header.len() > 1 && is_index(&table.header[0]) {
        table.header.remove(0);
        table.units.remove(0);
        table
            .rows
            .iter_mut()
            .for_each(|row| drop(row.fields.remove(0)));
        table.index = Some(UnusedColumn {
            column: "column 1".to_owned(),
            reason: "it has no name and is taken as an index of the rows".to_owned(),
        });
    }
    let shift = 1 + usize::from(table.index.is_some());
    let mut seen = HashSet::new();
    for (number, name) in table.header.iter().enumerate() {
        if name.is_empty() {
            let number = number + shift;
            return Err(wrong(format!(
                "column {number} has no name, but must have one in the header"
            )));
        }
        if !seen.insert(name) {
            let message = "is the name of two columns, but names must differ";
            return Err(wrong(message.to_owned()).in_column(name));
        }
    }
    Ok(())
}

/// Takes a row of units below the header, and returns its line: no cell is a number or a missing value, but the
/// cells below are numbers.
fn take_units(table: &mut Table) -> Option<u64> {
    let (first, rest) = table.rows.split_first()?;
    let style = table.style;
    let has_numbers = |column: usize| {
        let mut below = rest.iter().map(|row| &row.fields[column]);
        below.any(|cell| style.number(cell).is_some())
    };
    let columns: Vec<usize> = (0..first.fields.len())
        .filter(|&j| has_numbers(j))
        .collect();
    let is_unit =
        |cell: &str| style.number(cell).is_none() && (cell == "-" || !number::is_missing(cell));
    let mut cells = columns.iter().map(|&j| first.fields[j].as_str()).peekable();
    cells.peek()?;
    let mut texts = cells.filter(|cell| !cell.is_empty()).peekable();
    texts.peek()?;
    let all_units = texts
        .clone()
        .all(|cell| is_unit(cell) && cell.chars().count() <= LONGEST_UNIT)
        && texts.any(|cell| cell != "-");
    if !all_units || first.fields.iter().any(|cell| style.number(cell).is_some()) {
        return None;
    }
    let units = table.rows.remove(0);
    for &j in &columns {
        let unit = units.fields[j].trim_matches(['[', ']', '(', ')']).trim();
        table.units[j] = Some(unit.to_owned()).filter(|unit| !matches!(unit.as_str(), "" | "-"));
    }
    Some(units.line)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(text: &str) -> Table {
        Table::parse("t.csv", text).unwrap_or_else(|error| panic!("{error}\n{text}"))
    }

    #[test]
    fn one_table_is_read_however_it_is_written() {
        let utf_16 = |text: &str, mark: bool| -> Vec<u8> {
            let mark = mark.then_some(0xfeff);
            let units = mark.into_iter().chain(text.encode_utf16());
            units.flat_map(u16::to_le_bytes).collect()
        };
        let plain = "x,y\n0.5,-1.25\n2.0,1e-3\n";
        let texts: [(&[u8], &str); 21] = [
            (plain.as_bytes(), ""),
            (
                b"\xef\xbb\xbfx;y\r\n0,5;-1,25\r\n2,0;1e-3\r\n",
                "semicolons between fields, decimal commas",
            ),
            (b"x;y\n0.5;-1.25\n2.0;1e-3\n", "semicolons between fields"),
            (
                b"x\ty\n0,5\t-1,25\n2,0\t0,001\n",
                "tabs between fields, decimal commas",
            ),
            (b"x y\n0.5 -1.25\n2.0 1e-3\n", "blanks between fields"),
            (
                b"  x      y\n  0,5   -1,25\n  2,0  0,001  \n",
                "blanks between fields, decimal commas",
            ),
            (b"x|y\n0.5|-1.25\n2.0|1e-3", "vertical bars between fields"),
            (b"x,y\r0.5,-1.25\r2.0,1e-3\r", ""),
            (b"x,y,\n0.5,-1.25,\n2.0,1e-3,\n", ""),
            (b"x,y\n0.5,-1.25,\n2.0,1e-3,\n", ""),
            (b"x,y\n5.0D-01,-1.25d0\n2.0,1.0D-03\n", ""),
            (b"\"x\",\"y\"\n\"0.5\",\"-1.25\"\n\"2.0\",\"1e-3\"\n", ""),
            (
                b"\"x\",\"y\"\n\"0,5\",\"-1,25\"\n\"2,0\",\"0,001\"\n",
                "decimal commas",
            ),
            (
                b"sep=;\nx;y\n0.5;-1.25\n2.0;1e-3\n",
                "semicolons between fields",
            ),
            (
                b"# by a tool, v 2\nx,y\n0.5,-1.25\n# half\n2.0,1e-3\n",
                "2 comment lines",
            ),
            (
                b"# x y\n0.5 -1.25\n2.0 1e-3\n",
                "blanks between fields, names in the comment of line 1",
            ),
            (
                b"%x y\n0.5 -1.25\n2.0 1e-3\n",
                "blanks between fields, names in the comment of line 1",
            ),
            (b"x,y\n[mm],[N]\n0.5,-1.25\n2.0,1e-3\n", "units in line 2"),
            (b",x,y\n0,0.5,-1.25\n1,2.0,1e-3\n", ""),
            (
                b"\"x\" \"y\"\n\"1\" 0.5 -1.25\n\"2\" 2 0.001\n",
                "blanks between fields",
            ),
            (b"Unnamed: 0,x,y\n0,0.5,-1.25\n1,2.0,1e-3\n", ""),
        ];
        let wide = [utf_16(plain, true), utf_16(plain, false)];
        let wide = wide.iter().map(|bytes| (&bytes[..], "UTF-16"));
        for (bytes, format) in texts.into_iter().chain(wide) {
            let shown = String::from_utf8_lossy(bytes);
            let table = Table::parse("t.csv", bytes).unwrap_or_else(|e| panic!("{e}\n{shown}"));
            assert_eq!(table.columns(), ["x", "y"], "{shown}");
            assert_eq!(table.numbers("x").unwrap(), [0.5, 2.0], "{shown}");
            assert_eq!(table.numbers("y").unwrap(), [-1.25, 1e-3], "{shown}");
            assert_eq!(table.format().join(", "), format, "{shown}");
        }
    }

    #[test]
    fn what_else_a_table_holds_is_kept_apart() {
        let units = table("name,x,y\n,mm,(-)\na,1,2\nb,3,4\n");
        assert_eq!(
            [units.unit(0), units.unit(1), units.unit(2)],
            [None, Some("mm"), None]
        );
        assert_eq!(units.line(0), 3);
        let index = table(",x,y\na,1,2\nb,3,4\n");
        assert_eq!(index.index().unwrap().column, "column 1");
        let frame = table(",0,1\n0,0.1,0.2\n1,0.3,0.4\n");
        assert_eq!(frame.columns(), ["0", "1"]);
        let blanks_in_names = table("load [N],width of tooth\n1,2\n3,4\n");
        assert_eq!(blanks_in_names.columns(), ["load [N]", "width of tooth"]);
        let one = table("x\n0,5\n1,5\n");
        assert_eq!(one.numbers("x").unwrap(), [0.5, 1.5]);
        let errors = table("x,y\n1,2\n#N/A,3\n");
        let error = errors.numbers("x").unwrap_err().to_string();
        assert!(
            error.contains("line 3, column \"x\": \"#N/A\" stands for"),
            "{error}"
        );
        let latin = Table::parse("t.csv", b"temp\xe9rature,y\n1,2\n").unwrap();
        assert_eq!(
            (latin.columns()[0].as_str(), latin.format()),
            ("temp\u{e9}rature", &["Latin-1".to_owned()][..])
        );
        // A bad cell in the first row is not a unit.
        let bad = table("x\nthe first one is bad\n1\n");
        assert!(bad.numbers("x").unwrap_err().to_string().contains("line 2"));
    }

    #[test]
    fn what_can_be_read_in_two_ways_is_refused() {
        let cases: [(&[u8], &[&str]); 9] = [
            (
                b"0.0,1.0\n0.5,2.0\n",
                &["line 1", "has numbers where", "header line", "c1,c2"],
            ),
            (b"steel,0.0\niron,0.5\n", &["line 1", "header line"]),
            (
                b"x;y\n0.5;1\n0,7;2\n",
                &["line 2", "\"0.5\"", "\"0,7\" in line 3", "one way"],
            ),
            (
                b"x,y\n\"1,234\",2\n",
                &["line 2", "\"1,234\" is unclear", "thousands"],
            ),
            (
                b"x,y\n0,5,1,5\n1,0,2,5\n",
                &["line 2", "4 fields between commas", "by semicolons"],
            ),
            (b"x,y\n\"1,2\n", &["line 2", "quotation mark"]),
            (b"PK\x03\x04\x14", &["spreadsheet", "as CSV"]),
            (b"x,\x85y\n1,2\n", &["line 1", "0x85", "UTF-8"]),
            (b"a,,b\n1,2,3\n", &["column 2 has no name"]),
        ];
        for (bytes, parts) in cases {
            let error = Table::parse("t.csv", bytes).unwrap_err().to_string();
            for part in parts {
                assert!(error.contains(part), "no {part:?} in {error}");
            }
        }
    }

    #[test]
    fn rows_without_a_value_are_skipped_with_their_lines() {
        let mut table = table("x,y,z\n1,2,\n3,NA,\n,4,\n5,6,\n");
        let skipped = table.skip_missing(&["x", "y"]).unwrap();
        let skipped: Vec<(&str, &[u64])> = skipped
            .iter()
            .map(|s| (s.column.as_str(), &s.lines[..]))
            .collect();
        assert_eq!(skipped, [("x", &[4][..]), ("y", &[3])]);
        assert_eq!(table.numbers("y").unwrap(), [2.0, 6.0]);
        assert_eq!((table.line(0), table.line(1)), (2, 5));
        assert!(
            table
                .skip_missing(&["z"])
                .unwrap_err()
                .to_string()
                .contains("no row")
        );
    }
}
