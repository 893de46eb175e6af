//! The paths of a store and of the files beside it.

use std::path::{Path, PathBuf};
use std::{fs, io};

use crate::Error;

/// The canonical path of a file, whatever symbolic links lead to it: SQLite derives the log's name
/// from it.
pub(crate) fn resolve(path: &Path) -> Result<PathBuf, Error> {
    let failed = |e| Error::io("find", path, e);
    if exists(path)? {
        return fs::canonicalize(path).map_err(failed);
    }
    if let Ok(target) = fs::read_link(path) {
        let target = path.with_file_name(target);
        let what = format!(
            "it is a symbolic link to {}, which does not exist: remove the link, or give the file itself",
            target.display()
        );
        return Err(failed(io::Error::new(io::ErrorKind::NotFound, what)));
    }
    let name = path.file_name().ok_or_else(|| {
        failed(io::Error::new(
            io::ErrorKind::InvalidInput,
            "the path has no file name: give the store's file, not a folder",
        ))
    })?;
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    Ok(fs::canonicalize(folder).map_err(failed)?.join(name))
}

pub(crate) fn exists(path: &Path) -> Result<bool, Error> {
    path.try_exists()
        .map_err(|e| Error::io("look for", path, e))
}

/// `path` with `suffix` appended to its name, as SQLite names its auxiliary files.
pub(crate) fn beside(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(suffix);
    PathBuf::from(name)
}
