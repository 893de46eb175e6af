//! Integration tests of the gear simulator: published cases, the paper's designs, invariants,
//! refusals, a fuzz, an independent slice sum and convergence.

mod adversary;
mod convergence;
mod corrections;
mod fuzz;
mod general;
mod infeasible;
mod invariants;
mod laws;
mod manufacture;
mod paper;
mod reference;
mod slices;
mod spread;
mod support;
