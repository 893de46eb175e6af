//! The wire: generated gRPC code and its conversions.
