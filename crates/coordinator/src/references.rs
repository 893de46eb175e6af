//! The designs that the paper prints, as points to be sampled beside the campaign's own optima.

use campaign::formulation::Problem;
use campaign::plan::VerifyPoint;
use campaign::{Frozen, Variables};
use report::paper;

/// Which table or figure of the paper a point belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// Row of Table 1, from 0.
    Preliminary(usize),
    /// Row of Table 4, from 0.
    Similar(usize),
    /// Figure 7 to 10.
    Figure(u8),
}

impl Place {
    /// Every place of which the paper prints a percentile.
    pub fn all() -> impl Iterator<Item = Self> {
        (0..paper::PRELIMINARY.len())
            .map(Self::Preliminary)
            .chain((0..paper::SIMILAR.len()).map(Self::Similar))
            .chain((7..=10).map(Self::Figure))
    }

    /// The point's name in the store.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::Preliminary(row) => format!("table-1-{}", row + 1),
            Self::Similar(row) => format!("table-4-{}", row + 1),
            Self::Figure(figure) => format!("figure-{figure}"),
        }
    }

    /// The number that names the point's random streams; 1 to 5 are the approaches'.
    #[must_use]
    pub fn number(self) -> u64 {
        match self {
            Self::Preliminary(row) => 101 + row as u64,
            Self::Similar(row) => 401 + row as u64,
            Self::Figure(figure) => 600 + u64::from(figure),
        }
    }

    /// The printed design.
    #[must_use]
    pub fn variables(self) -> Variables {
        match self {
            Self::Preliminary(row) => {
                Variables::robust(&paper::PRELIMINARY[row].variables, &FROZEN)
            }
            Self::Similar(row) => Variables::robust(&paper::SIMILAR[row].variables, &FROZEN),
            Self::Figure(figure) => printed(figure),
        }
    }
}

/// The five variables that all designs of the paper's tables share (section IV.B).
const FROZEN: Frozen = Frozen {
    tip_radius_mm: [0.0003, 0.19],
    root_radius_mm: [0.64, 0.23],
    helix_angle_deg: 30.0,
};

/// The design of Figure 6 to 10.
///
/// # Panics
///
/// When the paper has no such figure.
#[must_use]
pub fn printed(figure: u8) -> Variables {
    let design = paper::printed(figure).expect("figures 6 to 10 print a design");
    let [
        x_p,
        x_r,
        ha_p,
        ha_r,
        hf_p,
        hf_r,
        tip_p,
        tip_r,
        root_p,
        root_r,
        beta,
    ] = design.variables;
    Variables {
        profile_shift: [x_p, x_r],
        tool_addendum: [ha_p, ha_r],
        tool_dedendum: [hf_p, hf_r],
        tip_radius_mm: [tip_p, tip_r],
        root_radius_mm: [root_p, root_r],
        helix_angle_deg: beta,
    }
}

/// The points to be sampled for `problem`: none unless the campaign compares itself with the
/// paper, and none that its pair cannot simulate.
#[must_use]
pub fn points(problem: &Problem) -> Vec<VerifyPoint> {
    if !problem.campaign().report.compare_with_paper {
        return Vec::new();
    }
    Place::all()
        .map(|place| VerifyPoint {
            name: place.name(),
            number: place.number(),
            variables: place.variables(),
            wanted: problem.campaign().verify.samples,
            stored: std::collections::BTreeSet::new(),
        })
        .filter(|point| problem.pair(&point.variables).is_ok())
        .collect()
}
