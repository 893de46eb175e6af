//! One file under several names, files that are removed, and folders that are not writable.

use std::fs;
use std::path::Path;
use std::time::Duration;

use store::{Error, Store};

use crate::{beside, campaign, folder, open, read, sample, samples, store_with};

#[cfg(unix)]
#[tokio::test]
async fn a_file_with_two_names_is_refused_under_either() {
    let (_folder, path) = folder();
    store_with(&path, 3).await.close().await.unwrap();
    let second = path.with_file_name("second.db");
    fs::hard_link(&path, &second).unwrap();
    let before = read(&path);
    for path in [&path, &second] {
        let error = Store::create_or_open(path, &campaign()).await.unwrap_err();
        assert!(matches!(error, Error::Linked { names: 2, .. }), "{error}");
    }
    assert_eq!(read(&path), before);
    // No process writes, so a snapshot made of links can be read.
    Store::open_read_only(&second).await.unwrap();
    fs::remove_file(&path).unwrap();
    assert_eq!(open(&second).await.designs().await.unwrap().len(), 3);
}

#[cfg(unix)]
#[tokio::test]
async fn a_link_that_leads_nowhere_is_refused_and_left_alone() {
    let (_folder, path) = folder();
    let link = path.with_file_name("link.db");
    std::os::unix::fs::symlink("unmounted/c.db", &link).unwrap();
    let error = Store::create_or_open(&link, &campaign()).await.unwrap_err();
    let Error::Io { source, .. } = &error else {
        panic!("{error}")
    };
    let said = source.to_string();
    assert!(
        said.contains("a symbolic link to /") && said.contains("unmounted/c.db"),
        "{said}"
    );
    assert!(link.is_symlink());
    // A link to a store is followed.
    fs::remove_file(&link).unwrap();
    store_with(&path, 3).await.close().await.unwrap();
    std::os::unix::fs::symlink(&path, &link).unwrap();
    assert_eq!(open(&link).await.designs().await.unwrap().len(), 3);
}

#[cfg(target_os = "linux")]
#[tokio::test]
async fn a_store_in_use_is_locked_under_every_name() {
    let (_folder, path) = folder();
    let store = store_with(&path, 3).await;
    let second = path.with_file_name("second.db");
    fs::hard_link(&path, &second).unwrap();
    let error = Store::create_or_open(&second, &campaign())
        .await
        .unwrap_err();
    assert!(matches!(error, Error::Linked { .. }), "{error}");
    // The log belongs to the other name.
    let error = Store::open_read_only(&second).await.unwrap_err();
    assert!(matches!(error, Error::Linked { .. }), "{error}");
    Store::open_read_only(&path).await.unwrap();
    // A file that was moved has one name, but is still locked.
    fs::remove_file(&path).unwrap();
    let error = Store::create_or_open(&second, &campaign())
        .await
        .unwrap_err();
    assert!(matches!(error, Error::Locked { .. }), "{error}");
    drop(store);
}

#[cfg(unix)]
#[tokio::test]
async fn a_store_that_is_removed_while_it_is_used_is_missed() {
    for (suffix, replaced) in [("", false), ("-wal", false), ("", true), ("-wal", true)] {
        let (_folder, path) = folder();
        let store = store_with(&path, 1).await;
        let writer = store.writer().unwrap();
        writer.submit(samples([sample(0, 0, 1.0)])).await.unwrap();
        let file = beside(&path, suffix);
        let bytes = read(&file);
        let away = path.with_file_name("away");
        fs::rename(&file, &away).unwrap();
        if replaced {
            fs::write(&file, bytes).unwrap();
        }
        let error = writer
            .submit(samples([sample(0, 1, 1.0)]))
            .await
            .unwrap_err();
        let Error::Lost {
            file: lost, how, ..
        } = &error
        else {
            panic!("{error}");
        };
        assert_eq!(*lost, file.canonicalize().unwrap_or(lost.clone()));
        assert_eq!(*how == "removed", !replaced, "{error}");
        assert!(!error.is_refusal());
        // The check reports the loss, so the campaign ends with an error.
        assert!(matches!(store.checked().await, Err(Error::Lost { .. })));
        let error = store.damaged().await;
        assert!(error.to_string().contains("put it back"), "{error}");
    }
}

/// Opening a pipe blocks, and opening a device may do anything.
#[cfg(target_os = "linux")]
#[tokio::test]
async fn a_pipe_is_no_store() {
    use rustix::fs::{CWD, FileType, Mode, mknodat};

    let (_folder, path) = folder();
    mknodat(CWD, &path, FileType::Fifo, Mode::RUSR | Mode::WUSR, 0).unwrap();
    for error in [
        Store::open_read_only(&path).await.unwrap_err(),
        Store::create_or_open(&path, &campaign()).await.unwrap_err(),
    ] {
        assert!(matches!(error, Error::NotADatabase { .. }), "{error}");
    }
    assert!(!beside(&path, ".lock").exists());
}

