//! The program.

mod modelling;
