//! The problem formulations: from a point of the design space to criteria and constraints.
//!
//! A [`Problem`] names its variables, the deterministic responses of a design and the constraints on
//! them. Everything that samples, models and optimises works with lists of numbers, [`Design`] and
//! [`Criteria`], in the problem's order.
//!
//! [`gears`] is the problem of the paper. Its deterministic problem ((2)–(3)) moves eleven variables,
//! the problems with wear ((6)–(7), (22), (23)) the first six of them. The number of teeth is a
//! setting, the module (or the centre distance) follows from the others.

use std::borrow::Cow;

use crate::Campaign;
use crate::simulator::{Analysis, State};

mod approach;
mod constraint;
mod design;
pub mod gears;

pub use approach::Approach;
pub use constraint::{Bound, Constraint};
pub use design::{Criteria, Design};
pub use gears::{GearCriteria, GearVariables};

/// A variable of a problem.
#[derive(Debug, Clone, PartialEq)]
pub struct Variable {
    /// Its name, with its unit at the end.
    pub name: Cow<'static, str>,
    /// `[low, high]` if the DoE moves it.
    pub range: Option<[f64; 2]>,
}

/// A quantity that a deterministic analysis gives.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Quantity {
    /// Its name, as in exported columns.
    pub name: Cow<'static, str>,
    /// Its unit; empty for a number without one.
    pub unit: Cow<'static, str>,
}

impl Quantity {
    const fn of(name: &'static str, unit: &'static str) -> Self {
        Self {
            name: Cow::Borrowed(name),
            unit: Cow::Borrowed(unit),
        }
    }
}

/// What a campaign designs: variables, criteria and constraints.
#[derive(Debug, Clone)]
pub struct Problem {
    campaign: Campaign,
    variables: Vec<Variable>,
    /// The places of the variables that the DoE moves.
    free: Vec<usize>,
    base: Design,
    pub(crate) gears: gears::Gears,
}

impl Problem {
    /// The problem that `campaign` states.
    ///
    /// # Panics
    ///
    /// Never for a validated campaign: names and sizes were checked before.
    #[must_use]
    pub fn new(campaign: Campaign) -> Self {
        let variables = gears::variables(&campaign);
        let is_free = |&index: &usize| variables[index].range.is_some();
        Self {
            free: (0..variables.len()).filter(is_free).collect(),
            variables,
            base: gears::base(&campaign),
            gears: gears::Gears::new(&campaign),
            campaign,
        }
    }

    /// The campaign that states the problem.
    #[must_use]
    pub const fn campaign(&self) -> &Campaign {
        &self.campaign
    }

    /// All variables.
    #[must_use]
    pub fn variables(&self) -> &[Variable] {
        &self.variables
    }

    /// The names of the variables that the DoE moves and the models take.
    pub fn free_names(&self) -> impl Iterator<Item = &str> {
        self.free.iter().map(|&index| &*self.variables[index].name)
    }

    /// How many variables the DoE moves.
    #[must_use]
    pub fn dimension(&self) -> usize {
        self.free.len()
    }

    /// How many variables the optimiser of an approach moves.
    #[must_use]
    pub fn dimension_of(&self, approach: Approach) -> usize {
        match approach {
            Approach::NoWear => self.variables.len(),
            _ => self.dimension(),
        }
    }

    /// The values that the campaign file gives to the variables that the DoE leaves alone; those that
    /// it moves are 0.
    #[must_use]
    pub const fn base(&self) -> &Design {
        &self.base
    }

    /// What `design` has where the DoE leaves variables alone; those that it moves are 0.
    #[must_use]
    pub fn base_of(&self, design: &Design) -> Design {
        self.design(&vec![0.0; self.dimension()], design)
    }

    /// The design with the values `x` of the variables that the DoE moves, and those of `base`
    /// elsewhere.
    #[must_use]
    pub fn design(&self, x: &[f64], base: &Design) -> Design {
        let mut values = base.values().to_vec();
        for (&index, &x) in self.free.iter().zip(x) {
            values[index] = x;
        }
        Design::new(values)
    }

