//! The problem formulations, which map a point of the design space to criteria and constraints.
//!
//! A [`Problem`] names its variables, the deterministic responses of a design, the responses that are sampled, the
//! measures of these, and the constraints on both. The code that samples, models and optimises works with
//! lists of numbers, [`Design`] and [`Criteria`], in the problem's order.
//!
//! [`gears`] is the problem of the paper. Its deterministic problem ((2)–(3)) has eleven variables,
//! and the problems with wear ((6)–(7), (22), (23)) the first six of them. The number of teeth is a
//! setting, and the module (or the centre distance) follows from the others. `external` is a
//! problem that is stated in the campaign file and simulated by a program of the user's.

use crate::Campaign;
use crate::file::{Aim, FrozenFrom, Kind, Penalty};

pub use crate::approach::Approach;

mod analysis;
mod checks;
mod constraint;
mod design;
mod external;
pub mod gears;
mod measure;
mod random;
mod space;

pub use crate::quantity::Quantity;
pub use analysis::{Analysis, State};
pub use constraint::{Bound, Constraint};
pub use design::{Criteria, Design};
pub use gears::{GearCriteria, GearVariables};
pub use measure::ResponseMeasure;
pub use random::RandomInputs;
pub use space::Coordinate;
use space::{DerivedValues, Space};

/// The problem of a campaign: variables, criteria and constraints.
#[derive(Debug, Clone)]
pub struct Problem {
    campaign: Campaign,
    variables: Vec<Quantity>,
    /// The search space of the approaches that vary all free variables.
    whole: Space,
    /// The search space of the DoE, the models and the approaches that use them.
    free: Space,
    base: Design,
    /// The deterministic criteria, then the measures that constraints limit.
    criteria: Vec<Quantity>,
    responses: Vec<Quantity>,
    sampled: Vec<Quantity>,
    /// The measure of the objective, then the measures of the constraints.
    measures: Vec<ResponseMeasure>,
    random: Option<RandomInputs>,
    kind: Formulation,
}

/// The parts that only one kind of problem has.
#[derive(Debug, Clone)]
enum Formulation {
    Gears(Box<gears::Gears>),
    External(external::ExternalProblem),
}

impl Problem {
    /// The problem stated by `campaign`.
    ///
    /// # Panics
    ///
    /// Never for a validated campaign: names and sizes were checked before.
    #[must_use]
    pub fn new(campaign: Campaign) -> Self {
        match campaign.kind.clone() {
            Kind::Gears(sections) => {
                let detailed = sections.need_details();
                let sampled = gears::sampled(&sections.load);
                let measures = ResponseMeasure::of_cases(
                    gears::SAMPLED,
                    &sampled,
                    &sections.load,
                    &campaign.sampling,
                );
                let limited = measures[1..].iter().map(|one| one.quantity.clone());
                Self {
                    variables: gears::variables(&sections),
                    whole: gears::whole(&sections),
                    free: gears::free(&sections),
                    base: gears::base(&sections),
                    criteria: gears::criteria(detailed)
                        .into_iter()
                        .chain(limited)
                        .collect(),
                    responses: gears::responses(detailed),
                    sampled,
                    measures,
                    random: None,
                    kind: Formulation::Gears(Box::new(gears::Gears::new(*sections))),
                    campaign,
                }
            }
            Kind::External(sections) => {
                let external = external::ExternalProblem::new(sections);
                let space = external.space();
                Self {
                    variables: external.variables(),
                    base: Design::new(vec![0.0; external.variables().len()]),
                    whole: space.clone(),
                    free: space,
                    criteria: external.criteria(),
                    responses: external.responses(),
                    sampled: external.sampled(),
                    measures: external.measures(&campaign.sampling),
                    random: external.random(),
                    kind: Formulation::External(external),
                    campaign,
                }
            }
        }
    }

    /// The parts of a gear problem; `None` for another kind.
    #[must_use]
    pub fn gears(&self) -> Option<&gears::Gears> {
        match &self.kind {
            Formulation::Gears(gears) => Some(gears),
            Formulation::External(_) => None,
        }
    }

    /// The campaign that states the problem.
    #[must_use]
    pub const fn campaign(&self) -> &Campaign {
        &self.campaign
    }

