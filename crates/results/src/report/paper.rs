//! The figures that the paper prints, so that a campaign can be laid beside them: those of its gear
//! pairs, which the crate `gear` holds, and Table 5, which compares approaches.

pub use gear::paper::printed::*;

use problem::Approach;

/// A gap beyond this share of the paper's figure is marked.
pub(crate) const NOTABLE_GAP: f64 = 0.20;

/// `ours` over the `paper`'s figure, minus one; NaN where that has no meaning.
pub(crate) fn gap(ours: f64, paper: f64) -> f64 {
    match paper {
        0.0 => f64::NAN,
        _ => (ours - paper) / paper.abs(),
    }
}

/// A row of Table 5: the design that one approach found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ApproachRow {
    pub approach: Approach,
    /// x_p, x_r, ha0_p, ha0_r, hf0_p, hf0_r.
    pub variables: [f64; 6],
    /// The figure that the approach minimised, µm.
    pub criterion: f64,
    /// P90 from 500 samples, µm.
    pub p90_um: f64,
    /// The cost in simulator calls, in the paper's words.
    pub cost: &'static str,
    /// The figure (7 to 10) that shows the design and prints its constraints.
    pub figure: u8,
}

/// Table 5, in its order. All four designs are feasible.
pub const APPROACHES: [ApproachRow; 4] = [
    ApproachRow {
        approach: Approach::Nominal,
        variables: [0.49, 0.49, 1.20, 1.11, 1.00, 1.09],
        criterion: 0.38,
        p90_um: 6.38,
        cost: "1 per analysis",
        figure: 7,
    },
    ApproachRow {
        approach: Approach::Baseline,
        variables: [-0.028, 0.86, 1.26, 1.32, 1.20, 0.81],
        criterion: 1.49,
        p90_um: 2.64,
        cost: "2 per analysis",
        figure: 9,
    },
    ApproachRow {
        approach: Approach::Kriging,
        variables: [0.20, 1.26, 1.44, 1.49, 1.27, 0.92],
        criterion: 1.97,
        p90_um: 3.37,
        cost: "1 per analysis + DoE",
        figure: 8,
    },
    ApproachRow {
        approach: Approach::BestOfDoe,
        variables: [-0.004, 0.37, 1.37, 1.51, 1.27, 0.87],
        criterion: 2.69,
        p90_um: 3.29,
        cost: "DoE",
        figure: 10,
    },
];

/// The row of Table 5 for an approach, if the paper has it.
#[must_use]
pub fn approach(approach: Approach) -> Option<&'static ApproachRow> {
    APPROACHES.iter().find(|row| row.approach == approach)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_are_relative_to_the_paper() {
        assert_eq!(gap(3.0, 2.0), 0.5);
        assert_eq!(gap(1.0, 2.0), -0.5);
        assert!(gap(1.0, 0.0).is_nan());
    }

    /// Figures 7 to 10 and Table 5 print the same designs.
    #[test]
    fn table_5_and_the_figure_captions_agree() {
        for row in &APPROACHES {
            let design = printed(row.figure).expect("table 5 names figures 7 to 10 only");
            assert_eq!(design.variables[..6], row.variables);
            assert_eq!(design.criterion_um, row.criterion);
            assert_eq!(design.p90_um, Some(row.p90_um));
        }
        assert_eq!(PRELIMINARY[0].variables, APPROACHES[0].variables);
    }
}
