//! Folders for results. A command never overwrites results of another campaign or command.

use std::fs::File;
use std::io::{Error, ErrorKind, Read as _};
use std::path::Path;

use results::report;

use super::output::FileAccess;

/// Bytes of a marker that are read. The head of a report, which names its campaign, is shorter.
const MARKER_BYTES: u64 = 4096;

/// A folder that results are written to. It is checked before anything is computed.
#[derive(Clone, Copy)]
pub(super) struct OutputFolder<'a>(pub(super) &'a Path);

impl OutputFolder<'_> {
    /// Refuses a folder that is not empty.
    pub(super) fn require_new(self) -> Result<(), FileAccess> {
        match self.0.read_dir().map(|mut entries| entries.next()) {
            Ok(None) => Ok(()),
            Ok(Some(_)) => Err(self.refusal("it is not empty")),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
            Err(error) if error.kind() == ErrorKind::NotADirectory => {
                Err(self.refusal("it is a file"))
            }
            Err(source) => Err(FileAccess::new("read", self.0, source)),
        }
    }

    /// Refuses a folder with the report of another campaign. `lineages` are those of the own campaign, see
    /// [`problem::Campaign::lineage`]. Files besides the report are left alone.
    pub(super) fn require_own_report(self, lineages: &[String]) -> Result<(), FileAccess> {
        let check = |head: &str| match report::campaign_digest(head) {
            Some(digest) if lineages.iter().any(|own| own == digest) => Ok(()),
            Some(_) => Err(match report::campaign_name(head) {
                Some(name) => format!("it holds the report of another campaign, {name:?}"),
                None => "it holds the report of another campaign".to_owned(),
            }),
            None => Err(format!(
                "its {} is not a report of this program",
                report::FILE
            )),
        };
        self.require_own(report::FILE, check).map(drop)
    }

    /// Refuses a folder whose file `marker` belongs to other results. Returns whether the folder has the
    /// marker. `check` gets the beginning of the marker and returns an error that says what differs.
    pub(super) fn require_own(
        self,
        marker: &str,
        check: impl FnOnce(&str) -> Result<(), String>,
    ) -> Result<bool, FileAccess> {
        let path = self.0.join(marker);
        let cannot_read = |source| FileAccess::new("read", &path, source);
        let mut head = Vec::new();
        match File::open(&path) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(false),
            Err(error) if error.kind() == ErrorKind::NotADirectory => {
                return Err(self.refusal("it is a file"));
            }
            Err(source) => return Err(cannot_read(source)),
            Ok(file) => file.take(MARKER_BYTES).read_to_end(&mut head),
        }
        .map_err(cannot_read)?;
        check(&String::from_utf8_lossy(&head)).map_err(|what| self.refusal(&what))?;
        Ok(true)
    }

    fn refusal(self, what: &str) -> FileAccess {
        let what = format!("{what}: choose another folder with --out");
        FileAccess::new(
            "write to",
            self.0,
            Error::new(ErrorKind::AlreadyExists, what),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_with_files_is_not_new() {
        let folder = tempfile::tempdir().unwrap();
        let (new, empty, file) = (
            folder.path().join("new"),
            folder.path().join("empty"),
            folder.path().join("file"),
        );
        assert!(OutputFolder(&new).require_new().is_ok());
        std::fs::create_dir(&empty).unwrap();
        assert!(OutputFolder(&empty).require_new().is_ok());
        std::fs::write(&file, "kept").unwrap();
        for taken in [folder.path(), &file] {
            let error = OutputFolder(taken).require_new().unwrap_err();
            assert!(error.to_string().contains(&taken.display().to_string()));
            assert!(error.source.to_string().contains("--out"));
        }
    }

    #[test]
    fn a_report_is_replaced_only_by_one_of_its_own_campaign() {
        let folder = tempfile::tempdir().unwrap();
        let lineages = ["abc".to_owned(), "old".to_owned()];
        let path = folder.path().join("report");
        let out = OutputFolder(&path);
        assert!(out.require_own_report(&lineages).is_ok());
        std::fs::create_dir(&path).unwrap();
        std::fs::write(path.join("notes.txt"), "mine").unwrap();
        assert!(out.require_own_report(&lineages).is_ok());
        for (head, is_own) in [
            (r#"<meta name="campaign-digest" content="abc">"#, true),
            (r#"<meta name="campaign-digest" content="old">"#, true),
            (r#"<meta name="campaign-digest" content="def">"#, false),
            ("<html>", false),
        ] {
            std::fs::write(path.join(report::FILE), head).unwrap();
            assert_eq!(out.require_own_report(&lineages).is_ok(), is_own, "{head}");
        }
        let head =
            r#"<meta name="campaign-digest" content="def"><meta name="campaign" content="b">"#;
        std::fs::write(path.join(report::FILE), head).unwrap();
        let error = out.require_own_report(&lineages).unwrap_err();
        assert!(error.source.to_string().contains("campaign, \"b\""));
        let file = path.join("notes.txt");
        assert!(OutputFolder(&file).require_own_report(&lineages).is_err());
    }
}
