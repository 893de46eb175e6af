//! The infill criteria: the value of an observation, µm.

mod knowledge;
mod quantile;
mod reinterpolated;

use crate::state::{Rows, SampledDesign};
use crate::surrogate::Surrogate;
use crate::{Criterion, Error, Options};

/// A criterion, prepared for one state of a model and its incumbents.
///
/// Both values are expected falls of the same quantity in µm, so that a new design can be compared with
/// more samples at an existing one.
pub(crate) trait InfillCriterion: Sync {
    /// The value of [`Options::samples_new`] samples at a new design.
    fn new_design(&self, x: &[f64], baseline: f64) -> f64;

    /// The value of [`Options::samples_more`] further samples at a sampled design.
    fn more_samples(&self, row: &SampledDesign) -> f64;
}

/// Prepares the criterion that the options name. `incumbents` are the rows to improve on.
pub(crate) fn prepare<'a>(
    model: &'a Surrogate,
    rows: &Rows,
    incumbents: &[usize],
    options: &'a Options,
) -> Result<Box<dyn InfillCriterion + 'a>, Error> {
    let incumbents: Vec<&SampledDesign> = incumbents.iter().map(|&i| &rows.sampled[i]).collect();
    Ok(match options.criterion {
        Criterion::ExpectedQuantileImprovement => Box::new(quantile::QuantileImprovement::new(
            model,
            &incumbents,
            options,
        )),
        Criterion::ReinterpolatedExpectedImprovement => Box::new(
            reinterpolated::ReinterpolatedImprovement::new(model, &incumbents, options)?,
        ),
        Criterion::KnowledgeGradient => Box::new(knowledge::KnowledgeGradient::new(
            model,
            &incumbents,
            options,
        )),
    })
}

/// The least of some values; infinite if there are none.
fn least(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::belief::tests::expectation;
    use crate::state::State;

    /// A noisy bowl of one variable with 15 designs.
    fn bowl() -> State {
        let sampled = (0..15).map(|i| {
            let x = f64::from(i) / 14.0;
            let noise = 0.05 * (37.0 * f64::from(i)).sin();
            SampledDesign {
                x: vec![x],
                samples: 30,
                response: 2.0 + (x - 0.4).powi(2) + noise,
                variance: 0.0025,
                violation: 0.0,
                baseline: 0.0,
            }
        });
        State {
            sampled: sampled.collect(),
            ..State::default()
        }
    }

    /// The value of more samples is the expected fall, over their possible results, of the
    /// criterion's own quantity at the design, or of the lowest mean.
    #[test]
    fn more_samples_are_valued_by_the_quantity_that_the_criterion_improves() {
        let bounds = cmaes::Bounds::unit(1).unwrap();
        for criterion in Criterion::ALL {
            let options = Options {
                criterion,
                logarithm: false,
                samples_more: 10,
                ..Options::new(bounds.clone())
            };
            let rows = Rows::new(&bowl(), &options).unwrap();
            let all: Vec<usize> = (0..rows.sampled.len()).collect();
            let model = Surrogate::fit(&rows, &all, &options).unwrap().remove(0);
            let z = options.quantile_z;
            let quantity = |model: &Surrogate, x: &[f64]| {
                let belief = model.belief(x, 0.0);
                match criterion {
                    Criterion::ExpectedQuantileImprovement => belief.quantile(z),
                    _ => belief.mean,
                }
            };
            let lowest =
                |model: &Surrogate| least(rows.sampled.iter().map(|row| quantity(model, &row.x)));
            let before = lowest(&model);
            let prepared = prepare(&model, &rows, &all, &options).unwrap();
            let mut positive = 0;
            for row in &rows.sampled {
                let belief = model.belief(&row.x, 0.0);
                let deviation = (belief.sd.powi(2) + model.noise(10)).sqrt();
                let integral = expectation(500, |u| {
                    let y = belief.mean + deviation * u;
                    let after = model.observed(&row.x, y, 10).unwrap();
                    match criterion {
                        Criterion::KnowledgeGradient => before - lowest(&after),
                        _ => (before - quantity(&after, &row.x)).max(0.0),
                    }
                });
                let value = prepared.more_samples(row);
                positive += usize::from(value > 1e-4);
                let error = (value - integral).abs();
                assert!(
                    error < 1e-6,
                    "{criterion:?} at {:?}: {value} {integral}",
                    row.x
                );
            }
            assert!(positive > 2, "{criterion:?}");
        }
    }
}
