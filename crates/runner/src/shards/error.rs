//! The errors of shards and parts.

use std::io;
use std::path::{Path, PathBuf};

use crate::exit::{self, HasExitCode};

/// An error of a shard or a part.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    #[error("cannot use {}: {reason}", path.display())]
    Io { path: PathBuf, reason: io::Error },
    #[error("{} is not a shard of `coordinator plan`: {reason}", path.display())]
    NotAShard { path: PathBuf, reason: String },
    #[error("{} is not a part of `worker --shard`: {reason}", path.display())]
    NotAPart { path: PathBuf, reason: String },
    #[error(
        "{} is damaged at byte {at}: remove it, and {}",
        path.display(),
        match shard {
            Some(shard) => format!("compute shard {shard} again with `worker --shard`"),
            None => "let a worker compute its jobs again".to_owned(),
        }
    )]
    Damaged {
        path: PathBuf,
        /// The byte at which the record begins.
        at: u64,
        /// The shard's number; none for a worker's undelivered results.
        shard: Option<u32>,
    },
    #[error(
        "{} is of build {theirs}, this program is build {}: use the same build for `plan`, `worker` and `merge`",
        path.display(), crate::identity::BUILD
    )]
    Build { path: PathBuf, theirs: String },
    #[error(
        "{} holds results of another shard, of plan {theirs}: choose another file with --out",
        path.display()
    )]
    OtherShard { path: PathBuf, theirs: String },
    #[error(
        "{} holds results of a simulator that gives other numbers: compute the shard with the same program, or choose \
         another file with --out",
        path.display()
    )]
    OtherSimulator { path: PathBuf },
}

impl Error {
    pub(crate) fn io(path: &Path) -> impl Fn(io::Error) -> Self + '_ {
        |reason| Self::Io {
            path: path.to_owned(),
            reason,
        }
    }
}

impl HasExitCode for Error {
    fn exit_code(&self) -> u8 {
        match self {
            Self::Io { .. } | Self::OtherShard { .. } => exit::FILE_ACCESS,
            Self::Build { .. } | Self::OtherSimulator { .. } => exit::REFUSED,
            Self::NotAShard { .. } | Self::NotAPart { .. } | Self::Damaged { .. } => exit::BAD_FILE,
        }
    }
}
