//! The measures of a problem: that of its objective, and those that its constraints limit.

use stats::{IntervalEstimate, Samples};

use super::{Bound, Constraint, Quantity};
use crate::file::{Aim, Combination, ExternalSections, Load, Objective, Sampling};

/// The probability, given an estimate or a prediction, with which a measure must keep its limit.
const HOLDS: f64 = 0.95;

/// A measure of the samples of a design.
#[derive(Debug, Clone)]
pub struct ResponseMeasure {
    /// Its name, such as P90 or the name of a constraint, and its unit.
    pub quantity: Quantity,
    /// The response that is measured.
    pub response: Quantity,
    /// The indices of the responses from which a sample's number is computed.
    places: Vec<usize>,
    /// The settings that the measure of verification samples follows from.
    stated: Sampling,
    /// The settings for designs of the DoE and for models.
    searched: Sampling,
    limit: Option<Limit>,
}

/// The limit of a measure, as the file states it and as searches use it.
#[derive(Debug, Clone, Copy)]
struct Limit {
    stated: f64,
    searched: f64,
}

impl ResponseMeasure {
    /// The measure of a problem with one response.
    pub(super) fn of_one(response: Quantity, sampling: &Sampling) -> Self {
        let name = sampling.objective.name([&response.name, &response.unit]);
        let unit = match sampling.objective.is_probability() {
            true => "",
            false => &*response.unit,
        };
        Self {
            quantity: Quantity::new(&name, unit),
            response,
            places: vec![0],
            stated: sampling.clone(),
            searched: sampling.clone(),
            limit: None,
        }
    }

    /// The measure of a gear pair's objective over the cases of its load, and then the same measure of each case that
    /// has a limit.
    pub(super) fn of_cases(
        combined: Quantity,
        cases: &[Quantity],
        load: &Load,
        sampling: &Sampling,
    ) -> Vec<Self> {
        let mut objective = Self::of_one(combined, sampling);
        if let Some((several, places)) = load.combination() {
            objective.places = places;
            objective.stated.objective.response = Some(Combination::Several(several));
        }
        let limited = load.cases.iter().zip(cases).enumerate();
        let limited = limited.filter_map(|(place, (case, quantity))| {
            let limit = case.delta_ste_max_um?;
            let mut measure = Self::of_one(quantity.clone(), sampling);
            measure.quantity.name = format!("limited_{}", quantity.name).into();
            measure.places = vec![place];
            measure.limit = Some(Limit {
                stated: limit,
                searched: limit,
            });
            Some(measure)
        });
        std::iter::once(objective).chain(limited).collect()
    }

    /// The measure of the objective, and then those of the constraints, in the order of the file.
    pub(super) fn of_sections(sections: &ExternalSections, sampling: &Sampling) -> Vec<Self> {
        let of = |objective: &Objective| {
            let sampling = Sampling {
                objective: objective.clone(),
                ..sampling.clone()
            };
            let combination = objective.response.as_ref();
            let mut measure = Self::of_one(sections.response_of(combination), &sampling);
            if let Some(combination) = combination {
                let places = combination.places(&sections.responses);
                measure.places = places.expect("validation has found every response");
            }
            measure
        };
        let limited = sections.constraints.iter().filter_map(|section| {
            let stated = section.limited()?;
            let limit = section.limit_of_measure()?;
            let (searched, searched_limit) = stated.searched(limit);
            let mut measure = of(&stated);
            measure.quantity.name = section.name.clone().into();
            measure.searched.objective = searched;
            measure.limit = Some(Limit {
                stated: limit,
                searched: searched_limit,
            });
            Some(measure)
        });
        std::iter::once(of(&sampling.objective))
            .chain(limited)
            .collect()
    }

    /// The settings from which the measure of a design of the DoE, or of an infill point, is estimated. A limited
    /// probability is estimated as the equivalent percentile.
    #[must_use]
    pub const fn sampling(&self) -> &Sampling {
        &self.searched
    }

    /// The measure as a phrase: P99 of temperature, P(stress > 400 MPa).
    #[must_use]
    pub fn title(&self) -> String {
        self.title_of(&self.stated.objective)
    }

    fn title_of(&self, objective: &Objective) -> String {
        let Quantity { name, unit } = &self.response;
        let measure = objective.name([name, unit]);
        match objective.is_probability() {
            true => measure,
            false => format!("{measure} of {name}"),
        }
    }

    /// The number that each sample counts as. Failed samples are infinitely bad.
    #[must_use]
    pub fn values(&self, samples: &Samples) -> Vec<f64> {
        samples.rows().map(|row| self.value(row)).collect()
    }

