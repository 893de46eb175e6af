//! Statistics against published and certified numbers.

mod exact;
mod measure;
mod moments;
mod normality;
mod order;
mod percentile;
mod quantile;
mod random_inputs;
mod reduction;
mod sequential;
