//! Problems stated in a file, and optimiser runs on problems that are made to be hard.

mod measures;
mod problems;
mod stability;
mod statements;
