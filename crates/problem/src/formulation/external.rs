//! A problem that is stated in the campaign file and simulated by a program of the user's.

use super::random::RandomInputs;
use super::space::{Source, Space};
use super::{Analysis, Constraint, Coordinate, Criteria, Quantity};
use crate::file::{Domain, ExternalSections};

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
pub(super) struct External {
    sections: ExternalSections,
}

impl External {
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

    pub(super) fn criteria(&self) -> Vec<Quantity> {
        let constraints = self.sections.constraints.iter();
        constraints
            .map(|constraint| Quantity::new(&constraint.name, &constraint.unit))
            .collect()
    }

    /// The criteria, then the baseline if there is one.
    pub(super) fn responses(&self) -> Vec<Quantity> {
        let baseline = self.has_baseline().then(|| self.sampled());
        self.criteria().into_iter().chain(baseline).collect()
    }

    pub(super) fn random(&self) -> Option<RandomInputs> {
        let sections = &self.sections;
        let variables: Vec<&str> = sections.variables.iter().map(|one| &*one.name).collect();
        RandomInputs::new(&sections.random, &sections.correlations, &variables)
    }

    pub(super) fn sampled(&self) -> Quantity {
        let response = &self.sections.response;
        Quantity::new(&response.name, &response.unit)
    }

    /// Checks that this number can be a value of the response. The error is a phrase without its subject.
    pub(super) fn check_sample(&self, value: f64) -> Result<(), String> {
        check_number(value)?;
        let response = &self.sections.response;
        let broken = match (response.min, response.max) {
            (Some(min), _) if value < min => Some(("below", "smallest", min, "response.min")),
            (_, Some(max)) if value > max => Some(("above", "largest", max, "response.max")),
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
            "is {value:?}{unit}, {side} the {which} plausible value {limit:?}{unit} ({key})"
        ))
    }

    pub(super) const fn has_baseline(&self) -> bool {
        self.sections.response.baseline
    }

    /// The responses, which do not depend on the state.
    pub(super) fn responses_of(&self, analysis: &Analysis) -> Vec<f64> {
        let baseline = self.has_baseline().then_some(analysis.value);
        let criteria = analysis.criteria.values().iter().copied();
        criteria.chain(baseline).collect()
    }

    /// The analysis in the responses. Its value is NaN without a baseline.
    pub(super) fn analysis(&self, responses: &[f64]) -> Option<Analysis> {
        let count = self.sections.constraints.len();
        let (criteria, baseline) = responses.split_at_checked(count)?;
        Some(Analysis {
            value: baseline.first().copied().unwrap_or(f64::NAN),
            criteria: Criteria::new(criteria.to_vec()),
        })
    }

    pub(super) fn constraints(&self, criteria: &Criteria) -> Vec<Constraint> {
        let mut constraints = Vec::new();
        for (section, &value) in self.sections.constraints.iter().zip(criteria.values()) {
            let name = section.name.clone();
            let unit = section.unit.clone();
            let scaled = |constraint: Constraint| Constraint {
                scale: match constraint.limit.abs() {
                    0.0 => 1.0,
                    limit => limit,
                },
                ..constraint
            };
            if let Some(min) = section.min {
                let constraint = Constraint::at_least(name.clone(), unit.clone(), value, min);
                constraints.push(scaled(constraint));
            }
            if let Some(max) = section.max {
                constraints.push(scaled(Constraint::at_most(name, unit, value, max)));
            }
        }
        constraints
    }
}
