//! Which build of the program this is.

#[cfg(test)]
mod sources;

/// The version and the first 48 bits of the SHA-256 of all sources, such as `0.1.0+1a2b3c4d5e6f`.
///
/// Equal for two builds exactly when they were made from the same sources: debug or release, in
/// whatever folder. Sources are what ends up in the programs, without tests and documents; see
/// `sources.rs`.
pub const BUILD: &str = concat!(env!("CARGO_PKG_VERSION"), "+", env!("PITCHLINE_SOURCES"));
