//! Files beside others' that only their owner may open, such as locks and keys.

use std::fs::{self, File, Metadata, OpenOptions};
use std::io;
use std::path::Path;

/// Opens a file of this program's user for reading and writing, or creates it with mode 600. In a folder that others
/// can write to, the name may lead to a file of any user.
///
/// A file of the owner of `beside` is accepted, too: a store may belong to another user than its coordinator's.
///
/// # Errors
///
/// [`io::ErrorKind::PermissionDenied`] for a symbolic link, for anything but a regular file, for a file with several
/// names and for one of another user. The text says what to do. Otherwise the error of the operating system.
pub fn open_own_file(path: &Path, beside: Option<&Path>) -> io::Result<File> {
    match options().create_new(true).open(path) {
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
        created => return created,
    }
    let owner = beside.and_then(|file| fs::metadata(file).ok());
    let owner = owner.as_ref();
    // The name is checked before the file is opened: the error of opening a pipe or another user's file names no
    // reason.
    refuse(&fs::symlink_metadata(path)?, owner)?;
    let file = options().open(path).map_err(|error| match error.kind() {
        io::ErrorKind::PermissionDenied => denied("its permissions forbid it"),
        _ => error,
    })?;
    refuse(&file.metadata()?, owner)?;
    Ok(file)
}

fn denied(what: &str) -> io::Error {
    let what = format!(
        "{what}: run this command as the owner of the files, or remove this file if no other coordinator uses it"
    );
    io::Error::new(io::ErrorKind::PermissionDenied, what)
}

fn options() -> OpenOptions {
    let mut options = File::options();
    options.read(true).write(true);
    #[cfg(unix)]
    {
        use std::os::unix::fs::OpenOptionsExt as _;
        let flags = rustix::fs::OFlags::NOFOLLOW.bits();
        options.mode(0o600).custom_flags(flags.cast_signed());
    }
    options
}

#[cfg(unix)]
fn refuse(file: &Metadata, owner: Option<&Metadata>) -> io::Result<()> {
    use std::os::unix::fs::MetadataExt as _;
    let own = rustix::process::geteuid().as_raw();
    let is_own = file.uid() == own || owner.is_some_and(|owner| owner.uid() == file.uid());
    let what = if file.is_symlink() {
        "it is a symbolic link".to_owned()
    } else if !file.is_file() {
        "it is not a regular file".to_owned()
    } else if file.nlink() > 1 {
        format!("it is one file with {} names (hard links)", file.nlink())
    } else if !is_own {
        format!("it belongs to another user (uid {})", file.uid())
    } else {
        return Ok(());
    };
    Err(denied(&what))
}

#[cfg(not(unix))]
fn refuse(_: &Metadata, _: Option<&Metadata>) -> io::Result<()> {
    Ok(())
}

#[cfg(all(test, unix))]
mod tests {
    use std::io::Write as _;
    use std::os::unix::fs::{MetadataExt as _, symlink};

    use super::*;

    #[test]
    fn a_name_that_leads_to_another_file_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let [victim, name] = ["victim", "c.lock"].map(|name| folder.path().join(name));
        fs::write(&victim, "secret").unwrap();
        let refused = |what: &str| {
            let error = open_own_file(&name, None).unwrap_err();
            assert_eq!(error.kind(), io::ErrorKind::PermissionDenied);
            let said = error.to_string();
            assert!(
                said.contains(what) && said.contains("remove this file"),
                "{said}"
            );
            fs::remove_file(&name)
                .or_else(|_| fs::remove_dir(&name))
                .unwrap();
        };
        symlink(&victim, &name).unwrap();
        refused("a symbolic link");
        symlink(folder.path().join("nothing"), &name).unwrap();
        refused("a symbolic link");
        fs::hard_link(&victim, &name).unwrap();
        refused("2 names");
        fs::create_dir(&name).unwrap();
        refused("not a regular file");
        let mut file = open_own_file(&name, None).unwrap();
        file.write_all(b"7").unwrap();
        assert_eq!(file.metadata().unwrap().mode() & 0o777, 0o600);
        open_own_file(&name, None).unwrap();
        assert_eq!(fs::read(&name).unwrap(), b"7");
        assert_eq!(fs::read(&victim).unwrap(), b"secret");
    }

    #[test]
    #[expect(clippy::print_stderr, reason = "for readers of the tests' output")]
    fn a_file_of_another_user_is_refused_unless_the_store_is_that_users() {
        let folder = tempfile::tempdir().unwrap();
        let [store, lock] = ["c.db", "c.db.lock"].map(|name| folder.path().join(name));
        for file in [&store, &lock] {
            fs::write(file, "").unwrap();
        }
        if std::os::unix::fs::chown(&lock, Some(12_345), None).is_err() {
            eprintln!("skipped: only the superuser can make a file of another user");
            return;
        }
        let error = open_own_file(&lock, Some(&store)).unwrap_err().to_string();
        assert!(error.contains("uid 12345"), "{error}");
        std::os::unix::fs::chown(&store, Some(12_345), None).unwrap();
        open_own_file(&lock, Some(&store)).unwrap();
    }
}
