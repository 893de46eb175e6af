//! Output of results: standard output, new files, and folders without another campaign's results.

use std::fs::{File, OpenOptions};
use std::io::{self, ErrorKind, Read as _, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;
use terminal_size::{Width, terminal_size_of};

/// A file that cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[error("cannot {doing} {}", path.display())]
pub(super) struct FileAccess {
    pub(super) doing: &'static str,
    pub(super) path: PathBuf,
    pub(super) source: io::Error,
}

/// Standard output. A reader that has closed it is no error.
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
pub(super) fn print(text: &str) -> anyhow::Result<()> {
    let mut out = Stdout(io::stdout());
    out.write_all(text.as_bytes())?;
    Ok(out.flush()?)
}

/// Prints text and wraps lines longer than the terminal between words.
pub(super) fn print_text(text: &str) -> anyhow::Result<()> {
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
) -> anyhow::Result<()> {
    match json {
        true => print(&(serde_json::to_string(result)? + "\n")),
        false => print_text(&text()),
    }
}

/// Creates a file for writing. An existing file is refused.
pub(super) fn create_new(path: &Path) -> Result<File, FileAccess> {
    let file = OpenOptions::new().write(true).create_new(true).open(path);
    file.map_err(|source| cannot("write a new file", path, source))
}

/// Opens the target of `--out`: standard output for `-`, otherwise a new file.
pub(super) fn create(out: &Path) -> Result<Box<dyn Write + Send>, FileAccess> {
    Ok(if is_stdout(out) {
        Box::new(io::BufWriter::new(Stdout(io::stdout())))
    } else {
        Box::new(io::BufWriter::new(create_new(out)?))
    })
}

/// Writes a whole result to the target of `--out`.
pub(super) fn write(out: &Path, content: &[u8]) -> anyhow::Result<()> {
    let mut file = create(out)?;
    let written = file.write_all(content).and_then(|()| file.flush());
    Ok(written.map_err(|source| cannot("write", out, source))?)
}

/// Refuses a path that `--out` would overwrite: a file, or a folder that is not empty. Called
/// before anything is computed.
pub(super) fn refuse_taken(out: &Path) -> Result<(), FileAccess> {
    if is_stdout(out) || !out.exists() {
        return Ok(());
    }
    let is_empty = |mut entries: std::fs::ReadDir| entries.next().is_none();
    if out.is_dir() && std::fs::read_dir(out).is_ok_and(is_empty) {
        return Ok(());
    }
    let what = if out.is_dir() {
        "it is not empty: choose another folder with --out"
    } else {
        "it exists: choose another name with --out"
    };
    let source = io::Error::new(ErrorKind::AlreadyExists, what);
    Err(cannot("write to", out, source))
}

/// Refuses a report folder that is a file, or holds the report of a campaign whose digest is not in
/// `own`.
pub(super) fn refuse_report_of_another(out: &Path, own: &[String]) -> Result<(), FileAccess> {
    let report = out.join(results::reporting::FILE);
    if !out.is_dir() {
        return refuse_taken(out);
    }
    let mut head = Vec::new();
    match File::open(&report) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
        Err(source) => return Err(cannot("read", &report, source)),
        Ok(file) => file
            .take(4096)
            .read_to_end(&mut head)
            .map_err(|source| cannot("read", &report, source))?,
    };
    let head = String::from_utf8_lossy(&head);
    match results::report::campaign_digest(&head) {
        Some(digest) if own.iter().any(|own| own == digest) => Ok(()),
        _ => {
            let what = "it is the report of another campaign, or of an earlier version: choose another \
                        folder with --out";
            let source = io::Error::new(ErrorKind::AlreadyExists, what);
            Err(cannot("write to", &report, source))
        }
    }
}

fn is_stdout(out: &Path) -> bool {
    out.as_os_str() == "-"
}

fn cannot(doing: &'static str, path: &Path, source: io::Error) -> FileAccess {
    FileAccess {
        doing,
        path: path.to_owned(),
        source,
    }
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
    fn nothing_of_another_is_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        assert!(refuse_taken(&at("new")).is_ok() && refuse_taken(Path::new("-")).is_ok());
        std::fs::create_dir(at("empty")).unwrap();
        assert!(refuse_taken(&at("empty")).is_ok());
        std::fs::write(at("file"), "kept").unwrap();
        for taken in [folder.path().to_owned(), at("file")] {
            let error = refuse_taken(&taken).unwrap_err();
            assert!(error.to_string().contains(&taken.display().to_string()));
            assert!(error.source.to_string().contains("--out"));
        }
        assert!(write(&at("file"), b"lost").is_err());
        assert_eq!(std::fs::read(at("file")).unwrap(), b"kept");
    }

    #[test]
    fn a_report_gives_way_to_one_of_its_own_campaign_alone() {
        let folder = tempfile::tempdir().unwrap();
        let own = ["abc".to_owned(), "old".to_owned()];
        let out = folder.path().join("report");
        assert!(refuse_report_of_another(&out, &own).is_ok());
        std::fs::create_dir(&out).unwrap();
        assert!(refuse_report_of_another(&out, &own).is_ok());
        for (head, is_own) in [
            (r#"<meta name="campaign-digest" content="abc">"#, true),
            (r#"<meta name="campaign-digest" content="old">"#, true),
            (r#"<meta name="campaign-digest" content="def">"#, false),
            ("<html>", false),
        ] {
            std::fs::write(out.join("report.html"), head).unwrap();
            let refused = refuse_report_of_another(&out, &own);
            assert_eq!(refused.is_ok(), is_own, "{head}");
        }
        let file = folder.path().join("report/report.html");
        assert!(refuse_report_of_another(&file, &own).is_err(), "no folder");
    }
}
