//! A new file that is written wholly or not at all.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// A file that did not exist before. It is removed again unless it is [kept](Self::keep). Its errors name it.
pub struct NewFile {
    out: BufWriter<File>,
    path: PathBuf,
    is_whole: bool,
}

/// Why there is no file.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {what} {}", path.display())]
struct Unwritten {
    what: &'static str,
    path: PathBuf,
    source: io::Error,
}

/// The error of a file, with the file's name.
fn named(what: &'static str, path: &Path, source: io::Error) -> io::Error {
    let path = path.to_owned();
    io::Error::new(source.kind(), Unwritten { what, path, source })
}

impl NewFile {
    /// Creates the file.
    ///
    /// # Errors
    ///
    /// It exists, or it cannot be created.
    pub fn create(path: &Path) -> io::Result<Self> {
        let file = File::create_new(path).map_err(|error| named("a new file", path, error))?;
        Ok(Self {
            out: BufWriter::new(file),
            path: path.to_owned(),
            is_whole: false,
        })
    }

    /// Ends the file and keeps it.
    ///
    /// # Errors
    ///
    /// Its end cannot be written; it is removed.
    pub fn keep(mut self) -> io::Result<()> {
        self.flush()?;
        self.is_whole = true;
        Ok(())
    }

    fn named<T>(&self, result: io::Result<T>) -> io::Result<T> {
        result.map_err(|error| named("the file", &self.path, error))
    }
}

impl Write for NewFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.out.write(bytes);
        self.named(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        let flushed = self.out.flush();
        self.named(flushed)
    }
}

impl Drop for NewFile {
    fn drop(&mut self) {
        if !self.is_whole {
            // The error that is reported says why there is no file.
            let _ = fs::remove_file(&self.path);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_whole_file_is_left() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        let mut part = NewFile::create(&path).unwrap();
        part.write_all(b"a part").unwrap();
        drop(part);
        assert!(!path.exists());
        let mut whole = NewFile::create(&path).unwrap();
        whole.write_all(b"all of it").unwrap();
        whole.keep().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"all of it");
        let Err(error) = NewFile::create(&path) else {
            panic!("a file is overwritten");
        };
        assert_eq!(error.kind(), io::ErrorKind::AlreadyExists);
        assert!(error.to_string().ends_with(&path.display().to_string()));
    }
}
