//! Covariance matrix adaptation evolution strategy with bounds and restarts.
