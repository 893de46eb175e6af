//! The output of a program: its lines, and the end of its standard error.

use std::collections::VecDeque;

use crate::outside;

/// Length of the end of the standard error that is kept, in bytes.
const TAIL: usize = 16 * 1024;
/// Maximum length of a quoted request or answer, in bytes.
const QUOTE: usize = 1000;

/// The meaning of a line of the output.
#[derive(Debug, PartialEq)]
pub(super) enum Line<T> {
    /// The answer, and whether it is alone in its line.
    Answer(T, bool),
    /// An attempt at an answer that cannot be read: the reason.
    Malformed(String),
    /// A message for people, or a former answer.
    Foreign,
    /// A blank line.
    Nothing,
}

/// Output that is not an answer.
#[derive(Debug, Default)]
pub(super) struct ForeignOutput {
    pub(super) lines: usize,
    pub(super) bytes: usize,
    /// The last of the lines, quoted.
    pub(super) last: String,
}

/// The end of the standard error of a process.
#[derive(Debug, Default)]
pub(super) struct Tail {
    pub(super) bytes: VecDeque<u8>,
    cut: bool,
}

impl ForeignOutput {
    /// The part of an error that describes the skipped lines.
    pub(super) fn note(&self) -> String {
        match self.lines {
            0 => String::new(),
            1 => format!(
                "; a line without the \"id\" of the request is not an answer and was skipped: {}",
                self.last
            ),
            lines => format!(
                "; {lines} lines without the \"id\" of the request are not answers and were skipped, the last of them: \
                 {}",
                self.last
            ),
        }
    }
}

impl Tail {
    pub(super) fn push(&mut self, bytes: &[u8]) {
        self.bytes.extend(bytes);
        if self.bytes.len() > TAIL {
            self.cut = true;
            self.bytes.drain(..self.bytes.len() - TAIL);
        }
    }

    pub(super) fn text(&self) -> String {
        let (front, back) = self.bytes.as_slices();
        let text = [front, back].concat();
        let text = outside::clean(&String::from_utf8_lossy(&text));
        if self.cut {
            format!("… {text}")
        } else {
            text
        }
    }
}

/// The part of an error message after "the simulator", for an answer that cannot be used.
pub(super) fn malformed(answer: &[u8], reason: &str) -> String {
    format!("gave a malformed answer ({reason}): {}", quote(answer))
}

/// Bytes of another program as a short text in one line.
pub(super) fn quote(bytes: &[u8]) -> String {
    let shown = &bytes[..bytes.len().min(QUOTE)];
    let text = outside::line(&String::from_utf8_lossy(shown));
    if shown.len() < bytes.len() {
        format!("{text} …")
    } else {
        text
    }
}
