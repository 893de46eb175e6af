//! The limits of measures of samples in a round of infill, judged by models of these measures.

use enrich::SampledDesign;
use kriging::{Data, FitOptions, Model};
use problem::formulation::Problem;

use crate::doe;

/// Models of the measures that constraints limit, in their order.
pub(crate) struct LimitedModels {
    /// `None` for a measure that cannot be modelled.
    models: Vec<Option<Model>>,
}

/// How an infill point is chosen among designs that may break a limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Caution {
    /// Its value is multiplied by the probability that it keeps all limits, so that points lie about the limits and the
    /// models become better there (M. Schonlau, *Computer Experiments and Global Optimization*, thesis, University of
    /// Waterloo, 1997).
    Probable,
    /// It keeps all limits on samples with the probability that a recommended design needs, and the other constraints
    /// by the means of their models.
    Safe,
}

impl Caution {
    /// Rounds alternate: one improves the models, and the next observes the best design that they allow.
    pub(crate) fn of_round(round: usize) -> Self {
        if round.is_multiple_of(2) {
            Self::Probable
        } else {
            Self::Safe
        }
    }
}

impl LimitedModels {
    /// Fits a model to each measure from its estimates, with their variances, at each design.
    pub(crate) fn fit<'a>(
        problem: &Problem,
        estimated: impl Iterator<Item = (&'a SampledDesign, &'a [(f64, f64)])> + Clone,
    ) -> Self {
        let campaign = problem.campaign();
        let freedom = campaign.sampling.degrees_of_freedom();
        let d = problem.dimension();
        let fit = |number: usize| {
            let (mut x, mut y, mut own, mut samples) =
                (Vec::new(), Vec::new(), Vec::new(), Vec::new());
            for (of, estimates) in estimated.clone() {
                if let Some((value, variance)) = estimates.get(number)
                    && value.is_finite()
                {
                    x.extend_from_slice(&of.x);
                    y.push(*value);
                    own.push(*variance);
                    samples.push(f64::from(of.samples.max(1)));
                }
            }
            let smooth = campaign.limit_noise().variances(
                &x,
                d,
                own.clone(),
                &samples,
                freedom,
                campaign.seed,
            );
            let noise = smooth.unwrap_or(own);
            fitted(problem, &x, &y, &noise)
        };
        Self {
            models: (0..problem.limited().len()).map(fit).collect(),
        }
    }

    /// The values by which the constraints are judged at a sampled design. A measure without a model, or that is
    /// infinite because samples failed, is judged by its own estimate.
    pub(crate) fn bounds(
        &self,
        problem: &Problem,
        x: &[f64],
        estimates: &[(f64, f64)],
    ) -> Vec<f64> {
        let of = self.models.iter().zip(estimates).map(|(model, own)| {
            let model = model.as_ref().filter(|_| own.0.is_finite());
            let predicted = model.map(|model| model.predict(x));
            predicted.map_or(*own, |predicted| (predicted.mean, predicted.variance))
        });
        doe::bounds(problem, &of.collect::<Vec<_>>())
    }

    /// The factor of a new point's value. Measures without a model are not counted.
    pub(crate) fn factor(&self, problem: &Problem, x: &[f64], caution: Caution) -> f64 {
        let limited = problem.limited().iter().zip(&self.models);
        let each = limited.filter_map(|(measured, model)| {
            let predicted = model.as_ref()?.predict(x);
            match caution {
                Caution::Probable => measured.probability(predicted.mean, predicted.variance),
                Caution::Safe => {
                    let bound = measured.bound(predicted.mean, predicted.variance);
                    // The bound already includes the variance.
                    measured.probability(bound, 0.0)
                }
            }
        });
        each.product()
    }
}

/// A model of a constrained quantity with these values and variances at the designs `x`, row after row; `None` if no
/// model can be fitted to the data.
pub(crate) fn fitted(
    problem: &Problem,
    x: &[f64],
    y: &[f64],
    noise_variance: &[f64],
) -> Option<Model> {
    let options = FitOptions {
        kernel: problem.campaign().kriging.kernel,
        seed: problem.campaign().seed,
        starts: 5,
        ..FitOptions::default()
    };
    let d = problem.dimension();
    let data = Data {
        x,
        d,
        y,
        noise_variance,
    };
    kriging::fit(&data, &options).ok()
}
