//! The figures that the paper prints of its gear pairs.
//!
//! Source of every constant: *Gears Design with Shape Uncertainties using Monte Carlo Simulations
//! and Kriging*, 2009. The table, figure or section stands beside each. Lengths are in mm, angles
//! in degrees, stresses in MPa, transmission errors in µm; the six coefficients have no unit.

/// Points of the paper's design of experiments (section III.C).
pub const DESIGNS: usize = 3000;
/// Designs of it that the paper's simulator could analyse (section III.C).
pub const SIMULABLE: usize = 2175;
/// Monte Carlo samples per design (section III.C).
pub const SAMPLES: usize = 30;
/// Monte Carlo samples behind an accurate percentile (Tables 1, 4 and 5).
pub const ACCURATE_SAMPLES: usize = 500;

/// A row of Table 1: a preliminary design and its statistics from 500 samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PreliminaryRow {
    /// x_p, x_r, ha0_p, ha0_r, hf0_p, hf0_r.
    pub variables: [f64; 6],
    /// Mean of ΔSTE, µm.
    pub mean_um: f64,
    /// Standard deviation of ΔSTE, µm.
    pub sd_um: f64,
    /// Estimated 90th percentile of ΔSTE, µm.
    pub p90_um: f64,
    /// Variance of that estimate with 30 samples, µm² (Table 2).
    pub p90_variance_um2: f64,
    /// Standard deviation of that estimate with 30 samples, µm (Table 2).
    pub p90_sd_um: f64,
}

/// Tables 1 and 2.
pub const PRELIMINARY: [PreliminaryRow; 4] = [
    PreliminaryRow {
        variables: [0.49, 0.49, 1.20, 1.11, 1.00, 1.09],
        mean_um: 5.82,
        sd_um: 0.41,
        p90_um: 6.34,
        p90_variance_um2: 0.010,
        p90_sd_um: 0.10,
    },
    PreliminaryRow {
        variables: [0.00, 0.20, 1.02, 1.00, 0.90, 1.00],
        mean_um: 6.22,
        sd_um: 0.66,
        p90_um: 7.06,
        p90_variance_um2: 0.027,
        p90_sd_um: 0.16,
    },
    PreliminaryRow {
        variables: [1.10, 1.00, 1.30, 1.40, 0.90, 0.90],
        mean_um: 7.30,
        sd_um: 0.44,
        p90_um: 7.87,
        p90_variance_um2: 0.012,
        p90_sd_um: 0.11,
    },
    PreliminaryRow {
        variables: [0.40, -0.40, 1.70, 1.00, 0.90, 1.60],
        mean_um: 6.66,
        sd_um: 0.45,
        p90_um: 7.24,
        p90_variance_um2: 0.013,
        p90_sd_um: 0.11,
    },
];

/// A column pair of Table 3: statistics of a response over the feasible designs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ResponseRow {
    /// Mean, µm.
    pub mean_um: f64,
    /// Least value, µm.
    pub min_um: f64,
    /// Greatest value, µm.
    pub max_um: f64,
}

/// Table 3: ΔSTE without wear, ΔSTE with Archard's wear, and the estimated P90.
pub const RESPONSES: [ResponseRow; 3] = [
    ResponseRow {
        mean_um: 4.83,
        min_um: 0.49,
        max_um: 42.70,
    },
    ResponseRow {
        mean_um: 7.31,
        min_um: 1.47,
        max_um: 37.75,
    },
    ResponseRow {
        mean_um: 8.20,
        min_um: 2.12,
        max_um: 39.67,
    },
];

/// A row of Table 4: one of six designs of similar ΔSTE under Archard's wear.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SimilarRow {
    /// x_p, x_r, ha0_p, ha0_r, hf0_p, hf0_r.
    pub variables: [f64; 6],
    /// ΔSTE with Archard's wear, µm.
    pub delta_ste_archard_um: f64,
    /// P90 from 500 samples, µm.
    pub p90_um: f64,
}

/// Table 4.
pub const SIMILAR: [SimilarRow; 6] = [
    SimilarRow {
        variables: [0.25, 1.37, 1.37, 0.85, 1.31, 0.80],
        delta_ste_archard_um: 2.42,
        p90_um: 3.03,
    },
    SimilarRow {
        variables: [0.18, 0.69, 1.54, 1.01, 1.08, 1.05],
        delta_ste_archard_um: 2.44,
        p90_um: 3.07,
    },
    SimilarRow {
        variables: [-0.21, 1.11, 0.90, 1.23, 1.61, 0.90],
        delta_ste_archard_um: 2.46,
        p90_um: 3.34,
    },
    SimilarRow {
        variables: [-0.02, 1.10, 1.03, 0.81, 1.41, 1.00],
        delta_ste_archard_um: 2.42,
        p90_um: 3.21,
    },
    SimilarRow {
        variables: [0.15, 0.71, 1.44, 1.07, 1.63, 1.16],
        delta_ste_archard_um: 2.48,
        p90_um: 2.88,
    },
    SimilarRow {
        variables: [-0.12, -0.08, 1.25, 1.19, 1.63, 1.61],
        delta_ste_archard_um: 2.45,
        p90_um: 2.84,
    },
];

