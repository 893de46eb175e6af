//! The digest of the sources of a program.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use sha2::{Digest as _, Sha256};

/// The source files and folders at the top of the workspace. `templates`, `page` and `campaigns` are
/// embedded in the programs.
const OF_WORKSPACE: [&str; 5] = [
    "Cargo.toml",
    "Cargo.lock",
    "campaigns",
    "migrations",
    "proto",
];
/// The source files and folders of each crate.
const OF_CRATE: [&str; 5] = ["Cargo.toml", "build.rs", "src", "templates", "page"];

/// The source files and folders of a workspace.
pub(crate) fn roots(workspace: &Path) -> io::Result<Vec<PathBuf>> {
    let mut roots: Vec<PathBuf> = OF_WORKSPACE.map(|name| workspace.join(name)).into();
    for entry in fs::read_dir(workspace.join("crates"))? {
        let folder = entry?.path();
        roots.extend(OF_CRATE.map(|name| folder.join(name)));
    }
    roots.retain(|root| root.exists());
    Ok(roots)
}

/// The first 48 bits, in hex, of the SHA-256 over the names, relative to the workspace, and the
/// contents of all files, ordered by name. Hidden files, such as those of editors, are left out.
pub(crate) fn digest(workspace: &Path) -> io::Result<String> {
    let mut files = Vec::new();
    for root in roots(workspace)? {
        collect(workspace, &root, &mut files)?;
    }
    files.sort();
    let mut hash = Sha256::new();
    for (name, path) in files {
        let content = fs::read(path)?;
        hash.update((name.len() as u64).to_le_bytes());
        hash.update(name);
        hash.update((content.len() as u64).to_le_bytes());
        hash.update(content);
    }
    Ok(hex::encode(&hash.finalize()[..6]))
}

/// Collects the files at and below `path`, each with a name that is the same on every system.
fn collect(workspace: &Path, path: &Path, files: &mut Vec<(String, PathBuf)>) -> io::Result<()> {
    let is_hidden = |path: &Path| {
        let name = path.file_name().and_then(|name| name.to_str());
        name.is_some_and(|name| name.starts_with('.'))
    };
    if path.is_dir() {
        for entry in fs::read_dir(path)? {
            let path = entry?.path();
            if !is_hidden(&path) {
                collect(workspace, &path, files)?;
            }
        }
        return Ok(());
    }
    let name = path.strip_prefix(workspace).unwrap_or(path);
    let parts = name
        .components()
        .map(|part| part.as_os_str().to_string_lossy());
    files.push((parts.collect::<Vec<_>>().join("/"), path.to_owned()));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn workspace() -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for (name, content) in [
            ("Cargo.toml", "[workspace]"),
            ("Cargo.lock", "# locked"),
            ("README.md", "# read me"),
            ("proto/v1/wire.proto", "message A {}"),
            ("migrations/0001.sql", "CREATE TABLE a (b)"),
            ("crates/one/Cargo.toml", "[package]"),
            ("crates/one/src/lib.rs", "fn a() {}"),
            ("crates/one/src/deep/er.rs", "fn b() {}"),
            ("crates/one/tests/it/main.rs", "fn test() {}"),
            ("crates/two/src/lib.rs", "fn c() {}"),
        ] {
            write(folder.path(), name, content);
        }
        folder
    }

    fn write(folder: &Path, name: &str, content: &str) {
        let path = folder.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, content).unwrap();
    }

    #[test]
    fn the_digest_does_not_depend_on_the_folder() {
        let (one, other) = (workspace(), workspace());
        let digest = super::digest(one.path()).unwrap();
        assert_eq!(super::digest(other.path()).unwrap(), digest);
        assert_eq!(digest.len(), 12);
    }

    #[test]
    fn every_source_counts_and_tests_do_not() {
        let folder = workspace();
        let mut seen = vec![super::digest(folder.path()).unwrap()];
        for (name, content, counts) in [
            ("crates/one/src/deep/er.rs", "fn b() { }", true),
            ("crates/one/src/new.rs", "", true),
            ("crates/two/Cargo.toml", "[package]", true),
            ("crates/three/src/lib.rs", "", true),
            ("proto/v1/wire.proto", "message B {}", true),
            ("migrations/0002.sql", "", true),
            ("Cargo.lock", "# other", true),
            ("crates/one/tests/it/main.rs", "fn other() {}", false),
            ("crates/one/src/.lib.rs.swp", "", false),
            ("README.md", "# other", false),
            ("docs/new.md", "", false),
        ] {
            write(folder.path(), name, content);
            let digest = super::digest(folder.path()).unwrap();
            assert_eq!(seen.contains(&digest), !counts, "{name}");
            seen.push(digest);
        }
        fs::rename(
            folder.path().join("crates/one/src/new.rs"),
            folder.path().join("crates/one/src/newer.rs"),
        )
        .unwrap();
        assert!(!seen.contains(&super::digest(folder.path()).unwrap()));
    }

    #[test]
    fn this_build_has_the_digest_of_these_sources() {
        let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let version = env!("CARGO_PKG_VERSION");
        let digest = super::digest(&workspace).unwrap();
        assert_eq!(crate::identity::BUILD, format!("{version}+{digest}"));
    }
}
