//! A problem that is stated in the campaign file and simulated by a program of the user's.

use super::random::RandomInputs;
use super::space::{Source, Space};
use super::{Analysis, Bound, Constraint, Coordinate, Criteria, Quantity, ResponseMeasure};
use crate::file::{ConstraintSection, Domain, ExternalSections, Sampling};

/// Largest magnitude of a response. The squares of larger numbers, and sums of these, overflow.
const LARGEST: f64 = 1e100;

/// Checks that a statistic can be computed of this number. The error is a phrase without its subject.
pub(super) fn check_number(value: f64) -> Result<(), String> {
    if !value.is_finite() {
        return Err(format!("is {value}, which is not a number"));
    }
    if value.abs() > LARGEST {
        return Err(format!(
            "is {value:?}, but numbers beyond ±{LARGEST:?} have no variance in double precision"
        ));
    }
    Ok(())
}

/// The problem of an external campaign.
#[derive(Debug, Clone)]
pub(super) struct ExternalProblem {
    sections: ExternalSections,
}

impl ExternalProblem {
    pub(super) const fn new(sections: ExternalSections) -> Self {
        Self { sections }
    }

    pub(super) fn variables(&self) -> Vec<Quantity> {
        let variables = self.sections.variables.iter();
        variables
            .map(|variable| Quantity::new(&variable.name, &variable.unit))
            .collect()
    }

    /// The search space of all approaches: the variables that are not fixed.
    pub(super) fn space(&self) -> Space {
        let mut coordinates = Vec::new();
        let mut sources = Vec::new();
        for variable in &self.sections.variables {
            let (range, values) = match variable.domain() {
                Domain::Fixed(value) => {
                    sources.push(Source::Fixed(value));
                    continue;
                }
                Domain::Continuous(range) => (range, Vec::new()),
                Domain::Discrete(values) => ([values[0], values[values.len() - 1]], values),
            };
            sources.push(Source::Moved(coordinates.len()));
            coordinates.push(Coordinate {
                name: variable.name.clone().into(),
                unit: variable.unit.clone().into(),
                range,
                values,
            });
        }
        Space::new(coordinates, sources)
    }

    /// The constraints on deterministic responses.
    fn deterministic(&self) -> impl Iterator<Item = &ConstraintSection> {
        let constraints = self.sections.constraints.iter();
        constraints.filter(|section| section.measure.is_none())
    }

    /// The deterministic responses with constraints, then the measures with constraints.
    pub(super) fn criteria(&self) -> Vec<Quantity> {
        let limited = self.sections.constraints.iter().filter_map(|section| {
            let limited = section.limited()?;
            let response = self.sections.response_of(limited.response.as_ref());
            Some(Quantity::new(&section.name, &response.unit))
        });
        let of = |section: &ConstraintSection| Quantity::new(&section.name, &section.unit);
        self.deterministic().map(of).chain(limited).collect()
    }

    /// The deterministic responses with constraints, then the baseline if there is one.
    pub(super) fn responses(&self) -> Vec<Quantity> {
        let baseline = self.sections.responses.iter().filter(|one| one.baseline);
        let baseline = baseline.map(|one| Quantity::new(&one.name, &one.unit));
        let of = |section: &ConstraintSection| Quantity::new(&section.name, &section.unit);
        self.deterministic().map(of).chain(baseline).collect()
    }

    /// Whether searches on a model take the deterministic responses from models of their own.
    pub(super) fn are_modelled(&self) -> bool {
        self.deterministic().any(|section| !section.cheap)
    }

    pub(super) fn random(&self) -> Option<RandomInputs> {
        let sections = &self.sections;
        let variables: Vec<&str> = sections.variables.iter().map(|one| &*one.name).collect();
        RandomInputs::new(&sections.random, &sections.correlations, &variables)
    }

    pub(super) fn sampled(&self) -> Vec<Quantity> {
        let responses = self.sections.responses.iter();
        responses
            .map(|one| Quantity::new(&one.name, &one.unit))
            .collect()
    }

    pub(super) fn measures(&self, sampling: &Sampling) -> Vec<ResponseMeasure> {
        ResponseMeasure::of_sections(&self.sections, sampling)
    }

    /// Checks that this number can be a value of a sampled response. The error is a phrase without its subject.
    pub(super) fn check_sample(&self, place: usize, value: f64) -> Result<(), String> {
        check_number(value)?;
        let response = &self.sections.responses[place];
        let broken = match (response.min, response.max) {
            (Some(min), _) if value < min => Some(("below", "smallest", min, "min")),
            (_, Some(max)) if value > max => Some(("above", "largest", max, "max")),
            _ => None,
        };
        let Some((side, which, limit, key)) = broken else {
            return Ok(());
        };
        let unit = match &*response.unit {
            "" => String::new(),
            unit => format!(" {unit}"),
        };
        Err(format!(
            "is {value:?}{unit}, {side} the {which} plausible value {limit:?}{unit} ({key} of the response)"
        ))
    }

    pub(super) fn has_baseline(&self) -> bool {
        self.sections.responses.iter().any(|one| one.baseline)
    }

    /// The responses, which do not depend on the state.
    pub(super) fn responses_of(&self, analysis: &Analysis) -> Vec<f64> {
        let baseline = self.has_baseline().then_some(analysis.value);
        let criteria = analysis.criteria.values().iter().copied();
        criteria.chain(baseline).collect()
    }

    /// The analysis in the responses. Its value is NaN without a baseline.
    pub(super) fn analysis(&self, responses: &[f64]) -> Option<Analysis> {
        let count = self.deterministic().count();
        let (criteria, baseline) = responses.split_at_checked(count)?;
        Some(Analysis {
            value: baseline.first().copied().unwrap_or(f64::NAN),
            criteria: Criteria::new(criteria.to_vec()),
        })
    }

    /// The constraints on deterministic responses.
    pub(super) fn constraints(&self, criteria: &Criteria) -> Vec<Constraint> {
        let mut constraints = Vec::new();
        for (section, &value) in self.deterministic().zip(criteria.values()) {
            for (bound, limit) in [(Bound::AtLeast, section.min), (Bound::AtMost, section.max)] {
                let (name, unit) = (section.name.clone(), section.unit.clone());
                let constraint =
                    limit.map(|limit| Constraint::new(name, unit, value, bound, limit));
                constraints.extend(constraint.map(Constraint::relative));
            }
        }
        constraints
    }
}
