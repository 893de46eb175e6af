//! The text of a table: its encoding, and its records by any delimiter.

use crate::modelling::InputError;

/// The delimiter of the fields of a record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Delimiter {
    Is(char),
    /// Any run of spaces and tabs.
    Blanks,
}

impl Delimiter {
    /// All delimiters, in the order of preference between equally good ones: a semicolon or a tab is preferred to a
    /// comma, which may be decimal.
    pub(super) const ALL: [Self; 5] = [
        Self::Is('\t'),
        Self::Is(';'),
        Self::Is('|'),
        Self::Is(','),
        Self::Blanks,
    ];

    /// The delimiter in words.
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Is('\t') => "tabs",
            Self::Is(';') => "semicolons",
            Self::Is('|') => "vertical bars",
            Self::Is(_) => "commas",
            Self::Blanks => "blanks",
        }
    }

    /// The fields of one line.
    pub(super) fn split(self, line: &str) -> Vec<String> {
        let mut records = Records::new(line, self);
        records.comments_allowed = false;
        records.next().map_or_else(Vec::new, |record| record.fields)
    }
}

/// A row of fields, and its line in the file, from 1.
#[derive(Debug, Clone)]
pub(super) struct Record {
    pub(super) line: u64,
    pub(super) fields: Vec<String>,
}

/// The text of a file's bytes, and its encoding where that is not UTF-8.
pub(super) fn decode(
    file: &str,
    bytes: &[u8],
) -> Result<(String, Option<&'static str>), InputError> {
    let wrong = |message: &str| Err(InputError::in_file(file, message));
    for (start, what) in [
        (&b"PK\x03\x04"[..], "a spreadsheet or another zip archive"),
        (b"\xd0\xcf\x11\xe0", "a spreadsheet of an old format"),
        (b"PAR1", "a Parquet file"),
        (b"\x1f\x8b", "a compressed file"),
    ] {
        if bytes.starts_with(start) {
            return wrong(&format!(
                "is {what}, but must be text: export the table as CSV"
            ));
        }
    }
    if let Some(rest) = bytes.strip_prefix(b"\xef\xbb\xbf") {
        return decode(file, rest);
    }
    if let Some(read) = utf_16(bytes) {
        let text = String::from_utf16(&read);
        return match text {
            Ok(text) => Ok((text, Some("UTF-16"))),
            Err(_) => wrong("is neither valid UTF-16 nor UTF-8: save it as UTF-8"),
        };
    }
    if bytes.contains(&0) {
        return wrong("has bytes of zero, but must be text: save the table as CSV in UTF-8");
    }
    match str::from_utf8(bytes) {
        Ok(text) => Ok((text.to_owned(), None)),
        // Bytes from 0x80 to 0x9f are control characters in Latin-1, and letters in many other code pages.
        Err(_) if bytes.iter().all(|byte| !(0x80..0xa0).contains(byte)) => {
            let text = bytes.iter().map(|&byte| char::from(byte)).collect();
            Ok((text, Some("Latin-1")))
        }
        Err(error) => {
            let before = &bytes[..error.valid_up_to()];
            let line = 1 + before.iter().filter(|byte| **byte == b'\n').count() as u64;
            let message = format!(
                "byte {:#04x} is neither UTF-8 nor Latin-1: save the table as UTF-8",
                bytes[error.valid_up_to()]
            );
            Err(InputError::in_file(file, message).at_line(line))
        }
    }
}

/// The units of a text in UTF-16: one with a byte order mark, or one of which every second byte is zero at
/// the start.
fn utf_16(bytes: &[u8]) -> Option<Vec<u16>> {
    let (big, rest) = match bytes {
        [0xff, 0xfe, rest @ ..] => (false, rest),
        [0xfe, 0xff, rest @ ..] => (true, rest),
        [a, 0, b, 0, ..] if *a != 0 && *b != 0 => (false, bytes),
        [0, a, 0, b, ..] if *a != 0 && *b != 0 => (true, bytes),
        _ => return None,
    };
    let unit = |pair: &[u8]| {
        let pair = [pair[0], *pair.get(1).unwrap_or(&0)];
        if big {
            u16::from_be_bytes(pair)
        } else {
            u16::from_le_bytes(pair)
        }
    };
    Some(rest.chunks(2).map(unit).collect())
}

/// The records of a text. Empty lines and comments are skipped. Fields in double quotes may hold
/// delimiters and line ends.
#[derive(Debug, Clone)]
pub(super) struct Records<'a> {
    rest: &'a str,
    line: u64,
    delimiter: Delimiter,
    comments_allowed: bool,
    /// The comments so far, without their marks, each with its line.
    pub(super) comments: Vec<(u64, String)>,
    /// The line of a quote that is not closed.
    pub(super) open_quote: Option<u64>,
}

