//! The two kinds of files with a gear pair, and the error for one that is given in place of the other.

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::FileError;
use super::validate::Source;

/// The kinds of files with a gear pair.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum FileKind {
    Campaign,
    Pair,
}

impl FileKind {
    const fn in_words(self) -> &'static str {
        match self {
            Self::Campaign => "a campaign file, which has bounds for many designs",
            Self::Pair => "a pair file, which has the numbers of one gear pair",
        }
    }

    /// The remedy if a file of this kind is expected and another one is given.
    const fn remedy(self) -> &'static str {
        match self {
            Self::Campaign => {
                "Give a campaign file, which `coordinator init` writes; `coordinator simulate --pair` takes pair files"
            }
            Self::Pair => {
                "Give a pair file, which `coordinator export --pair` writes for an optimum; `coordinator check` \
                 and `coordinator run` take campaign files"
            }
        }
    }
}

impl Source<'_> {
    /// Like [`parse`](Self::parse); a file of another kind is refused as such instead of key by key.
    pub(super) fn parse_kind<T: DeserializeOwned + Serialize>(
        self,
        expected: FileKind,
    ) -> Result<T, FileError> {
        self.parse()
            .map_err(|error| self.of_other_kind(expected).unwrap_or(error))
    }

    /// The error for a file of another kind than `expected`, if its keys tell so: a campaign file has a format, a
    /// pair file lists two numbers of teeth.
    fn of_other_kind(self, expected: FileKind) -> Option<FileError> {
        let file = toml::from_str::<toml::Table>(self.text).ok()?;
        let pair = file.get("pair").and_then(toml::Value::as_table);
        let (key, found) = if file.contains_key("format") {
            ("format", FileKind::Campaign)
        } else if pair.is_some_and(|pair| pair.contains_key("teeth")) {
            ("pair.teeth", FileKind::Pair)
        } else {
            return None;
        };
        (found != expected).then(|| FileError::Syntax {
            file: self.file.to_owned(),
            line: self.line_of(key),
            message: format!(
                "{key} belongs to {}. {}",
                found.in_words(),
                expected.remedy()
            ),
        })
    }
}
