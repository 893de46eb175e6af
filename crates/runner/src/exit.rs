//! The exit codes of `coordinator` and `worker`, and the codes of errors. Scripts rely on the numbers, so
//! they must not change.

use std::error::Error;
use std::fmt;

use problem::FileError;
use results::modelling;

use crate::{gateway, worker};

/// The program succeeded.
pub const OK: u8 = 0;
/// A failure without a code of its own.
pub const FAILURE: u8 = 1;
/// The command line is invalid.
pub const USAGE: u8 = 2;
/// An input file (campaign, pair, table or model) has an unknown or missing key, a wrong type or an
/// invalid value.
pub const BAD_FILE: u8 = 3;
/// A file cannot be read or written, would be overwritten, or holds a secret that others can read. Or
/// the machine of a worker cannot run the external simulator.
pub const FILE_ACCESS: u8 = 4;
/// There is no store at the given path.
pub const NO_STORE: u8 = 5;
/// The store holds another campaign.
pub const OTHER_CAMPAIGN: u8 = 6;
/// The store is not an SQLite file, or is another program's.
pub const NOT_A_STORE: u8 = 7;
/// The store is damaged, was removed while it was in use, lacks commits, has several names, or was written by
/// another version of the program.
pub const UNUSABLE_STORE: u8 = 8;
/// Another coordinator has the store open, or another program has locked it.
pub const STORE_LOCKED: u8 = 9;
/// The listen address or the access file is in use, or the address cannot be bound.
pub const CANNOT_LISTEN: u8 = 10;
/// No coordinator answers at the address, or has not for too long. Trying again may help.
pub const UNREACHABLE: u8 = 11;
/// The coordinator refused permanently: another version, another model, or a token or certificate
/// that it does not accept; or its own certificate is not trusted.
pub const REFUSED: u8 = 12;
/// The campaign ended with quarantined jobs, which the report names. Or parts that were merged lack results.
pub const INCOMPLETE: u8 = 13;
/// The program stopped before the end of its work: by a signal, a drain or a time limit. The same command continues
/// the work.
pub const INTERRUPTED: u8 = 14;
/// The gear pair of `coordinator simulate` is not simulable: no such pair exists, or its teeth lose
/// contact. In a campaign: no design gets samples, because none is simulable or the constraints
/// rule all out.
pub const NOT_SIMULABLE: u8 = 15;
/// The campaign ended without a design to recommend: no approach found one that satisfies every constraint, those on
/// measures of samples by its verification samples.
pub const NONE_FEASIBLE: u8 = 16;
/// The campaign's budget is used up. A larger one and the same command continue.
pub const OVER_BUDGET: u8 = 17;

/// An error whose exit code is known. A command cannot pass on an error without a code.
pub trait HasExitCode: Error + Send + Sync + 'static {
    /// The exit code of a program that ends with this error.
    fn exit_code(&self) -> u8 {
        FAILURE
    }
}

/// An error that ends a program, with its exit code.
#[derive(Debug)]
pub struct ProgramError {
    code: u8,
    error: anyhow::Error,
}

impl ProgramError {
    #[must_use]
    pub const fn code(&self) -> u8 {
        self.code
    }
}

impl fmt::Display for ProgramError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.error.fmt(f)
    }
}

impl<E: HasExitCode> From<E> for ProgramError {
    fn from(error: E) -> Self {
        Self {
            code: error.exit_code(),
            error: error.into(),
        }
    }
}

impl From<anyhow::Error> for ProgramError {
    fn from(error: anyhow::Error) -> Self {
        Self {
            code: code_within(&error),
            error,
        }
    }
}

