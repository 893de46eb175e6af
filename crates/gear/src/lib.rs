//! One helical involute gear pair in, design criteria and static transmission error out.
//!
//! [`Pair::new`] computes the zero-backlash geometry of two gears cut by rack tools, the
//! compliance of their teeth and the unworn analysis; every refusal names its reason. From the
//! pair follow contact ratio, specific sliding, interference, root stress and Hertz pressure, the
//! transmission error of the pair worn by Archard's law ([`Pair::archard`]), and as many randomly
//! worn versions as wanted ([`Pair::sampler`]).
//!
//! The loaded contact is one of thin slices that do not feel each other. As slice and place on
//! the path of contact are tied along a contact line, the integral over the face is an integral
//! over the path, and a wear sample costs one prefix sum over the path plus a few Newton steps at
//! each mesh phase.
//!
//! Units: mm, N, MPa, N·mm, rad; transmission errors in µm. Arrays are [pinion, gear].
//!
//! The crate is pure: no files, clock, environment or global state, and the same input gives the
//! same bits on one machine.
//!
//! # What is left out, and when that matters
//! - **Finite elements**: teeth are beams on an elastic half-plane (`weber-banaschek`) or beams
//!   alone (`hertz-beam`). Thin rims, webs and shafts need more.
//! - **Coupling of slices** along the face: matters for wide faces with strongly uneven load, and
//!   at the ends of the face, where a real tooth is softer.
//! - **Dynamics, friction, misalignment, pitch errors**: the transmission error is static, for
//!   parallel axes. Near a resonance the dynamic one differs.
//! - **Contact outside the line of action** of tips that engage early under load: `hertz-beam` is
//!   stiff enough not to show it; with soft teeth it lengthens the path of contact.

mod contact;
mod error;
mod field;
mod geometry;
mod input;
mod involute;
mod outline;
mod pair;
mod path;
mod sampler;
mod tooth;

#[cfg(test)]
mod tests;

pub use error::{Error, Infeasible, InputError, UnknownName};
pub use geometry::{Geometry, Interference, Sliding, normal_module};
pub use input::{
    Discretisation, Kernel, Material, Member, PairInput, Size, TipRule, ToothModel, Wear,
};
pub use outline::{Placement, gear_outline, mesh_placement};
pub use pair::{Analysis, Pair, RootStress, Worn};
pub use sampler::{Sampler, WearProfile};