    fn value(&self, row: &[f64]) -> f64 {
        if Samples::is_failed(row) {
            return self.stated.failed_sample();
        }
        let values = self.places.iter().map(|&place| row[place]);
        match &self.stated.objective.response {
            None | Some(Combination::One(_)) => row[self.places[0]],
            Some(Combination::Several(several)) => several.of(values),
        }
    }

    /// The measure of verification samples.
    ///
    /// # Errors
    ///
    /// Those of [`Measure::verified`](stats::Measure::verified).
    pub fn verified(&self, samples: &Samples) -> Result<IntervalEstimate, stats::Error> {
        self.stated.verified(&self.values(samples))
    }

    /// The difference of the measures of two designs, as [`Sampling::difference`].
    #[must_use]
    pub fn difference(&self, first: &Samples, second: &Samples) -> Option<IntervalEstimate> {
        let [first, second] = [first, second].map(|samples| self.values(samples));
        self.stated.difference(&first, &second)
    }

    /// Whether a measure is to be at most its limit, and not at least.
    #[must_use]
    pub fn is_upper(&self) -> bool {
        self.stated.objective.aim == Aim::Minimise
    }

    /// The limit of a constraint, as the file states it.
    #[must_use]
    pub fn limit(&self) -> Option<f64> {
        self.limit.map(|limit| limit.stated)
    }

    /// Whether a value of the measure keeps the limit as the file states it; true without a limit.
    #[must_use]
    pub fn keeps_limit(&self, value: f64) -> bool {
        self.limit.is_none_or(|limit| match self.is_upper() {
            true => value <= limit.stated,
            false => value >= limit.stated,
        })
    }

    /// The unit of the limit as the file states it; empty for a probability.
    #[must_use]
    pub fn limit_unit(&self) -> &str {
        match self.stated.objective.is_probability() {
            true => "",
            false => &self.response.unit,
        }
    }

    /// The confidence with which verification samples show that the measure keeps its limit: the greatest level of a
    /// one-sided interval within the limit, from 0.5 to 0.9999, where 0.5 stands for at most one half, and 0 if the
    /// measure itself is beyond the limit. `None` without a limit, or for too few samples.
    #[must_use]
    pub fn confidence(&self, samples: &Samples) -> Option<f64> {
        self.limit?;
        let values = self.values(samples);
        let holds = |level: f64| {
            let (low, high) = self
                .stated
                .verified_at(&values, 2.0 * level - 1.0)
                .ok()?
                .interval?;
            Some(self.keeps_limit(if self.is_upper() { high } else { low }))
        };
        let verified = self.stated.verified(&values).ok()?;
        if !self.keeps_limit(verified.value) {
            return Some(0.0);
        }
        // Without an interval, because the samples are too few for the level, the limit counts as not shown to hold.
        let (mut shown, mut open) = (0.5, 0.9999);
        holds(shown + 1e-3)?;
        if holds(open) == Some(true) {
            return Some(open);
        }
        while open - shown > 1e-4 {
            let level = 0.5 * (shown + open);
            match holds(level) {
                Some(true) => shown = level,
                _ => open = level,
            }
        }
        Some(shown)
    }

    /// The value by which a constraint is judged, given an estimate or prediction and its variance: the measure lies on
    /// the safe side of this value with a probability of 95 %.
    #[must_use]
    pub fn bound(&self, value: f64, variance: f64) -> f64 {
        value + stats::normal_quantile(self.safe_level()) * variance.max(0.0).sqrt()
    }

    /// The level of [`bound`](Self::bound) in the distribution of a prediction.
    #[must_use]
    pub fn safe_level(&self) -> f64 {
        if self.is_upper() { HOLDS } else { 1.0 - HOLDS }
    }

    /// The probability that the measure keeps its limit, given a prediction and its variance; `None` without a limit.
    #[must_use]
    pub fn probability(&self, value: f64, variance: f64) -> Option<f64> {
        let limit = self.limit?.searched;
        let room = if self.is_upper() {
            limit - value
        } else {
            value - limit
        };
        Some(match variance > 0.0 {
            true => stats::normal_probability(room / variance.sqrt()),
            false => f64::from(u8::from(room >= 0.0)),
        })
    }

    /// The constraint with this value; `None` without a limit.
    pub(super) fn constraint(&self, value: f64) -> Option<Constraint> {
        let name = self.title_of(&self.searched.objective);
        let unit = self.response.unit.clone();
        let limit = self.limit?.searched;
        Some(Constraint::new(name, unit, value, self.relation(), limit).relative())
    }

    /// The relation that the measure must have to its limit.
    #[must_use]
    pub fn relation(&self) -> Bound {
        match self.is_upper() {
            true => Bound::AtMost,
            false => Bound::AtLeast,
        }
    }
}
