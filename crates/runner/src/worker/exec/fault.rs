//! Why a request has no answer, and whether the machine is at fault.

use std::time::Duration;

use problem::simulator::NoAnswer;
use tokio::sync::watch;
use tracing::warn;

use crate::outside;

/// Pauses before a machine that cannot run the program is tried again: a shortage of processes,
/// memory or disk may pass.
pub(super) const PAUSES: [Duration; 3] = [
    Duration::from_secs(1),
    Duration::from_secs(2),
    Duration::from_secs(4),
];

/// Why a request has no answer. The texts are for users.
#[derive(Debug, PartialEq)]
pub(super) enum Fault {
    /// The program failed.
    Program(String),
    /// The program ended without an error between two answers: it can be started again.
    Left(String),
    /// The shell did not find the command or may not run it: its exit status is 126 or 127.
    NotRun {
        text: String,
        /// The cause and the remedy, if the machine is at fault.
        of_machine: String,
    },
    /// The machine cannot run the program: the cause and the remedy.
    Machine(String),
}

impl Fault {
    /// Returns the fault of a request. The machine is at fault if it cannot run a program that has not answered before.
    pub(super) fn judged(self, has_answered: bool) -> Self {
        match self {
            Self::NotRun { of_machine, .. } if !has_answered => Self::Machine(of_machine),
            fault => fault,
        }
    }

    /// Returns the fault of a shell that ended with 126, because it may not run the command, or with 127, because it
    /// did not find it. The first line of `text` says how the shell ended; the last line is the last one of the
    /// shell's standard error.
    pub(super) fn not_run(status: i32, text: String) -> Self {
        let remedy = match status {
            126 => {
                "make the program executable (chmod +x), or name its interpreter, as in \"python3 model.py\""
            }
            _ => "install the program on this machine, or correct --exec or simulator.command",
        };
        let ended = text.lines().next().unwrap_or_default();
        let said = text.lines().last().unwrap_or_default();
        Self::NotRun {
            of_machine: format!("{ended}: {said}; {remedy}"),
            text,
        }
    }

    /// The text, which may have several lines.
    pub(super) fn text(self) -> String {
        match self {
            Self::Program(text)
            | Self::Left(text)
            | Self::NotRun { text, .. }
            | Self::Machine(text) => text,
        }
    }
}

impl From<Fault> for NoAnswer {
    fn from(fault: Fault) -> Self {
        match fault {
            Fault::Machine(text) => Self::Machine(outside::line(&text)),
            fault => Self::Failed(outside::clean(&fault.text())),
        }
    }
}

/// Whether a machine can run the simulator.
#[derive(Debug, Default)]
pub(crate) struct Ability {
    /// Number of requests that wait for the end of a shortage.
    pub(crate) waiting: usize,
    /// The cause and the remedy, once the machine has failed in every attempt.
    pub(crate) fault: Option<String>,
}

/// Makes a request again, after each of the `pauses`, while the machine is at fault. `pause` returns
/// false if there is no time for it.
pub(super) fn patiently<T>(
    ability: &watch::Sender<Ability>,
    pauses: &[Duration],
    pause: impl Fn(Duration) -> bool,
    request: impl Fn() -> Result<T, Fault>,
) -> Result<T, Fault> {
    let mut pauses = pauses.iter();
    loop {
        let reason = match request() {
            Err(Fault::Machine(reason)) => reason,
            other => return other,
        };
        let next = pauses.next().filter(|_| ability.borrow().fault.is_none());
        let Some(&next) = next else {
            ability.send_modify(|ability| {
                ability.fault.get_or_insert_with(|| outside::line(&reason));
            });
            return Err(Fault::Machine(reason));
        };
        warn!(
            reason = outside::line(&reason),
            again_in = next.as_secs_f64(),
            "this machine cannot run the simulator; trying again"
        );
        ability.send_modify(|ability| ability.waiting += 1);
        let has_time = pause(next);
        ability.send_modify(|ability| ability.waiting -= 1);
        if !has_time {
            return Err(Fault::Machine(reason));
        }
    }
}
