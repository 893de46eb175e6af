//! Network file systems, on which SQLite's write-ahead log does not work.

use std::path::Path;

/// File systems whose locks or shared memory do not work between machines,
/// <https://www.sqlite.org/wal.html>: "WAL does not work over a network filesystem".
const NETWORK: &[&str] = &[
    "9p",
    "afs",
    "beegfs",
    "ceph",
    "cifs",
    "dvs",
    "fuse.ceph",
    "fuse.dfuse",
    "fuse.glusterfs",
    "fuse.s3fs",
    "fuse.sshfs",
    "gfs2",
    "glusterfs",
    "gpfs",
    "lustre",
    "ncpfs",
    "nfs",
    "nfs4",
    "ocfs2",
    "orangefs",
    "panfs",
    "smb2",
    "smb3",
    "smbfs",
    "wekafs",
];

/// The type of the network file system that holds `path`, or `None` if the file system is local.
/// `mountinfo` is the text of Linux's `/proc/self/mountinfo` (proc_pid_mountinfo(5)).
///
/// `path` must be absolute and free of symbolic links. Callers refuse such a path unless the user
/// overrides it, because a store belongs on a local disk.
pub fn network_file_system<'m>(path: &Path, mountinfo: &'m str) -> Option<&'m str> {
    // The longest mount point applies, and of several at the same place the last one.
    let mut best: Option<(usize, &str)> = None;
    for line in mountinfo.lines() {
        // "36 35 98:0 /root /mount/point rw,noatime master:1 - ext3 /dev/root rw"
        let Some((left, right)) = line.split_once(" - ") else {
            continue;
        };
        let Some(mount_point) = left.split(' ').nth(4) else {
            continue;
        };
        let Some(kind) = right.split(' ').next() else {
            continue;
        };
        let mount_point = unescape(mount_point);
        let depth = Path::new(&mount_point).components().count();
        if path.starts_with(&mount_point) && best.is_none_or(|(d, _)| depth >= d) {
            best = Some((depth, kind));
        }
    }
    best.map(|(_, kind)| kind)
        .filter(|kind| NETWORK.contains(kind))
}

/// Decodes the kernel's escapes: space, tab, newline and backslash are written as `\` and three
/// octal digits.
fn unescape(text: &str) -> String {
    text.replace("\\040", " ")
        .replace("\\011", "\t")
        .replace("\\012", "\n")
        .replace("\\134", "\\")
}

#[cfg(test)]
mod tests {
    use super::*;

    const MOUNTS: &str = "\
22 1 259:2 / / rw,relatime shared:1 - ext4 /dev/nvme0n1p2 rw
30 22 0:26 / /home rw,relatime shared:2 - nfs4 server:/home rw,vers=4.2
31 30 259:3 / /home/me/fast\\040disk rw - xfs /dev/nvme1n1 rw
40 22 0:40 / /scratch rw shared:9 - lustre mgs@tcp:/scratch rw
41 22 0:41 / /scratch rw shared:10 - tmpfs tmpfs rw
";

    #[test]
    fn the_innermost_and_latest_mount_decides() {
        let kind = |path| network_file_system(Path::new(path), MOUNTS);
        assert_eq!(kind("/var/lib/store.db"), None);
        assert_eq!(kind("/home/me/store.db"), Some("nfs4"));
        assert_eq!(kind("/homework/store.db"), None);
        assert_eq!(kind("/home/me/fast disk/store.db"), None);
        assert_eq!(kind("/scratch/store.db"), None);
    }

    #[test]
    fn file_systems_of_clusters_are_known() {
        for kind in ["dvs", "fuse.dfuse", "gfs2", "ocfs2", "panfs", "wekafs"] {
            let mounts = MOUNTS.replace("xfs", kind);
            let path = Path::new("/home/me/fast disk/store.db");
            assert_eq!(network_file_system(path, &mounts), Some(kind));
        }
        assert!(NETWORK.is_sorted());
    }
}
