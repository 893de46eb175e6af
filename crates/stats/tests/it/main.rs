//! Statistics against published and certified numbers.

mod moments;
mod normality;
mod percentile;
