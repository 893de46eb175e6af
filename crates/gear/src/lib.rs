//! One helical involute gear pair in, design criteria and static transmission error out.
//!
//! [`Pair::new`] computes the geometry of two gears cut by rack tools, the
//! compliance of their teeth and the unworn analysis; every refusal names its reason. From the
//! pair follow contact ratio, specific sliding, interference, root stress and Hertz pressure, the
//! transmission error of the pair worn by Archard's law ([`Pair::archard`]), and any number of randomly
//! worn versions, with perfect flanks ([`Pair::sampler`]) or with the scatter of manufacture
//! ([`Pair::sampler_with`]). [`UnloadedPair`] gives the results that need no contact in a fraction of the time.
//! [`Pair::with_corrections`] is for flanks with [`Corrections`],
//! [`Pair::converged`] is the reference solution, [`rating`] holds ISO 6336's nominal figures for
//! comparison, and [`inspection`] the dimensions of the data sheet.
//!
//! # Method
//! With `coupled`, the model to design with, contact lines are divided into cells that feel each other;
//! `coupled` describes it, and [`model_error`] says how far each model is from finite elements.
//!
//! The loaded contact of the other models is one of thin slices that do not feel each other (or, with
//! `whole-face-beam`, of whole teeth: see `whole_face`). A slice at s on the path of
//! contact carries w = max(0, δ − g(s))/q(s) per mm of contact line, q the compliance of the pair
//! and g the material missing from both flanks along the normal, and the deflection δ balances the
//! load, Σ_j ∫ w dz = F_bt over the pairs j in contact. As slice and place are tied along a contact
//! line, s = s_in + φ + j p_bt − z tan β_b, the integral over the face is an integral over the path,
//! and a wear sample costs one prefix sum over the path plus a few Newton steps at each mesh phase.
//! With `weber-banaschek`, as with `coupled`, contact goes on beyond the ends of the path (`beyond`).
//! 1/q and g are linear in each cell of the path; their product and the ends of the contact inside a
//! cell are integrated exactly, and nodes and phases lie on the kinks. The transmission error is
//! δ/cos β_b, and ΔSTE its range over one base pitch.
//!
//! # Cost and error of a discretisation
//! Errors of ΔSTE against [`Pair::converged`] in %, median and 95th percentile over 200 random
//! feasible designs of a box of wide profile shifts and tool heights (20 and 22 teeth, β = 30°),
//! and times on one core, with `hertz-beam` / `weber-banaschek`:
//!
//! | cells × phases | unworn | random wear | new design, µs | sample, µs |
//! |---|---|---|---|---|
//! | 24 × 12 | 0.30, 0.95 / 0.26, 0.79 | 0.19, 0.50 / 0.22, 0.59 | 77 / 150 | 4.4 / 10 |
//! | 32 × 16 | 0.17, 0.55 / 0.14, 0.44 | 0.11, 0.31 / 0.13, 0.37 | 84 / 160 | 5.1 / 11 |
//! | 48 × 24 | 0.08, 0.27 / 0.06, 0.18 | 0.05, 0.16 / 0.06, 0.16 | 97 / 189 | 6.3 / 13 |
//! | **64 × 32** | 0.04, 0.17 / 0.04, 0.10 | 0.02, 0.09 / 0.04, 0.10 | 111 / 213 | 7.6 / 14 |
//! | 128 × 64 | 0.01, 0.04 / 0.01, 0.03 | 0.006, 0.03 / 0.01, 0.03 | 166 / 316 | 13 / 22 |
//! | 256 × 128 | 0.002, 0.01 / 0.003, 0.008 | 0.001, 0.007 / 0.003, 0.007 | 269 / 525 | 22 / 38 |
//! | plain 64 × 21 sum | 1.51, 5.52 / 0.17, 0.47 | 0.51, 2.59 / 0.13, 0.40 | 824 / 1270 | 6.2 / 9.7 |
//!
//! In the same run the default grid errs with `prismatic-beam` by 0.02, 0.12 unworn and 0.01, 0.13 worn
//! and takes 7.4 µs, and with `whole-face-beam` by 0.02, 0.12 and 0.01, 0.15 and takes 2.7 µs.
//!
//! The plain sum ([`PlainSum`]) leaves out the drawing of its random field. The default is 64 × 32.
//! `coordinator tradeoff` measures the whole table on the machine where it runs, and draws it.
//!
//! # Example
//! ```
//! use gear::{
//!     Corrections, Discretisation, Material, Member, Pair, PairInput, ReliefShape, Size, TipRelief,
//!     TipRule, ToothModel,
//! };
//!
//! let input = PairInput {
//!     teeth: [23, 37],
//!     size: Size::NormalModule(2.0),
//!     pressure_angle: 20_f64.to_radians(),
//!     helix_angle: 0.0,
//!     face_width: [25.0; 2],
//!     profile_shift: [0.2, 0.1],
//!     tool_addendum: [1.25; 2],
//!     tool_dedendum: [1.0; 2],
//!     tip_radius: [0.1; 2],
//!     root_radius: [0.6; 2],
//!     tip_diameter: [None; 2],
//!     hub_radius: [None; 2],
//!     tooth_model: ToothModel::WeberBanaschek,
//!     tip_rule: TipRule::AsCut,
//!     pinion_torque: 100e3,
//!     material: [Material {
//!         youngs_modulus_mpa: 206e3,
//!         poisson_ratio: 0.3,
//!     }; 2],
//! };
//! let bare = Pair::new(&input, &Discretisation::default())?;
//! let relief = TipRelief { amount: 0.006, length: 2.0, shape: ReliefShape::Linear };
//! let corrections = Corrections::default()
//!     .with_tip_relief(Member::Pinion, relief)
//!     .with_tip_relief(Member::Gear, relief);
//! let relieved = Pair::with_corrections(&input, &corrections, &Discretisation::default())?;
//! assert!(relieved.unworn().delta_ste_um < bare.unworn().delta_ste_um);
//! # Ok::<(), gear::Error>(())
//! ```
//!
//! # Conventions
//! Units: mm, N, MPa, N·mm, rad; transmission errors in µm. Arrays are [pinion, gear]. The crate is
//! pure: no files, clock, environment or global state, and the same input gives the same bits on one
//! machine.
//!
//! # What is left out, and when that matters
//! - **Thin rims, webs and shafts** need finite elements: bodies are solid.
//! - **Coupling of slices** with all models but `coupled`: without it ΔSTE differs from finite elements by 19 %
//!   in the median at best, and is zero at an integer overlap ratio, where that of finite elements is not. Teeth
//!   are beams on an elastic half-plane (`weber-banaschek`) or beams alone (`hertz-beam`).
//! - **Load history in the compliance**: with `weber-banaschek` the contact's approach is that of the
//!   greatest load that the unworn pair carries at s. Wear moves load, but the approach changes only
//!   by the logarithm of it: a load three times as great makes the pair 5 % stiffer.
//! - **Dynamics, friction, pitch errors**: the transmission error is static. Near a resonance the dynamic
//!   one differs. [`Scatter`] covers slopes of profiles and helices, the same on all teeth of a gear, the misalignment
//!   of the shafts and the amounts of tip relief; no other deviation of manufacture.
//! - **Contact beyond the ends of the path**, of tips that engage early under load, with the models of the
//!   paper: their teeth are so stiff that it hardly shows.
//! - **Feedback of wear on itself**: wear follows the unworn pressure, as for the first
//!   stretch of a gear's life; deep wear spreads the load and would grow more evenly.

