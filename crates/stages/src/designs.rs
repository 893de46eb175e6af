//! The designs of the DoE: made, enlarged, and read.

use anyhow::Context as _;
use problem::formulation::Problem;
use store::DesignRow;

/// Makes the DoE, or the designs missing beside the `existing` ones, which stay as they are.
///
/// # Errors
///
/// The errors of [`check_growth`]; nothing else for a validated campaign.
pub fn make(problem: &Problem, existing: &[DesignRow]) -> anyhow::Result<Vec<DesignRow>> {
    let campaign = problem.campaign();
    let options = doe::Options {
        seed: campaign.seed,
        ..doe::Options::default()
    };
    anyhow::ensure!(
        campaign.doe.table.is_none(),
        "the designs of doe.table have not been read"
    );
    let n = campaign.doe.designs as usize;
    let own = (0..).zip(&campaign.doe.points);
    let own = own.map(|(design, x)| DesignRow {
        design,
        x: x.clone(),
    });
    let own: Vec<DesignRow> = own.collect();
    if existing.is_empty() && own.len() == n {
        return Ok(own);
    }
    let first = if existing.is_empty() { &own } else { existing };
    let method = campaign.doe.method;
    let design = if first.is_empty() {
        method.design(n, problem.dimension(), &options)?
    } else {
        method.enlarge(&held(problem, first), n, &options)?
    };
    let own = own.iter().skip(existing.len()).cloned();
    let made = (first.len()..n).map(|index| DesignRow {
        design: index as u64,
        x: problem.free_point(design.point(index)),
    });
    Ok(own.chain(made).collect())
}

/// Checks whether [`make`] can add the missing designs to the `existing` ones. The check comes
/// before a store takes over a campaign that has grown, because that cannot be undone.
///
/// # Errors
///
/// A design outside of the campaign's bounds, or more designs than the campaign wants.
pub fn check_growth(problem: &Problem, existing: &[DesignRow]) -> anyhow::Result<()> {
    let campaign = problem.campaign();
    let n = campaign.doe.designs as usize;
    // Without designs, or with all of them, there is nothing to enlarge.
    if existing.is_empty() || existing.len() == n {
        return Ok(());
    }
    let method = campaign.doe.method;
    let checked = method.check_enlarge(&held(problem, existing), n, campaign.seed);
    checked.with_context(|| {
        format!(
            "doe.designs is {n}, but the {} designs that the store holds cannot grow to that by \
             the method {method}; the store is unchanged",
            existing.len()
        )
    })
}

/// The designs that a store holds, in the unit box of the campaign's bounds.
#[must_use]
pub fn held(problem: &Problem, existing: &[DesignRow]) -> doe::Design {
    doe::Design {
        n: existing.len(),
        d: problem.dimension(),
        points: existing
            .iter()
            .flat_map(|row| problem.unit_point(&row.x))
            .collect(),
    }
}

/// Number of designs above which the discrepancy, whose cost grows with its square, is not
/// computed.
const MEASURED_DESIGNS: usize = 20_000;

/// How evenly the `existing` designs fill the box of the bounds, in words: their smallest distance
/// and their centred discrepancy, in parts of the box's edges. `None` for fewer than two designs.
#[must_use]
pub fn evenness(problem: &Problem, existing: &[DesignRow]) -> Option<String> {
    if existing.len() < 2 {
        return None;
    }
    let design = held(problem, existing);
    let mut text = format!("smallest distance {:.4}", design.min_distance());
    if design.n <= MEASURED_DESIGNS {
        text += &format!(", centred discrepancy {:.5}", design.centred_discrepancy());
    }
    Some(text)
}

#[cfg(test)]
mod tests {
    use problem::Campaign;

    use super::*;

    fn problem(method: doe::Method, designs: u32) -> Problem {
        let mut campaign = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
        campaign.doe.designs = designs;
        campaign.doe.method = method;
        Problem::new(campaign)
    }

    /// Designs in the variables' units, as a store holds them: the last digits of the unit box are
    /// lost.
    #[test]
    fn designs_of_every_method_grow_again_and_again() {
        for method in doe::Method::ALL {
            let mut rows: Vec<DesignRow> = Vec::new();
            for n in [30, 40, 52] {
                let problem = problem(method, n);
                check_growth(&problem, &rows).unwrap();
                let added = make(&problem, &rows).unwrap();
                assert_eq!(added[0].design, rows.len() as u64);
                rows.extend(added);
                assert_eq!(rows.len(), n as usize, "{method}");
                // A complete DoE needs no check.
                check_growth(&problem, &rows).unwrap();
                assert!(make(&problem, &rows).is_err(), "nothing is missing");
                let said = evenness(&problem, &rows).unwrap();
                let design = held(&problem, &rows);
                let expected = [design.min_distance(), design.centred_discrepancy()];
                let numbers: Vec<f64> = said
                    .split(|c: char| !c.is_ascii_digit() && c != '.')
                    .filter_map(|word| word.parse().ok())
                    .collect();
                for (found, expected) in numbers.iter().zip(expected) {
                    assert!((found - expected).abs() < 1e-4, "{said}");
                }
                assert_eq!(numbers.len(), 2, "{said}");
            }
        }
    }

    #[test]
    fn own_designs_come_first_and_stay_when_the_doe_grows() {
        let own = |designs: u32, count: usize| {
            let mut campaign = problem(doe::Method::Maximin, designs).campaign().clone();
            let middle = problem(doe::Method::Maximin, 30).free_point(&[0.5; 6]);
            campaign.doe.points = (0..count)
                .map(|number| {
                    let mut x = middle.clone();
                    x[0] += 1e-3 * number as f64;
                    x
                })
                .collect();
            Problem::new(campaign)
        };
        let of = |rows: &[DesignRow]| -> Vec<Vec<f64>> {
            rows.iter().map(|row| row.x.clone()).collect()
        };
        let few = own(20, 3);
        let rows = make(&few, &[]).unwrap();
        assert_eq!(rows.len(), 20);
        assert_eq!(of(&rows[..3]), few.campaign().doe.points);
        assert!((0..20).eq(rows.iter().map(|row| row.design)));
        let more = make(&own(25, 3), &rows).unwrap();
        assert!((20..25).eq(more.iter().map(|row| row.design)));
        // A DoE may have no other designs, and a larger one may come later.
        let all = own(5, 5);
        assert_eq!(of(&make(&all, &[]).unwrap()), all.campaign().doe.points);
        let mut unread = all.campaign().clone();
        unread.doe.table = Some("points.csv".to_owned());
        assert!(make(&Problem::new(unread), &[]).is_err());
    }

    #[test]
    fn growth_that_cannot_be_is_refused_beforehand() {
        let rows = make(&problem(doe::Method::Maximin, 20), &[]).unwrap();
        let larger = problem(doe::Method::Maximin, 30);
        let refused = |problem: &Problem, rows: &[DesignRow]| {
            format!("{:#}", check_growth(problem, rows).unwrap_err())
        };
        // A file that somebody edited: beyond the bounds.
        let mut outside = rows.clone();
        outside[4].x[1] = 7.0;
        let said = refused(&larger, &outside);
        assert!(
            said.contains("doe.designs is 30") && said.contains("point 4"),
            "{said}"
        );
        let said = refused(&problem(doe::Method::Maximin, 19), &rows);
        assert!(said.contains("19 points requested"), "{said}");
        let said = refused(&problem(doe::Method::Sobol, 30), &rows);
        assert!(
            said.contains("method sobol") && said.contains("sequence"),
            "{said}"
        );
    }
}
