//! Output of results to standard output and to new files.

use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};

use results::export::{self, Table};
use results::new_file::NewFile;
use results::table::Format;
use runner::exit::{self, HasExitCode};
use serde::Serialize;
use store::Store;
use terminal_size::{Width, terminal_size_of};

/// A file that cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[error("cannot {doing} {}", path.display())]
pub(super) struct FileAccess {
    doing: &'static str,
    path: PathBuf,
    pub(super) source: io::Error,
}

impl FileAccess {
    pub(super) fn new(doing: &'static str, path: &Path, source: io::Error) -> Self {
        Self {
            doing,
            path: path.to_owned(),
            source,
        }
    }
}

impl HasExitCode for FileAccess {
    fn exit_code(&self) -> u8 {
        exit::FILE_ACCESS
    }
}

/// Standard output, on which a closed pipe is not an error.
struct Stdout(io::Stdout);

impl Write for Stdout {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self.0.write(bytes) {
            Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(bytes.len()),
            written => written,
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self.0.flush() {
            Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
            flushed => flushed,
        }
    }
}

/// Prints to standard output.
pub(super) fn print(text: &str) -> io::Result<()> {
    write_stdout(text.as_bytes())
}

fn write_stdout(bytes: &[u8]) -> io::Result<()> {
    let mut out = Stdout(io::stdout());
    out.write_all(bytes)?;
    out.flush()
}

/// Prints text and wraps lines longer than the terminal between words.
pub(super) fn print_text(text: &str) -> io::Result<()> {
    match terminal_size_of(io::stdout()) {
        Some((Width(columns), _)) => print(&wrapped(text, usize::from(columns))),
        None => print(text),
    }
}

/// Wraps lines at `columns` where words allow it, and indents the continuations.
fn wrapped(text: &str, columns: usize) -> String {
    let options = textwrap::Options::new(columns)
        .subsequent_indent("    ")
        .break_words(false);
    text.split_inclusive('\n')
        .map(|line| match line.chars().count() > columns {
            true => textwrap::fill(line, &options),
            false => line.to_owned(),
        })
        .collect()
}

/// Prints a result as one line of JSON if `json` is set, otherwise as text.
pub(super) fn print_either(
    json: bool,
    result: &impl Serialize,
    text: impl FnOnce() -> String,
) -> io::Result<()> {
    match json {
        true => print(&(serde_json::to_string(result)? + "\n")),
        false => print_text(&text()),
    }
}

/// Writes a new file, wholly or not at all. An existing file is refused.
pub(super) fn write_new(path: &Path, content: &[u8]) -> io::Result<()> {
    let mut file = NewFile::create(path)?;
    file.write_all(content)?;
    file.keep()
}

/// Writes a whole result to the target of `--out`: standard output for `-`, otherwise a new file.
pub(super) fn write(out: &Path, content: &[u8]) -> io::Result<()> {
    if is_stdout(out) {
        write_stdout(content)
    } else {
        write_new(out, content)
    }
}

/// Writes a table of a store to the target of `--out`.
pub(super) async fn write_table(
    out: &Path,
    store: &Store,
    table: Table,
    format: Format,
) -> anyhow::Result<()> {
    if is_stdout(out) {
        let stdout = io::BufWriter::new(Stdout(io::stdout()));
        export::write(store, table, format, stdout).await
    } else {
        export::write_new(store, table, format, out).await
    }
}

/// Refuses a file that exists. Called before anything is computed.
pub(super) fn require_new_file(out: &Path) -> Result<(), FileAccess> {
    if is_stdout(out) || !out.exists() {
        return Ok(());
    }
    let what = "it exists: choose another name with --out";
    let source = io::Error::new(ErrorKind::AlreadyExists, what);
    Err(FileAccess::new("write to", out, source))
}

fn is_stdout(out: &Path) -> bool {
    out.as_os_str() == "-"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_lines_are_wrapped_between_words() {
        let text = "samples         75 of 120 designs are sampled\nshort\n\nunbreakable/path/to/some/report.html\n";
        let expected = "samples\n    75 of 120 designs\n    are sampled\nshort\n\nunbreakable/path/to/some/report.html\n";
        let narrow = wrapped(text, 22);
        let words = |text: &str| {
            text.split_whitespace()
                .map(str::to_owned)
                .collect::<Vec<_>>()
        };
        assert_eq!(words(&narrow), words(text));
        assert!(
            narrow
                .lines()
                .all(|line| line.len() <= 22 || line.starts_with("unbreakable")),
            "{narrow}"
        );
        assert_eq!(
            narrow.matches('\n').count(),
            expected.matches('\n').count(),
            "{narrow}"
        );
        assert_eq!(wrapped(text, 80), text);
    }

    #[test]
    fn an_existing_file_is_not_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        assert!(require_new_file(&file).is_ok() && require_new_file(Path::new("-")).is_ok());
        std::fs::write(&file, "kept").unwrap();
        let error = require_new_file(&file).unwrap_err();
        assert!(error.source.to_string().contains("--out"));
        assert!(write(&file, b"lost").is_err());
        assert_eq!(std::fs::read(&file).unwrap(), b"kept");
    }
}
