//! Kriging against dense formulas written out, brute force, and the results of other libraries. The stability atlas
//! of the crate `lab` has the data on which a fit is refused or gives warnings.

mod common;
mod contradictions;
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