impl<'a> Records<'a> {
    pub(super) const fn new(text: &'a str, delimiter: Delimiter) -> Self {
        Self {
            rest: text,
            line: 1,
            delimiter,
            comments_allowed: true,
            comments: Vec::new(),
            open_quote: None,
        }
    }

    /// Takes a line end, of any system, if one is next.
    fn end_of_line(&mut self) -> bool {
        for end in ["\r\n", "\n", "\r"] {
            if let Some(rest) = self.rest.strip_prefix(end) {
                self.rest = rest;
                self.line += 1;
                return true;
            }
        }
        false
    }

    /// Takes the text before the first character for which `is_end` holds.
    fn until(&mut self, is_end: impl Fn(char) -> bool) -> &'a str {
        let length = self.rest.find(is_end).unwrap_or(self.rest.len());
        let (taken, rest) = self.rest.split_at(length);
        self.rest = rest;
        taken
    }

    /// Skips blanks, apart from the delimiter.
    fn skip_blanks(&mut self) {
        let delimiter = self.delimiter;
        self.until(|c| !is_blank(c) || delimiter == Delimiter::Is(c));
    }

    /// Takes a field, which ends before a delimiter, a line end or the end of the text.
    fn field(&mut self) -> String {
        let mut field = String::new();
        if self.rest.starts_with('"') {
            let start = self.line;
            loop {
                self.rest = &self.rest[1..];
                let part = self.until(|c| c == '"');
                self.line += part.matches('\n').count() as u64;
                field += part;
                if self.rest.is_empty() {
                    self.open_quote.get_or_insert(start);
                    break;
                }
                self.rest = &self.rest[1..];
                if !self.rest.starts_with('"') {
                    break;
                }
                field.push('"');
            }
        }
        let delimiter = self.delimiter;
        field += self.until(|c| {
            is_line_end(c)
                || match delimiter {
                    Delimiter::Is(delimiter) => c == delimiter,
                    Delimiter::Blanks => is_blank(c),
                }
        });
        field.trim().to_owned()
    }
}

impl Iterator for Records<'_> {
    type Item = Record;

    fn next(&mut self) -> Option<Record> {
        loop {
            self.skip_blanks();
            if self.rest.is_empty() {
                return None;
            }
            if self.end_of_line() {
                continue;
            }
            match comment_mark(self.rest).filter(|_| self.comments_allowed) {
                Some(mark) => {
                    let text = &self.until(is_line_end)[mark..];
                    self.comments.push((self.line, text.trim().to_owned()));
                }
                None => break,
            }
        }
        let line = self.line;
        let mut fields = Vec::new();
        loop {
            self.skip_blanks();
            if self.delimiter == Delimiter::Blanks && self.rest.starts_with(is_line_end) {
                break;
            }
            fields.push(self.field());
            match self.delimiter {
                Delimiter::Is(delimiter) => match self.rest.strip_prefix(delimiter) {
                    Some(rest) => self.rest = rest,
                    None => break,
                },
                Delimiter::Blanks if self.rest.starts_with(is_blank) => {
                    self.skip_blanks();
                    if self.rest.is_empty() {
                        break;
                    }
                }
                Delimiter::Blanks => break,
            }
        }
        self.end_of_line();
        Some(Record { line, fields })
    }
}

fn is_blank(c: char) -> bool {
    c.is_whitespace() && !is_line_end(c)
}

const fn is_line_end(c: char) -> bool {
    matches!(c, '\n' | '\r')
}

/// The error values of spreadsheets, which begin like a comment.
const ERROR_VALUES: [&str; 9] = [
    "#n/a", "#nv", "#value!", "#wert!", "#div/0!", "#num!", "#ref!", "#name?", "#null!",
];

/// Whether a field is an error value of a spreadsheet.
pub(super) fn is_error_value(field: &str) -> bool {
    ERROR_VALUES.contains(&field.to_ascii_lowercase().as_str())
}

/// The length of the mark with which a comment starts.
fn comment_mark(line: &str) -> Option<usize> {
    let is_value = |value: &&str| {
        let start = line.get(..value.len());
        start.is_some_and(|start| start.eq_ignore_ascii_case(value))
    };
    if ERROR_VALUES.iter().any(is_value) {
        return None;
    }
    match line.as_bytes() {
        [b'/', b'/', ..] => Some(2),
        [mark @ (b'#' | b'%' | b'!'), rest @ ..] => {
            Some(1 + rest.iter().take_while(|byte| *byte == mark).count())
        }
        _ => None,
    }
}
