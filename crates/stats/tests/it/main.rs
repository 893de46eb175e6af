//! Statistics against published and certified numbers.

mod exact;
mod moments;
mod normality;
mod percentile;
mod quantile;
mod reduction;
mod sequential;