/// A design that the paper prints in full, from the caption of Figures 6 to 10.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PrintedDesign {
    /// The figure's number.
    pub figure: u8,
    /// Description of the design.
    pub name: &'static str,
    /// The eleven variables in the order of Equation (1): x_p, x_r, ha0_p, ha0_r, hf0_p, hf0_r
    /// (in modules), ρa_p, ρa_r, ρf_p, ρf_r (mm), β0 (degrees).
    pub variables: [f64; 11],
    /// r_c.
    pub contact_ratio: f64,
    /// g_s.
    pub specific_slip: f64,
    /// σ_vm, MPa.
    pub von_mises_mpa: f64,
    /// F, MPa.
    pub pressure_mpa: f64,
    /// The design's criterion, as the caption has it.
    pub criterion: &'static str,
    /// The criterion's value, µm.
    pub criterion_um: f64,
    /// P90 from 500 samples, µm, where the paper gives it.
    pub p90_um: Option<f64>,
}

/// The last five of [`PrintedDesign::variables`], which Figures 7 to 10 and the tables share
/// (section IV.B).
pub const FROZEN: [f64; 5] = [0.0003, 0.19, 0.64, 0.23, 30.0];

/// Figures 6 to 10, in order.
///
/// Designs 8 to 10 keep the tip and fillet radii and the helix angle of Figure 7 (section IV.B).
/// The caption of Figure 9 prints x_p = 0.028; Table 5 prints −0.028, and only the latter gives the
/// printed g_s and r_c, so it is the one used here. The P90 of Figure 7's design is the one of
/// Table 5 (6.38; Table 1 has 6.34 for the same design).
pub const PRINTED: [PrintedDesign; 5] = [
    PrintedDesign {
        figure: 6,
        name: "start of an optimisation",
        variables: [-0.2, 0.2, 1.5, 1.4, 1.3, 1.17, 0.2, 0.1, 0.05, 0.1, 10.0],
        contact_ratio: 2.0,
        specific_slip: 592.0,
        von_mises_mpa: 1556.0,
        pressure_mpa: 11683.0,
        criterion: "ΔSTE without wear",
        criterion_um: 2.45,
        p90_um: None,
    },
    PrintedDesign {
        figure: 7,
        name: "optimum without wear",
        variables: [
            0.49, 0.49, 1.20, 1.11, 1.00, 1.09, 0.0003, 0.19, 0.64, 0.23, 30.0,
        ],
        contact_ratio: 1.66,
        specific_slip: 1.47,
        von_mises_mpa: 443.0,
        pressure_mpa: 938.0,
        criterion: "ΔSTE without wear",
        criterion_um: 0.38,
        p90_um: Some(6.38),
    },
    PrintedDesign {
        figure: 8,
        name: "kriging design",
        variables: [
            0.20, 1.26, 1.44, 1.49, 1.27, 0.92, 0.0003, 0.19, 0.64, 0.23, 30.0,
        ],
        contact_ratio: 1.71,
        specific_slip: 2.00,
        von_mises_mpa: 558.0,
        pressure_mpa: 1189.0,
        criterion: "kriging mean of P90",
        criterion_um: 1.97,
        p90_um: Some(3.37),
    },
    PrintedDesign {
        figure: 9,
        name: "Archard’s design",
        variables: [
            -0.028, 0.86, 1.26, 1.32, 1.20, 0.81, 0.0003, 0.19, 0.64, 0.23, 30.0,
        ],
        contact_ratio: 1.62,
        specific_slip: 2.00,
        von_mises_mpa: 631.0,
        pressure_mpa: 1115.0,
        criterion: "ΔSTE with Archard’s wear",
        criterion_um: 1.49,
        p90_um: Some(2.64),
    },
    PrintedDesign {
        figure: 10,
        name: "empirical Monte Carlo design",
        variables: [
            -0.004, 0.37, 1.37, 1.51, 1.27, 0.87, 0.0003, 0.19, 0.64, 0.23, 30.0,
        ],
        contact_ratio: 1.72,
        specific_slip: 1.96,
        von_mises_mpa: 614.0,
        pressure_mpa: 1228.0,
        criterion: "P90 from 30 samples",
        criterion_um: 2.69,
        p90_um: Some(3.29),
    },
];

/// The printed design of a figure, if that figure shows one (6 to 10).
#[must_use]
pub fn printed(figure: u8) -> Option<&'static PrintedDesign> {
    PRINTED.iter().find(|design| design.figure == figure)
}