    /// All variables.
    #[must_use]
    pub fn variables(&self) -> &[Quantity] {
        &self.variables
    }

    /// The coordinates that the DoE varies, which are the inputs of the models.
    #[must_use]
    pub fn coordinates(&self) -> &[Coordinate] {
        self.free.coordinates()
    }

    /// The names of [`Self::coordinates`].
    pub fn free_names(&self) -> impl Iterator<Item = &str> {
        self.coordinates()
            .iter()
            .map(|coordinate| &*coordinate.name)
    }

    /// The number of coordinates of the DoE.
    #[must_use]
    pub fn dimension(&self) -> usize {
        self.coordinates().len()
    }

    /// The number of coordinates that the optimiser of an approach varies.
    #[must_use]
    pub fn dimension_of(&self, approach: Approach) -> usize {
        self.space(approach).coordinates().len()
    }

    fn space(&self, approach: Approach) -> &Space {
        match approach {
            Approach::Nominal => &self.whole,
            _ => &self.free,
        }
    }

    fn derived(&self) -> &dyn DerivedValues {
        match &self.kind {
            Formulation::Gears(gears) => &**gears,
            Formulation::External(_) => &(),
        }
    }

    /// The campaign file's values of the variables that the DoE does not vary; 0 for all others.
    #[must_use]
    pub const fn base(&self) -> &Design {
        &self.base
    }

    /// The values in `design` of the variables that the DoE does not vary; 0 for all others.
    #[must_use]
    pub fn base_of(&self, design: &Design) -> Design {
        self.free.kept(design)
    }

    /// The design with the coordinates `x` of the DoE, and with the values of `base` for the
    /// variables that the DoE does not vary.
    #[must_use]
    pub fn design(&self, x: &[f64], base: &Design) -> Design {
        self.free.design(x, base, self.derived())
    }

    /// The coordinates of a design in the space of the DoE.
    #[must_use]
    pub fn free_values(&self, design: &Design) -> Vec<f64> {
        self.free.coordinates_of(design, self.derived())
    }

    /// The coordinates of the point `unit` of the DoE's unit cube.
    #[must_use]
    pub fn free_point(&self, unit: &[f64]) -> Vec<f64> {
        self.free.scaled(unit)
    }

    /// The inverse of [`Self::free_point`].
    #[must_use]
    pub fn unit_point(&self, x: &[f64]) -> Vec<f64> {
        self.free.unit(x)
    }

    /// Number of values of each coordinate of an approach, 0 of a continuous one.
    #[must_use]
    pub fn cells(&self, approach: Approach) -> Vec<usize> {
        let coordinates = self.space(approach).coordinates().iter();
        coordinates.map(|one| one.values.len()).collect()
    }

    /// The range `[low, high]` of each coordinate of the DoE.
    pub fn free_ranges(&self) -> impl Iterator<Item = [f64; 2]> {
        self.coordinates().iter().map(|coordinate| coordinate.range)
    }

    /// The design at the point `unit` of the unit cube of an approach; `None` if no design exists
    /// there.
    #[must_use]
    pub fn point(&self, approach: Approach, unit: &[f64], base: &Design) -> Option<Design> {
        let space = self.space(approach);
        let design = space.design(&space.scaled(unit), base, self.derived());
        // Without a module there are no radii, and so no design to simulate.
        let exists = match (approach, self.gears()) {
            (Approach::Nominal, Some(gears)) => gears.normal_module(&design).is_ok(),
            _ => true,
        };
        exists.then_some(design)
    }

    /// The quantities that constraints are set on, in the order of [`Criteria`]: the deterministic ones, and then the
    /// measures of samples. [`Criteria`] may lack the latter.
    #[must_use]
    pub fn criteria(&self) -> &[Quantity] {
        &self.criteria
    }

    /// The deterministic quantities that constraints are set on.
    #[must_use]
    pub fn deterministic(&self) -> &[Quantity] {
        &self.criteria[..self.criteria.len() - self.limited().len()]
    }

    /// The deterministic responses of a design that are stored and exported.
    #[must_use]
    pub fn responses(&self) -> &[Quantity] {
        &self.responses
    }

    /// The random inputs whose distributions the campaign states.
    #[must_use]
    pub const fn random(&self) -> Option<&RandomInputs> {
        self.random.as_ref()
    }

