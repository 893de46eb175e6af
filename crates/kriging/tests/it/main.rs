//! Kriging against dense formulas written out, brute force, and the results of other libraries.

mod common;
mod degenerate;
mod formulas;
mod hartmann;
mod invariance;
mod leave_one_out;
mod stored;