#![warn(missing_docs)]

mod accuracy;
mod analysis;
mod balance;
mod beyond;
mod cell_index;
mod chebyshev;
mod converged;
mod corrections;
mod coupled;
mod crowned;
mod elasticity;
mod error;
mod field;
mod fillet;
mod geometry;
mod input;
pub mod inspection;
mod involute;
mod manufacture;
mod mesh;
mod outline;
mod pair;
pub mod paper;
mod path;
mod periodic;
mod plain;
mod quadrature;
pub mod rating;
mod root;
mod root_stress;
mod sampler;
mod slices;
mod station;
mod tooth;
mod trochoid;
mod unloaded;
mod unworn;
mod vectors;
mod wear;
mod whole_face;

// Unit tests share the module of general pairs with the integration tests, which call this crate `gear`.
#[cfg(test)]
extern crate self as gear;
#[cfg(test)]
#[path = "../tests/it/general.rs"]
mod general;
#[cfg(test)]
mod properties;
#[cfg(test)]
mod tests;

pub use accuracy::{Range, model_error};
pub use analysis::Analysis;
pub use converged::ConvergedPair;
pub use corrections::{Corrections, ReliefShape, TipRelief};
pub use error::{Error, Infeasibility};
pub use geometry::{Geometry, Interference, Sliding, normal_module, sum_profile_shift};
pub use input::{
    Discretisation, InputError, Kernel, LocalAmount, Material, Member, PairInput, Rack, Size,
    TipRule, ToothModel, Wear, WearLaw,
};
pub use manufacture::{FlankClass, Scatter, TOLERANCE_IN_SD};
pub use outline::{Placement, ProfilePoint, gear_outline, mesh_placement, tooth_profile};
pub use pair::Pair;
pub use plain::PlainSum;
pub use root_stress::RootStress;
pub use sampler::{Sampler, WearProfile, draw_coefficients};
pub use unloaded::UnloadedPair;
pub use wear::{FlankWear, WornPair};