    /// The deterministic quantities that a search on models takes from models of their own: all of them, or none where
    /// the built-in model or a fast program evaluates them.
    #[must_use]
    pub fn modelled(&self) -> &[Quantity] {
        match &self.kind {
            Formulation::External(external) if external.are_modelled() => self.deterministic(),
            _ => &[],
        }
    }

    /// The measure that is optimised.
    #[must_use]
    pub fn objective(&self) -> &ResponseMeasure {
        &self.measures[0]
    }

    /// The measures that constraints limit, in the order of the file.
    #[must_use]
    pub fn limited(&self) -> &[ResponseMeasure] {
        &self.measures[1..]
    }

    /// All measures: that of the objective, and those that constraints limit.
    #[must_use]
    pub fn measures(&self) -> &[ResponseMeasure] {
        &self.measures
    }

    /// The measure that is optimised: its name, such as P90, and its unit.
    #[must_use]
    pub fn measured(&self) -> &Quantity {
        &self.objective().quantity
    }

    /// The sampled responses, in the order of the values of a sample. Their names are used for columns.
    #[must_use]
    pub fn sampled(&self) -> &[Quantity] {
        &self.sampled
    }

    /// Criteria with the measures that constraints limit: the values of [`ResponseMeasure::bound`], in the order of
    /// [`limited`](Self::limited).
    #[must_use]
    pub fn with_limited(&self, deterministic: &Criteria, bounds: &[f64]) -> Criteria {
        let values = deterministic
            .values()
            .iter()
            .take(self.deterministic().len());
        Criteria::new(values.chain(bounds).copied().collect())
    }

    /// The approaches of the campaign, in the order of the paper's Table 5.
    pub fn approaches(&self) -> impl Iterator<Item = Approach> {
        let campaign = &self.campaign;
        let is_possible = |approach: &Approach| match approach {
            Approach::Nominal => self.gears().is_some(),
            Approach::Baseline => self.has_baseline(),
            Approach::Kriging | Approach::BestOfDoe => true,
            Approach::EnrichedKriging => campaign.enrichment.is_some(),
            Approach::Direct => campaign.optimise.direct,
        };
        let is_wanted = |approach: &Approach| {
            let listed = campaign.approaches.as_ref();
            listed.is_none_or(|listed| listed.contains(approach))
        };
        Approach::ALL
            .into_iter()
            .filter(move |approach| is_possible(approach) && is_wanted(approach))
    }

    /// The number of optimiser runs of the campaign.
    #[must_use]
    pub fn optimiser_runs(&self) -> u64 {
        let optimised = |approach: &Approach| Approach::OPTIMISED.contains(approach);
        let approaches = self.approaches().filter(optimised).count() as u64;
        approaches * u64::from(self.campaign.optimise.starts)
    }

    /// Whether the response is also computed without random effects.
    #[must_use]
    pub fn has_baseline(&self) -> bool {
        match &self.kind {
            Formulation::Gears(_) => true,
            Formulation::External(external) => external.has_baseline(),
        }
    }

