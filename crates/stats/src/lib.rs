//! Percentiles and their variance, normality tests, and the random streams every other crate draws from.

pub mod streams;
