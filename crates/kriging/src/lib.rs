//! Gaussian-process regression (kriging) with a known noise variance at every observation.
