//! The reasons for which a coordinator refuses a call permanently.

use tonic::metadata::MetadataValue;
use tonic::{Code, Status};

/// The reason for a refusal. A refusal is final: a repeated call gets the same answer, so a refused
/// program exits. Temporary conditions (a coordinator that is starting, a lost connection) are
/// plain gRPC statuses instead, after which the worker tries again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Refusal {
    /// The worker and the coordinator are different versions of the program.
    Version,
    /// The worker's simulator gives other numbers than the coordinator's.
    Model,
    /// The request is malformed (an empty worker id, no slots).
    Malformed,
    /// The call has no token, or one that the coordinator does not know.
    Unknown,
    /// The call's token is valid, but does not permit this call.
    Forbidden,
}

const HEADER: &str = "pitchline-refusal";

impl Refusal {
    const ALL: [Self; 5] = [
        Self::Version,
        Self::Model,
        Self::Malformed,
        Self::Unknown,
        Self::Forbidden,
    ];

    const fn name(self) -> &'static str {
        match self {
            Self::Version => "version",
            Self::Model => "model",
            Self::Malformed => "malformed",
            Self::Unknown => "unknown",
            Self::Forbidden => "forbidden",
        }
    }

    /// The status of this refusal, with a message for people.
    #[must_use]
    pub fn status(self, message: impl Into<String>) -> Status {
        let code = match self {
            Self::Version | Self::Model => Code::FailedPrecondition,
            Self::Malformed => Code::InvalidArgument,
            Self::Unknown => Code::Unauthenticated,
            Self::Forbidden => Code::PermissionDenied,
        };
        let mut status = Status::new(code, message);
        status
            .metadata_mut()
            .insert(HEADER, MetadataValue::from_static(self.name()));
        status
    }

    /// The refusal in `status`, if it is one.
    #[must_use]
    pub fn of(status: &Status) -> Option<Self> {
        let name = status.metadata().get(HEADER)?.to_str().ok()?;
        Self::ALL.into_iter().find(|refusal| refusal.name() == name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refusal_survives_the_wire() {
        for refusal in Refusal::ALL {
            assert_eq!(Refusal::of(&refusal.status("no")), Some(refusal));
        }
    }

    #[test]
    fn an_ordinary_error_is_no_refusal() {
        assert_eq!(Refusal::of(&Status::unavailable("starting")), None);
    }
}
