//! Integration tests of the gear simulator: published cases, the paper's designs, invariants, a fuzz, an independent
//! slice sum and convergence. The stability atlas of the crate `lab` has the refusals and the limits of the model.

mod adversary;
mod convergence;
mod corrections;
mod coupled;
mod each_gear;
mod fuzz;
mod general;
mod invariants;
mod laws;
mod manufacture;
mod paper;
mod reference;
mod slices;
mod spread;
mod support;
mod tip_rule;
mod undercut;
mod wear;
