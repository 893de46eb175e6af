//! The network protocol: generated gRPC code and its conversions.
//!
//! The messages are defined in `proto/pitchline/v1/pitchline.proto`. This module adds the other facts
//! on which both sides must agree: size limits and the reasons for refusals.

/// Version 1 of the protocol, as generated from `proto/pitchline/v1`.
#[expect(clippy::allow_attributes_without_reason, reason = "generated")]
pub mod v1 {
    tonic::include_proto!("pitchline.v1");
}

/// The protocol's descriptors, for the reflection service.
pub const DESCRIPTORS: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/pitchline.bin"));

/// Maximum size of a message on both sides, in bytes.
///
/// A kriging model of 3000 points has about half a megabyte of JSON.
pub const MAX_MESSAGE_BYTES: usize = 64 * 1024 * 1024;

mod convert;
mod refusal;

pub use convert::{MalformedMessage, lease, output, result, results};
pub use refusal::Refusal;