/// The exit code of an error of a library function that returns [`anyhow::Error`]. Such functions pass on
/// errors of the store, of the campaign file in it, of workers, of the network and of files.
fn code_within(error: &anyhow::Error) -> u8 {
    fn code<E: HasExitCode>(cause: &(dyn Error + 'static)) -> Option<u8> {
        cause.downcast_ref().map(E::exit_code)
    }
    let code = error.chain().find_map(|cause| {
        code::<store::Error>(cause)
            .or_else(|| code::<FileError>(cause))
            .or_else(|| code::<worker::Error>(cause))
            .or_else(|| code::<gateway::Error>(cause))
            .or_else(|| code::<std::io::Error>(cause))
    });
    code.unwrap_or(FAILURE)
}

impl HasExitCode for FileError {
    fn exit_code(&self) -> u8 {
        BAD_FILE
    }
}

impl HasExitCode for modelling::InputError {
    fn exit_code(&self) -> u8 {
        BAD_FILE
    }
}

impl HasExitCode for modelling::Error {
    fn exit_code(&self) -> u8 {
        match self {
            Self::Settings(_) => USAGE,
            Self::Kriging(_) => FAILURE,
            _ => BAD_FILE,
        }
    }
}

impl HasExitCode for store::Error {
    fn exit_code(&self) -> u8 {
        match self {
            Self::NoStore { .. } => NO_STORE,
            Self::OtherCampaign { .. } | Self::ModelDigestConflict { .. } => OTHER_CAMPAIGN,
            Self::NotADatabase { .. } | Self::NotAStore { .. } => NOT_A_STORE,
            Self::Damaged { .. }
            | Self::DamagedRows { .. }
            | Self::Lost { .. }
            | Self::Linked { .. }
            | Self::MissingCommits { .. }
            | Self::OtherSchema { .. } => UNUSABLE_STORE,
            Self::Locked { .. } | Self::Busy { .. } => STORE_LOCKED,
            Self::Io { .. } | Self::DiskFull { .. } | Self::UnreadLog { .. } => FILE_ACCESS,
            _ => FAILURE,
        }
    }
}

impl HasExitCode for gateway::Error {
    fn exit_code(&self) -> u8 {
        match self {
            Self::Unreachable { .. }
            | Self::Away { .. }
            | Self::Gone { .. }
            | Self::NoAccess { .. } => UNREACHABLE,
            Self::Refused { .. } | Self::Tls { .. } => REFUSED,
            Self::SeveralCoordinators { .. } => USAGE,
            Self::NoFolder
            | Self::Unreadable { .. }
            | Self::Exposed { .. }
            | Self::Malformed { .. }
            | Self::Write { .. } => FILE_ACCESS,
            Self::InUse { .. } => CANNOT_LISTEN,
            Self::Secrets { .. } | Self::InvalidAnswer { .. } | Self::Failed { .. } => FAILURE,
        }
    }
}

impl HasExitCode for worker::Error {
    fn exit_code(&self) -> u8 {
        match self {
            Self::Gateway(error) => error.exit_code(),
            Self::WrongSimulator { .. } => REFUSED,
            Self::Machine { .. } => FILE_ACCESS,
            Self::Program { .. } | Self::Threads { .. } => FAILURE,
        }
    }
}

/// An error of the operating system without another context means that a file could not be read or written.
impl HasExitCode for std::io::Error {
    fn exit_code(&self) -> u8 {
        FILE_ACCESS
    }
}

// Errors without a code of their own.
impl HasExitCode for serde_json::Error {}
impl HasExitCode for tokio::task::JoinError {}
impl HasExitCode for results::report::Error {}
impl HasExitCode for indicatif::style::TemplateError {}

/// Every code with its meaning, for `--help` and the guide.
pub const TABLE: [(u8, &str); 18] = [
    (OK, "success"),
    (FAILURE, "a failure without a code of its own"),
    (USAGE, "the command line is invalid"),
    (
        BAD_FILE,
        "an input file is invalid; the message names file, line, and key or column",
    ),
    (
        FILE_ACCESS,
        "a file cannot be read or written, would be overwritten, or exposes a secret; or this machine \
         cannot run the external simulator",
    ),
    (NO_STORE, "no store at the given path"),
    (OTHER_CAMPAIGN, "the store holds another campaign"),
    (
        NOT_A_STORE,
        "the store is not an SQLite file, or is another program's",
    ),
    (
        UNUSABLE_STORE,
        "the store is damaged, was removed, lacks commits, has several names, or is of another version",
    ),
    (
        STORE_LOCKED,
        "another coordinator has the store open, or another program has locked it",
    ),
    (
        CANNOT_LISTEN,
        "the listen address or the access file is in use, or the address cannot be bound",
    ),
    (UNREACHABLE, "no coordinator answers; trying again may help"),
    (
        REFUSED,
        "the coordinator refused permanently: version, numbers, token or certificate",
    ),
    (
        INCOMPLETE,
        "the campaign ended, but some of its jobs were quarantined; or `merge` misses results of a plan",
    ),
    (
        INTERRUPTED,
        "stopped before the end, by a signal, a drain or a time limit; the same command continues",
    ),
    (
        NOT_SIMULABLE,
        "the gear pair, or every design of the campaign, cannot be simulated",
    ),
    (
        NONE_FEASIBLE,
        "the campaign ended, and no approach found a design that keeps every limit",
    ),
    (
        OVER_BUDGET,
        "the campaign's budget is used up; a larger one and the same command continue",
    ),
];

#[cfg(test)]
mod tests {
    use anyhow::Context as _;

    use super::*;

    #[test]
    fn an_error_keeps_its_code_under_contexts() {
        let no_store = || store::Error::NoStore {
            path: "campaign.db".into(),
        };
        assert_eq!(ProgramError::from(store::Error::Closed).code(), FAILURE);
        assert_eq!(ProgramError::from(no_store()).code(), NO_STORE);
        let context = Err::<(), _>(no_store()).context("reading the status");
        let error = ProgramError::from(context.unwrap_err());
        assert_eq!(error.code(), NO_STORE);
        assert!(format!("{error:#}").starts_with("reading the status: there is no store"));
        assert_eq!(ProgramError::from(anyhow::anyhow!("other")).code(), FAILURE);
        let full = || std::io::Error::from(std::io::ErrorKind::StorageFull);
        let context = Err::<(), _>(full()).context("cannot write report.html");
        let error = ProgramError::from(context.unwrap_err());
        assert_eq!(error.code(), FILE_ACCESS);
        assert_eq!(ProgramError::from(full()).code(), FILE_ACCESS);
        let away = gateway::Error::Unreachable {
            address: "head:7400".to_owned(),
            reason: "refused".to_owned(),
        };
        let error = ProgramError::from(anyhow::Error::from(away).context("a worker"));
        assert_eq!(error.code(), UNREACHABLE);
    }
}
