//! The identity of this build of the program.

#[cfg(test)]
mod sources;

/// The version and the first 48 bits of the SHA-256 of all sources, such as `0.1.0+1a2b3c4d5e6f`.
///
/// Two builds have the same value exactly when they were made from the same sources, in debug or
/// release and in any folder. The sources are the files that affect the programs, without tests and
/// documents; see `sources.rs`.
pub const BUILD: &str = concat!(env!("CARGO_PKG_VERSION"), "+", env!("PITCHLINE_SOURCES"));
