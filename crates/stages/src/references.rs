//! The designs that the paper prints, as points to be sampled beside the campaign's own optima.

use gear::paper::printed::Place;
use problem::formulation::{Design, Problem};

use crate::state::VerifyPoint;

/// The name of a printed design's samples in the store.
#[must_use]
pub fn name(place: Place) -> String {
    match place {
        Place::Preliminary(row) => format!("table-1-{}", row + 1),
        Place::Similar(row) => format!("table-4-{}", row + 1),
        Place::Figure(figure) => format!("figure-{figure}"),
    }
}

/// The printed design.
#[must_use]
pub fn design(place: Place) -> Design {
    Design::new(place.variables().to_vec())
}

/// The points to be sampled for `problem`: none unless the campaign compares itself with the
/// paper, and none that its pair cannot simulate.
#[must_use]
pub fn points(problem: &Problem) -> Vec<VerifyPoint> {
    let gears = problem.gears();
    let Some(gears) = gears.filter(|_| problem.campaign().compares_with_paper()) else {
        return Vec::new();
    };
    // The paper prints no percentile for Figure 6.
    Place::all()
        .filter(|place| *place != Place::Figure(6))
        .map(|place| VerifyPoint {
            number: place.number(),
            design: design(place),
            wanted: problem.campaign().verify.first(),
            stored: std::collections::BTreeSet::new(),
            asks_criteria: false,
        })
        .filter(|point| gears.pair(&point.design).is_ok())
        .collect()
}