/// Another program may lock the file for longer than a moment, for example a database browser.
#[tokio::test]
async fn a_lock_of_another_program_is_waited_for() {
    use sqlx::Connection as _;
    use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection};

    let (_folder, path) = folder();
    let store = store_with(&path, 1).await;
    let options = SqliteConnectOptions::new().filename(&path);
    let mut other = SqliteConnection::connect_with(&options).await.unwrap();
    let lock = sqlx::query("BEGIN EXCLUSIVE");
    lock.execute(&mut other).await.unwrap();
    let writer = store.writer().unwrap();
    let submitted = tokio::spawn(async move { writer.submit(samples([sample(0, 0, 1.0)])).await });
    tokio::time::sleep(Duration::from_secs(12)).await;
    assert!(!submitted.is_finished());
    sqlx::query("ROLLBACK").execute(&mut other).await.unwrap();
    assert_eq!(submitted.await.unwrap().unwrap().new_rows, 1);
}

/// In a folder that others can write to, the lock's name may lead to a file of the coordinator's user.
#[cfg(unix)]
#[tokio::test]
async fn a_lock_file_is_the_owners_alone() {
    use std::os::unix::fs::PermissionsExt as _;

    let (folder, path) = folder();
    let (lock, victim) = (beside(&path, ".lock"), folder.path().join("victim"));
    fs::write(&victim, "0000000000000000000000").unwrap();
    std::os::unix::fs::symlink(&victim, &lock).unwrap();
    let error = Store::create_or_open(&path, &campaign()).await.unwrap_err();
    assert!(matches!(error, Error::Io { .. }), "{error}");
    assert_eq!(fs::read(&victim).unwrap(), [b'0'; 22]);
    assert!(!path.exists());

    fs::remove_file(&lock).unwrap();
    let mode = || fs::metadata(&lock).unwrap().permissions().mode() & 0o777;
    store_with(&path, 1).await.close().await.unwrap();
    assert_eq!(mode(), 0o600);
    // A user who can open the file can lock it.
    fs::set_permissions(&lock, fs::Permissions::from_mode(0o666)).unwrap();
    open(&path).await.close().await.unwrap();
    assert_eq!(mode(), 0o600);
}

/// The loss is noticed without a write.
#[cfg(unix)]
#[tokio::test]
async fn an_idle_store_is_missed_within_seconds() {
    let (_folder, path) = folder();
    let store = store_with(&path, 1).await;
    let damaged = store.damaged();
    fs::remove_file(&path).unwrap();
    let error = tokio::time::timeout(Duration::from_secs(10), damaged).await;
    assert!(matches!(error, Ok(Error::Lost { .. })), "{error:?}");
}

#[cfg(unix)]
#[tokio::test]
async fn a_store_in_a_folder_that_may_not_be_written_to_can_be_read() {
    use std::os::unix::fs::PermissionsExt as _;

    let (folder, path) = folder();
    let store = store_with(&path, 3).await;
    let with_log = folder.path().join("log.db");
    for suffix in ["", "-wal"] {
        fs::copy(beside(&path, suffix), beside(&with_log, suffix)).unwrap();
    }
    store.close().await.unwrap();
    let mode = |mode| {
        fs::set_permissions(folder.path(), fs::Permissions::from_mode(mode)).unwrap();
    };
    fs::set_permissions(&path, fs::Permissions::from_mode(0o444)).unwrap();
    mode(0o555);
    let may_write_anyway = fs::write(folder.path().join("probe"), "").is_ok();
    let reader = Store::open_read_only(&path).await;
    let log = Store::open_read_only(&with_log).await;
    let written = Store::create_or_open(&path, &campaign()).await;
    mode(0o755);
    let reader = reader.unwrap();
    assert_eq!(reader.designs().await.unwrap().len(), 3);
    reader.checked().await.unwrap();
    // The superuser may write to any folder, and then nothing is refused.
    assert_eq!(written.is_ok(), may_write_anyway);
    match log {
        Ok(_) => assert!(may_write_anyway),
        Err(error) => {
            assert!(matches!(error, Error::UnreadLog { .. }), "{error}");
            assert!(error.to_string().contains("log.db-wal"), "{error}");
        }
    }
}

#[cfg(target_os = "linux")]
#[tokio::test]
async fn a_folder_that_takes_no_files_is_named() {
    let path = Path::new("/proc/self/campaign.db");
    let error = Store::create_or_open(path, &campaign()).await.unwrap_err();
    assert!(matches!(error, Error::Io { .. }), "{error}");
    assert!(error.to_string().contains("campaign.db"), "{error}");
}

#[cfg(unix)]
#[tokio::test]
async fn a_store_that_may_not_be_written_is_refused_and_can_be_read() {
    use std::os::unix::fs::PermissionsExt as _;

    let (folder, path) = folder();
    store_with(&path, 3).await.close().await.unwrap();
    let mode = |path: &Path, mode| {
        fs::set_permissions(path, fs::Permissions::from_mode(mode)).unwrap();
    };
    mode(&path, 0o444);
    // The superuser may write to any file, and then nothing is refused.
    let may_write_anyway = fs::File::options().append(true).open(&path).is_ok();
    let opened = Store::create_or_open(&path, &campaign()).await;
    assert_eq!(opened.is_ok(), may_write_anyway);
    drop(opened);
    let reader = Store::open_read_only(&path).await.unwrap();
    assert_eq!(reader.designs().await.unwrap().len(), 3);
    reader.close().await.unwrap();

    mode(&path, 0o644);
    mode(folder.path(), 0o555);
    let new = folder.path().join("new.db");
    let created = Store::create_or_open(&new, &campaign()).await;
    assert_eq!(created.is_ok(), may_write_anyway);
    mode(folder.path(), 0o755);
}
