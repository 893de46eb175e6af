//! The end of a process group: its input is closed, then it gets SIGTERM, then SIGKILL.
//!
//! The leader is a child of this program. It is reaped last, so that the group's id belongs to no
//! other process before.

use std::fs;
use std::time::Duration;

use rustix::process::{Pid, Signal, WaitId, WaitIdOptions, kill_process_group, waitid};

/// Time between the end of the input and SIGTERM.
pub(super) const AFTER_INPUT: Duration = Duration::from_secs(1);
/// Time between SIGTERM and SIGKILL.
pub(super) const AFTER_TERM: Duration = Duration::from_secs(2);
/// The guard's command: wait until its input ends, as the group's does, then end the group with the
/// times above.
pub(super) const GUARD: &str =
    r#"read -r _; sleep 1; kill -s TERM -- "-$1" && sleep 2 && kill -s KILL -- "-$1""#;

/// Whether the leader of a group has ended. It is not reaped.
pub(super) fn has_ended(leader: Pid) -> bool {
    let options = WaitIdOptions::EXITED | WaitIdOptions::NOHANG | WaitIdOptions::NOWAIT;
    !matches!(waitid(WaitId::Pid(leader), options), Ok(None))
}

/// Whether a process of the group is running, as far as the system lists processes.
pub(super) fn has_members(group: Pid) -> bool {
    let Ok(processes) = fs::read_dir("/proc") else {
        return false;
    };
    let own = group.as_raw_nonzero().to_string();
    processes.filter_map(Result::ok).any(|process| {
        let is_number = |name: &str| name.bytes().all(|byte| byte.is_ascii_digit());
        if !process.file_name().to_str().is_some_and(is_number) {
            return false;
        }
        let stat = fs::read_to_string(process.path().join("stat")).unwrap_or_default();
        // The name of the program, in parentheses, may hold anything. State, parent and group follow.
        let after = stat.rsplit_once(") ").map_or("", |(_, after)| after);
        let mut fields = after.split(' ');
        let state = fields.next().unwrap_or_default();
        !matches!(state, "" | "Z" | "X") && fields.nth(1) == Some(&own)
    })
}

/// Sends a signal to a group, which may have ended already.
pub(super) fn signal(group: Pid, signal: Signal) {
    let _ = kill_process_group(group, signal);
}
