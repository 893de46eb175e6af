//! The constraints of infill points when only an external program knows them.
//!
//! The program cannot evaluate the thousands of candidates of a round, so kriging models of the criteria replace it
//! there: M. J. Sasena, P. Papalambros, P. Goovaerts, *Exploration of metamodeling sampling criteria for constrained
//! global optimization*, Engineering Optimization 34 (2002). Rounds are of two kinds (`Caution`), which alternate
//! once a feasible design is known; before, all are of the first kind. The first kind weights candidates by the
//! probability that they keep the constraints: its points lie near the edges of the feasible region and improve the
//! models there, where they are uncertain. The second kind takes the models' means as the constraints. The program
//! then evaluates each chosen point before the point gets samples. A point that breaks a constraint gets none: its
//! values refine the models of the next round. A recommended design is always one that was evaluated, so no model
//! decides whether it is feasible. The program is asked even in a problem without constraints: it may refuse a point,
//! and the next rounds learn from that where points can be simulated.

use std::sync::Arc;

use enrich::ExactCriteria;
use kriging::{Model, Prediction};
use ledger::{StreamDemand, StreamId};
use problem::Criteria;
use problem::formulation::{Design, Problem};
use problem::task::{Candidate, Inputs, Source};
use store::{EvaluationRow, InfillRow, Store};

use crate::doe;
use crate::infill::{MORE, bits, violation};
use crate::limits::{Caution, fitted};
use crate::state::VerifyPoint;

/// Whether only the program knows the constraints of a design, and whether it can be simulated at all.
#[must_use]
pub(crate) fn are_asked(problem: &Problem) -> bool {
    problem.gears().is_none()
}

/// Whether the program is asked for the constraints of an infill point.
pub(crate) fn is_asked(problem: &Problem, point: &InfillRow) -> bool {
    point.reason != MORE && are_asked(problem)
}

/// The request to a worker for a point's constraints before its samples: one evaluation, numbered
/// as the sample after the last one, so that its time is stored apart from theirs.
pub(crate) fn request(inputs: &Inputs, point: &VerifyPoint) -> StreamDemand<Arc<Source>> {
    let candidate = Candidate {
        evaluation: point.wanted,
        design: point.design.clone(),
        may_improve: true,
    };
    let source = Source::Candidates(vec![candidate]);
    let number = point.wanted..point.wanted + 1;
    StreamDemand {
        missing: std::iter::once(number.clone()).collect(),
        ..inputs.wanted(StreamId::point(point.number), source, number.end)
    }
}

/// The program's evaluation of a point, if there is one.
pub(crate) async fn evaluation(
    store: &Store,
    point: &InfillRow,
) -> Result<Option<EvaluationRow>, store::Error> {
    let stream = StreamId::point(point.number);
    Ok(store.evaluations(stream, 0).await?.into_iter().next())
}

/// The constraint violation of an evaluated point; `None` if it cannot be simulated.
pub(crate) fn violation_of(problem: &Problem, evaluation: &EvaluationRow) -> Option<f64> {
    let criteria = evaluation.criteria.clone().map(Criteria::new)?;
    Some(violation(problem, &criteria))
}

/// The criteria that the program gave for the design at `x`, of the DoE or an infill point.
pub async fn criteria_at(
    store: &Store,
    problem: &Problem,
    base: &Design,
    x: &[f64],
) -> Result<Option<Criteria>, store::Error> {
    let place = bits(x);
    for design in store.designs().await? {
        if bits(&design.x) == place {
            let rows = store.criteria().await?;
            let row = rows.into_iter().find(|row| row.design == design.design);
            let criteria = row.and_then(|row| doe::criteria_of(problem, base, &design, &row));
            if criteria.is_some() {
                return Ok(criteria);
            }
        }
    }
    for point in store.infill().await? {
        if bits(&point.x) == place
            && let Some(row) = evaluation(store, &point).await?
        {
            return Ok(row.criteria.map(Criteria::new));
        }
    }
    Ok(None)
}

/// Probability of keeping all constraints below which a design counts as infeasible.
const HARDLY: f64 = 0.01;

/// Models of the criteria, in their problem's order.
pub(crate) struct Models {
    /// `None` for a criterion that cannot be modelled, for example because of too few designs.
    models: Vec<Option<Model>>,
}

impl Models {
    /// Fits a model to each criterion at the evaluated designs.
    pub(crate) fn fit(problem: &Problem, evaluated: &[(Vec<f64>, Criteria)]) -> Self {
        let x: Vec<f64> = evaluated.iter().flat_map(|(x, _)| x).copied().collect();
        let exact = vec![0.0; evaluated.len()];
        let fit = |criterion: usize| {
            let values = evaluated.iter().map(|(_, all)| all.values()[criterion]);
            fitted(problem, &x, &values.collect::<Vec<_>>(), &exact)
        };
        Self {
            models: (0..problem.deterministic().len()).map(fit).collect(),
        }
    }