    /// The name of an approach in the campaign's tables.
    #[must_use]
    pub fn approach_name(&self, approach: Approach) -> &'static str {
        match approach {
            Approach::Baseline if self.gears().is_none() => "baseline",
            _ => approach.name(),
        }
    }

    /// The approach whose optimum fixes the variables that the DoE does not vary; `None` if the
    /// campaign file fixes them.
    #[must_use]
    pub fn base_from(&self) -> Option<Approach> {
        let frozen = self.campaign.gears()?.frozen?;
        let deterministic = frozen.from == FrozenFrom::Deterministic && self.free.keeps();
        deterministic.then_some(Approach::Nominal)
    }

    /// The value of the response with this name.
    #[must_use]
    pub fn response(&self, responses: &[f64], name: &str) -> Option<f64> {
        let place = self.responses().iter().position(|r| r.name == name)?;
        responses.get(place).copied()
    }

    /// The responses that follow from the analyses in both states, in the order of
    /// [`responses`](Self::responses).
    #[must_use]
    pub fn responses_of(&self, nominal: &Analysis, baseline: &Analysis) -> Vec<f64> {
        match &self.kind {
            Formulation::Gears(_) => gears::responses_of(nominal, baseline),
            Formulation::External(external) => external.responses_of(baseline),
        }
    }

    /// The analysis of a design in one state, reconstructed from its responses; `None` if they do
    /// not belong to this problem.
    #[must_use]
    pub fn analysis(&self, design: &Design, responses: &[f64], state: State) -> Option<Analysis> {
        match &self.kind {
            Formulation::Gears(gears) => {
                let module_mm = gears.normal_module(design).ok()?;
                gears::analysis(responses, state, module_mm)
            }
            Formulation::External(external) => external.analysis(responses),
        }
    }

    /// All constraints, with their signed distance from the limit.
    #[must_use]
    pub fn constraints(&self, criteria: &Criteria) -> Vec<Constraint> {
        let mut constraints = match &self.kind {
            Formulation::Gears(gears) => gears.constraints(&criteria.gears()),
            Formulation::External(external) => external.constraints(criteria),
        };
        let bounds = criteria.values().iter().skip(self.deterministic().len());
        let limited = self.limited().iter().zip(bounds);
        constraints.extend(limited.filter_map(|(one, bound)| one.constraint(*bound)));
        constraints
    }

    /// The responses that a program must return for an analysis in this state, as indices in
    /// [`responses`](Self::responses).
    pub fn wanted(&self, state: State) -> impl Iterator<Item = usize> {
        let is_gears = self.gears().is_some();
        let places = self.responses.iter().enumerate();
        places
            .filter(move |(_, response)| !is_gears || gears::belongs_to(&response.name, state))
            .map(|(place, _)| place)
    }

    /// The names and values of a design's variables, as sent to a program.
    ///
    /// # Errors
    ///
    /// The reason why the design is not simulable, such as `involute: …`.
    pub fn told(&self, design: &Design) -> Result<Vec<(&str, f64)>, String> {
        let values = self.variables.iter().zip(design.values());
        let mut told: Vec<(&str, f64)> = values
            .map(|(variable, value)| (&*variable.name, *value))
            .collect();
        if let Some(gears) = self.gears() {
            // The module follows from the campaign's centre distance with any simulator.
            let module = gears.normal_module(design);
            let module = module.map_err(|why| format!("{}: {why}", why.code()))?;
            told.push(("normal_module_mm", module));
        }
        Ok(told)
    }

    /// The value as a cost, of which less is better: the value itself, or its negative if the response is
    /// maximised. It is its own inverse.
    #[must_use]
    pub fn cost(&self, value: f64) -> f64 {
        match self.aim() {
            Aim::Minimise => value,
            Aim::Maximise => -value,
        }
    }

    /// Whether small or large values of the response are preferred.
    #[must_use]
    pub const fn aim(&self) -> Aim {
        self.campaign.sampling.objective.aim
    }

    /// The constraint violation: the sum of the relative violations in the paper's (5), and of the
    /// interferences in modules.
    ///
    /// It is zero on the feasible side and on a limit, where [`Problem::is_feasible`] may still be false.
    #[must_use]
    pub fn violation(&self, criteria: &Criteria) -> f64 {
        let constraints = self.constraints(criteria);
        constraints.iter().map(Constraint::violation).sum()
    }

    /// The part of [`violation`](Self::violation) that the measures with these [bounds](ResponseMeasure::bound) cause.
    #[must_use]
    pub fn limited_violation(&self, bounds: &[f64]) -> f64 {
        let limited = self.limited().iter().zip(bounds);
        let constraints = limited.filter_map(|(measure, bound)| measure.constraint(*bound));
        constraints.map(|one| one.violation()).sum()
    }

    /// Whether a design satisfies all constraints. On its limit, a constraint with < or > is broken, and one with ≤ or
    /// ≥ holds.
    #[must_use]
    pub fn is_feasible(&self, criteria: &Criteria) -> bool {
        self.constraints(criteria).iter().all(Constraint::holds)
    }

    /// The penalised objective (5); `None` if designs are ranked feasibility first from the
    /// beginning.
    #[must_use]
    pub fn penalty(&self) -> Option<&Penalty> {
        self.campaign.gears().map(|sections| &sections.penalty)
    }
}

#[cfg(test)]
mod tests;
