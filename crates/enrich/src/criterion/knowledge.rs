//! Knowledge gradient.

use kriging::Conditional;

use super::InfillCriterion;
use crate::Options;
use crate::belief::{cdf, pdf};
use crate::state::SampledDesign;
use crate::surrogate::Surrogate;

/// The most designs compared.
const COMPARED: usize = 20;

/// [`Criterion::KnowledgeGradient`](crate::Criterion::KnowledgeGradient).
///
/// More samples are considered at the compared designs only: at the others they seldom change which
/// mean is lowest.
pub(super) struct KnowledgeGradient<'a> {
    model: &'a Surrogate,
    options: &'a Options,
    /// The incumbents with the lowest means, in rising order.
    incumbents: Vec<Incumbent>,
}

/// An incumbent with its mean.
struct Incumbent {
    x: Vec<f64>,
    /// The mean on the modelled scale.
    mean: f64,
    conditional: Conditional,
}

impl<'a> KnowledgeGradient<'a> {
    pub(super) fn new(
        model: &'a Surrogate,
        incumbents: &[&SampledDesign],
        options: &'a Options,
    ) -> Self {
        let mean = |row: &&SampledDesign| model.mean_above(&row.x, row.baseline);
        let mut ordered: Vec<(f64, &SampledDesign)> =
            incumbents.iter().map(|row| (mean(row), *row)).collect();
        ordered.sort_by(|a, b| a.0.total_cmp(&b.0));
        ordered.truncate(COMPARED);
        let compared = ordered.into_iter().map(|(mean, row)| Incumbent {
            x: row.x.clone(),
            mean,
            conditional: model.conditional(&row.x),
        });
        Self {
            model,
            options,
            incumbents: compared.collect(),
        }
    }

    /// The expected fall of the lowest mean by samples at `x`. `new` is the mean at `x` if it is a
    /// new design: it is then a candidate, too.
    fn value(&self, x: &Conditional, new: Option<f64>, samples: u32) -> f64 {
        let change = |of: &Conditional| self.model.mean_change(of, x, samples);
        let incumbents = self.incumbents.iter();
        let means = incumbents.map(|one| (one.mean, change(&one.conditional)));
        let lines: Vec<(f64, f64)> = means.chain(new.map(|mean| (mean, change(x)))).collect();
        // A new design may have the lowest mean already before it is observed.
        let lowest = self
            .incumbents
            .first()
            .map_or(f64::INFINITY, |one| one.mean);
        let least = new.map_or(lowest, |mean| lowest.min(mean));
        let fall = knowledge_gradient(&lines) + (lowest - least).max(0.0);
        // To first order, a fall of a logarithm is a fall of the response in proportion to it.
        if self.model.is_logarithm() {
            fall * least.exp()
        } else {
            fall
        }
    }
}

impl InfillCriterion for KnowledgeGradient<'_> {
    fn new_design(&self, x: &[f64], baseline: f64) -> f64 {
        let conditional = self.model.conditional(x);
        let mean = conditional.prediction.mean + self.model.shift(baseline);
        self.value(&conditional, Some(mean), self.options.samples_new)
    }

    fn more_samples(&self, row: &SampledDesign) -> f64 {
        let compared = self.incumbents.iter().find(|one| one.x == row.x);
        compared.map_or(0.0, |one| {
            self.value(&one.conditional, None, self.options.samples_more)
        })
    }
}

/// The knowledge gradient min(a) − E min(a + bZ) ≥ 0 with Z standard normal: means `a` of the
/// candidates and their changes `b` by one standard deviation of the observation.
///
/// The minimum over the lines aᵢ + bᵢ z is concave and piecewise linear; between neighbouring lines
/// of its lower envelope, at z = c, the slope changes by Δb, and each such corner adds
/// |Δb| (φ(c) − |c| Φ(−|c|)) (Frazier et al., section 3).
fn knowledge_gradient(lines: &[(f64, f64)]) -> f64 {
    let mut lines = lines.to_vec();
    // The lower envelope meets the lines by falling slope from left to right. Of lines with equal
    // slopes only the lowest matters.
    lines.sort_by(|p, q| q.1.total_cmp(&p.1).then(p.0.total_cmp(&q.0)));
    lines.dedup_by(|later, earlier| later.1 == earlier.1);
    let crossing = |p: (f64, f64), q: (f64, f64)| (q.0 - p.0) / (p.1 - q.1);
    let mut envelope: Vec<(f64, f64)> = Vec::new();
    let mut corners: Vec<f64> = Vec::new();
    for line in lines {
        while let Some(&last) = envelope.last() {
            let corner = crossing(last, line);
            if corners.last().is_some_and(|&before| corner <= before) {
                envelope.pop();
                corners.pop();
            } else {
                corners.push(corner);
                break;
            }
        }
        envelope.push(line);
    }
    corners
        .iter()
        .zip(envelope.windows(2))
        .map(|(corner, pair)| {
            let c = corner.abs();
            (pair[0].1 - pair[1].1) * (pdf(c) - c * cdf(-c)).max(0.0)
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::belief::tests::expectation;

    #[test]
    fn the_knowledge_gradient_is_its_integral() {
        for lines in [
            vec![(0.0, 0.0), (0.1, 0.5)],
            vec![(0.0, 0.2), (0.1, 0.5), (0.05, -0.3), (2.0, 0.1), (0.3, 0.5)],
            vec![(0.2, 0.4), (0.2, 0.4)],
        ] {
            let least = lines.iter().map(|l| l.0).fold(f64::INFINITY, f64::min);
            let integral = least
                - expectation(200_000, |z| {
                    let after = lines.iter().map(|(a, b)| a + b * z);
                    after.fold(f64::INFINITY, f64::min)
                });
            let formula = knowledge_gradient(&lines);
            assert!(formula >= 0.0);
            assert!((formula - integral).abs() < 1e-8, "{formula} {integral}");
        }
    }
}