    /// The predicted constraint violation of a design. If `caution` asks for it, the result is instead the probability
    /// that the design keeps all constraints, with a violation only if that probability is below `HARDLY`. If a
    /// criterion has no model, the violation is zero, because the program evaluates the chosen points anyway.
    pub(crate) fn known(&self, problem: &Problem, x: &[f64], caution: Caution) -> ExactCriteria {
        let models = self.models.iter();
        let predicted = models.map(|model| Some(model.as_ref()?.predict(x)));
        let Some(predicted) = predicted.collect::<Option<Vec<Prediction>>>() else {
            return ExactCriteria::from(0.0);
        };
        let shifted = |deviations: f64| {
            let value = |one: &Prediction| one.mean + deviations * one.variance.max(0.0).sqrt();
            Criteria::new(predicted.iter().map(value).collect())
        };
        let means = shifted(0.0);
        let expected = violation(problem, &means);
        if caution == Caution::Safe {
            return ExactCriteria::from(expected);
        }
        let constraints = problem.constraints(&means);
        let moved = problem.constraints(&shifted(1.0));
        let each = constraints.iter().zip(moved).map(|(one, moved)| {
            let sd = (moved.value - one.value).abs();
            match sd > 0.0 {
                true => stats::normal_probability(-one.excess / sd),
                false => f64::from(u8::from(one.holds())),
            }
        });
        let holds: f64 = each.product();
        ExactCriteria {
            holds,
            ..ExactCriteria::from(if holds < HARDLY { expected } else { 0.0 })
        }
    }
}

#[cfg(test)]
mod tests {
    use problem::Campaign;

    use super::*;

    fn beam() -> Problem {
        let text = include_str!("../../../campaigns/cantilever/campaign.toml");
        Problem::new(Campaign::parse("campaign.toml", text).unwrap())
    }

    /// The area at `count` points of the box, which fill it evenly enough.
    fn evaluated(count: u32) -> Vec<(Vec<f64>, Criteria)> {
        let fraction = |i: u32, irrational: f64| (f64::from(i + 1) * irrational).fract();
        let place = |i: u32| {
            [
                1.0 + 3.0 * fraction(i, 0.7549),
                1.0 + 3.0 * fraction(i, 0.5698),
            ]
        };
        (0..count)
            .map(place)
            .map(|[w, t]| (vec![w, t], Criteria::new(vec![w * t])))
            .collect()
    }

    #[test]
    fn models_tell_feasible_designs_from_others_but_for_those_at_the_limit() {
        let problem = beam();
        assert!(are_asked(&problem));
        let models = Models::fit(&problem, &evaluated(30));
        let (mut feasible, mut others) = (0, 0);
        for (x, criteria) in evaluated(230).split_off(30) {
            let area = criteria.values()[0];
            let expected = models.known(&problem, &x, Caution::Safe).violation;
            if (area - 9.5).abs() > 0.05 {
                assert_eq!(expected > 0.0, area > 9.5, "{x:?}: {area}, {expected}");
                *(if area > 9.5 {
                    &mut others
                } else {
                    &mut feasible
                }) += 1;
            }
        }
        assert!(feasible > 50 && others > 10, "{feasible} {others}");
    }

    #[test]
    fn a_probable_round_looks_at_what_uncertain_models_hold_impossible_and_a_safe_one_does_not() {
        let problem = beam();
        let few = Models::fit(&problem, &evaluated(6));
        let (mut doubtful, mut hopeless) = (0, 0);
        for (x, _) in evaluated(230).split_off(30) {
            let safe = few.known(&problem, &x, Caution::Safe);
            let probable = few.known(&problem, &x, Caution::Probable);
            assert_eq!(safe.holds, 1.0);
            assert_eq!(probable.violation > 0.0, probable.holds < HARDLY, "{x:?}");
            doubtful += u32::from(safe.violation > 0.0 && probable.violation == 0.0);
            hopeless += u32::from(probable.violation > 0.0);
        }
        assert!(doubtful > 0 && hopeless > 0, "{doubtful} {hopeless}");
    }

    #[test]
    fn without_a_model_nothing_is_held_against_a_design() {
        let problem = beam();
        for known in [0, 1] {
            let models = Models::fit(&problem, &evaluated(known));
            let known = models.known(&problem, &[4.0, 4.0], Caution::Probable);
            assert_eq!((known.violation, known.holds), (0.0, 1.0));
        }
    }

    #[test]
    fn a_point_is_evaluated_before_its_samples_and_apart_from_them() {
        let problem = beam();
        let point = VerifyPoint {
            number: 1 << 27,
            design: Design::new(vec![2.0, 3.0]),
            wanted: 30,
            stored: std::collections::BTreeSet::new(),
            asks_criteria: true,
        };
        assert!(!point.is_complete());
        let inputs = Inputs::new(problem.campaign(), None);
        let wanted = request(&inputs, &point);
        assert_eq!(wanted.missing.len(), 1);
        assert_eq!(wanted.missing[0], 30..31);
        let Source::Candidates(candidates) = &*wanted.source else {
            panic!("{:?}", wanted.source);
        };
        assert_eq!((candidates.len(), candidates[0].evaluation), (1, 30));
    }
}