    /// The values of the variables that the DoE moves.
    #[must_use]
    pub fn free_values(&self, design: &Design) -> Vec<f64> {
        let values = design.values();
        self.free.iter().map(|&index| values[index]).collect()
    }

    /// The values at `unit` in the unit cube of the variables that the DoE moves.
    #[must_use]
    pub fn free_point(&self, unit: &[f64]) -> Vec<f64> {
        let ranges = self.free_ranges().zip(unit);
        ranges.map(|(range, &unit)| scale(range, unit)).collect()
    }

    /// The inverse of [`Self::free_point`].
    #[must_use]
    pub fn unit_point(&self, x: &[f64]) -> Vec<f64> {
        let ranges = self.free_ranges().zip(x);
        ranges
            .map(|([low, high], x)| (x - low) / (high - low))
            .collect()
    }

    /// `[low, high]` of the variables that the DoE moves.
    pub fn free_ranges(&self) -> impl Iterator<Item = [f64; 2]> {
        self.variables.iter().filter_map(|variable| variable.range)
    }

    /// The design at `unit` in the unit cube of an approach's variables; none if there is none.
    #[must_use]
    pub fn point(&self, approach: Approach, unit: &[f64], base: &Design) -> Option<Design> {
        match approach {
            Approach::NoWear => self.full_point(unit).ok(),
            _ => Some(self.design(&self.free_point(unit), base)),
        }
    }

    /// What constraints are set on, in the order of [`Criteria`].
    #[must_use]
    pub fn criteria(&self) -> &[Quantity] {
        &gears::CRITERIA
    }

    /// The deterministic responses of a design, as they are stored and exported.
    #[must_use]
    pub fn responses(&self) -> &[Quantity] {
        &gears::RESPONSES
    }

    /// The response of this name.
    #[must_use]
    pub fn response(&self, responses: &[f64], name: &str) -> Option<f64> {
        let place = self.responses().iter().position(|r| r.name == name)?;
        responses.get(place).copied()
    }

    /// The responses that the analyses of all states make, in the order of
    /// [`responses`](Self::responses).
    #[must_use]
    pub fn responses_of(&self, nominal: &Analysis, baseline: &Analysis) -> Vec<f64> {
        gears::responses(nominal, baseline)
    }

    /// Whether these numbers can be the responses of a design.
    ///
    /// # Errors
    ///
    /// A sentence: which response cannot be.
    pub fn check_responses(&self, responses: &[f64]) -> Result<(), String> {
        let expected = self.responses().len();
        if responses.len() != expected {
            let found = responses.len();
            return Err(format!("has {found} responses of a design, not {expected}"));
        }
        gears::check(responses)
    }

    /// The analysis of a design in one state from its responses; none if the responses are not those
    /// of this problem.
    #[must_use]
    pub fn analysis(&self, design: &Design, responses: &[f64], state: State) -> Option<Analysis> {
        gears::analysis(responses, state, self.normal_module(design).ok()?)
    }

    /// Every constraint, with how far a design is from breaking it.
    #[must_use]
    pub fn constraints(&self, criteria: &Criteria) -> Vec<Constraint> {
        gears::constraints(&self.campaign, &criteria.gears())
    }

    /// The sum of the relative violations in the paper's (5), and of the interferences in modules.
    ///
    /// Zero on the feasible side including its edge; [`Problem::is_feasible`] is strict.
    #[must_use]
    pub fn violation(&self, criteria: &Criteria) -> f64 {
        let relative = |constraint: &Constraint| constraint.excess.max(0.0) / constraint.scale;
        self.constraints(criteria).iter().map(relative).sum()
    }

    /// Whether a design satisfies every constraint of (3) or (7), with their strict inequalities.
    #[must_use]
    pub fn is_feasible(&self, criteria: &Criteria) -> bool {
        self.constraints(criteria).iter().all(Constraint::holds)
    }

    /// The penalised objective (5).
    #[must_use]
    pub fn penalised(&self, criterion_um: f64, violation: f64) -> f64 {
        let settings = &self.campaign.optimise;
        criterion_um / settings.reference_um + settings.penalty * violation
    }
}

fn scale([low, high]: [f64; 2], unit: f64) -> f64 {
    low + (high - low) * unit
}

#[cfg(test)]
mod tests;
