//! Kriging against dense formulas written out, brute force, and the results of other libraries.

mod common;
mod contradictions;
mod degenerate;
mod formulas;
mod growing;
mod hartmann;
mod invariance;
mod leave_one_out;
mod options;
mod outliers;
mod properties;
mod stability;
mod stored;
mod units;
mod vecchia;
mod vecchia_loo;
mod warnings;
