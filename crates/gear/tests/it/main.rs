//! Integration tests of the gear simulator: published cases, the paper's designs, invariants,
//! refusals, a fuzz, an independent slice sum and convergence.

mod convergence;
mod fuzz;
mod infeasible;
mod invariants;
mod paper;
mod reference;
mod slices;
mod support;
