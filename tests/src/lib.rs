//! The acceptance suite lives in `tests/`; this library is empty.
