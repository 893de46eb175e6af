//! Figures that the paper prints (*Gears Design with Shape Uncertainties using Monte Carlo
//! Simulations and Kriging*, 2009), shared by the examples that are laid beside them. Variables are
//! those of `gear::paper::design`; ΔSTE in µm.

use gear::paper::FIGURE_7;

/// Table 1: variables; mean, standard deviation and P90 of ΔSTE over 500 samples.
pub(crate) const TABLE_1: [([f64; 6], [f64; 3]); 4] = [
    (FIGURE_7, [5.82, 0.41, 6.34]),
    ([0.00, 0.20, 1.02, 1.00, 0.90, 1.00], [6.22, 0.66, 7.06]),
    ([1.10, 1.00, 1.30, 1.40, 0.90, 0.90], [7.30, 0.44, 7.87]),
    ([0.40, -0.40, 1.70, 1.00, 0.90, 1.60], [6.66, 0.45, 7.24]),
];

/// Table 4: variables; ΔSTE under Archard's wear and P90.
pub(crate) const TABLE_4: [([f64; 6], [f64; 2]); 6] = [
    ([0.25, 1.37, 1.37, 0.85, 1.31, 0.80], [2.42, 3.03]),
    ([0.18, 0.69, 1.54, 1.01, 1.08, 1.05], [2.44, 3.07]),
    ([-0.21, 1.11, 0.90, 1.23, 1.61, 0.90], [2.46, 3.34]),
    ([-0.02, 1.10, 1.03, 0.81, 1.41, 1.00], [2.42, 3.21]),
    ([0.15, 0.71, 1.44, 1.07, 1.63, 1.16], [2.48, 2.88]),
    ([-0.12, -0.08, 1.25, 1.19, 1.63, 1.61], [2.45, 2.84]),
];

/// Figures 8, 9 and 10: variables, ΔSTE under Archard's wear where it is printed, and P90 over 500
/// samples. The caption of Figure 9 lost the sign of its first variable, which Table 5 has.
pub(crate) const OPTIMA: [([f64; 6], Option<f64>, f64); 3] = [
    ([0.20, 1.26, 1.44, 1.49, 1.27, 0.92], None, 3.37),
    ([-0.028, 0.86, 1.26, 1.32, 1.20, 0.81], Some(1.49), 2.64),
    ([-0.004, 0.37, 1.37, 1.51, 1.27, 0.87], None, 3.29),
];