/// The six variables of the tables with [`FROZEN`].
#[must_use]
pub const fn with_frozen(variables: [f64; 6]) -> [f64; 11] {
    let [x1, x2, ha1, ha2, hf1, hf2] = variables;
    let [tip1, tip2, root1, root2, beta] = FROZEN;
    [x1, x2, ha1, ha2, hf1, hf2, tip1, tip2, root1, root2, beta]
}

/// A table row or figure of the paper that prints a ΔSTE.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Place {
    /// Row of Table 1, from 0.
    Preliminary(usize),
    /// Row of Table 4, from 0.
    Similar(usize),
    /// Figure 6 to 10.
    Figure(u8),
}

/// A statistic of ΔSTE that the paper prints.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// ΔSTE without wear.
    Unworn,
    /// ΔSTE with Archard's wear.
    Archard,
    /// Mean of ΔSTE with random wear.
    Mean,
    /// Standard deviation of ΔSTE with random wear.
    Sd,
    /// 90th percentile of ΔSTE with random wear.
    P90,
}

impl Place {
    /// Every place, Table 1 first.
    pub fn all() -> impl Iterator<Item = Self> {
        (0..PRELIMINARY.len())
            .map(Self::Preliminary)
            .chain((0..SIMILAR.len()).map(Self::Similar))
            .chain(PRINTED.iter().map(|design| Self::Figure(design.figure)))
    }

    /// The number that names the random streams of the place's samples; 1 to 5 are a campaign's own
    /// optima.
    #[must_use]
    pub const fn number(self) -> u64 {
        match self {
            Self::Preliminary(row) => 101 + row as u64,
            Self::Similar(row) => 401 + row as u64,
            Self::Figure(figure) => 600 + figure as u64,
        }
    }

    /// The eleven variables, as in [`PrintedDesign`].
    ///
    /// # Panics
    ///
    /// When the paper has no such row or figure.
    #[must_use]
    pub fn variables(self) -> [f64; 11] {
        match self {
            Self::Preliminary(row) => with_frozen(PRELIMINARY[row].variables),
            Self::Similar(row) => with_frozen(SIMILAR[row].variables),
            Self::Figure(figure) => {
                let design = printed(figure);
                design.expect("figures 6 to 10 print a design").variables
            }
        }
    }

    /// The printed statistics of ΔSTE, µm. The P90 of Figure 7 is left out, being Table 1 #1's, and
    /// so are the criteria of Figures 8 and 10, a kriging prediction and a selected estimate.
    #[must_use]
    pub fn values(self) -> Vec<(Quantity, f64)> {
        match self {
            Self::Preliminary(row) => {
                let row = &PRELIMINARY[row];
                let values = [row.mean_um, row.sd_um, row.p90_um];
                [Quantity::Mean, Quantity::Sd, Quantity::P90]
                    .into_iter()
                    .zip(values)
                    .collect()
            }
            Self::Similar(row) => {
                let row = &SIMILAR[row];
                vec![
                    (Quantity::Archard, row.delta_ste_archard_um),
                    (Quantity::P90, row.p90_um),
                ]
            }
            Self::Figure(figure) => {
                let Some(design) = printed(figure) else {
                    return Vec::new();
                };
                let mut values = match figure {
                    6 | 7 => return vec![(Quantity::Unworn, design.criterion_um)],
                    9 => vec![(Quantity::Archard, design.criterion_um)],
                    _ => Vec::new(),
                };
                values.extend(design.p90_um.map(|p90| (Quantity::P90, p90)));
                values
            }
        }
    }
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Preliminary(row) => write!(f, "Table 1 #{}", row + 1),
            Self::Similar(row) => write!(f, "Table 4 #{}", row + 1),
            Self::Figure(figure) => write!(f, "Figure {figure}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The paper's own Equation (14) links Tables 1 and 2: a mistyped figure would break it.
    #[test]
    fn table_2_follows_from_table_1_by_equation_14() {
        let k = 30.0_f64;
        let factor = 1.0 / k + 1.28 * 1.28 / 2.0 * (1.0 - ((k - 3.0) / (k - 1.0)).sqrt());
        for row in &PRELIMINARY {
            let variance = row.sd_um * row.sd_um * factor;
            // SD is printed to two figures (±0.005 of about 0.45, so ±2.4 % of the variance) and
            // the variance to three decimals.
            assert!(
                (variance - row.p90_variance_um2).abs() < 0.0005 + 0.025 * variance,
                "{variance} against {}",
                row.p90_variance_um2
            );
            // Equation (8), both inputs rounded to 0.005.
            assert!((row.mean_um + 1.28 * row.sd_um - row.p90_um).abs() < 0.02);
        }
    }

    #[test]
    fn other_figures_print_nothing() {
        assert!(printed(5).is_none() && printed(11).is_none());
    }
}
