//! The gear pair: named variables and criteria, and the conversion of a design to a pair.

use gear::{Discretisation, PairInput};

use super::space::DerivedValues;
use super::{Analysis, Constraint, Design, State};
use crate::file::{GearSections, HELIX_ANGLE, Relation, Setting, gear_size};

mod cases;
mod corrections;
mod criteria;
mod limits;
mod pair_file;
mod spaces;
mod variables;

pub use cases::{CaseSampler, LoadedCases};
pub use criteria::{GearCriteria, GearDetails};
pub(super) use criteria::{
    SAMPLED, analysis, belongs_to, check, check_delta_ste, criteria, responses, responses_of,
    sampled,
};
pub use limits::constraints;
pub(super) use spaces::{base, free, whole};
use variables::variable_names;
pub(super) use variables::variables;
pub use variables::{ALL_VARIABLES, GearVariables, VARIABLE_NAMES};

/// The values common to all pairs of a campaign.
#[derive(Debug, Clone)]
pub struct Gears {
    sections: GearSections,
    template: PairInput,
}

impl Gears {
    /// The values common to all pairs of a validated campaign.
    pub(super) fn new(sections: GearSections) -> Self {
        let pair = &sections.pair;
        let template = PairInput {
            teeth: pair.teeth(),
            size: gear_size(pair.centre_distance_mm, pair.normal_module_mm),
            pressure_angle: pair.pressure_angle_deg.to_radians(),
            helix_angle: 0.0,
            face_width: pair.face_width_mm.each(),
            profile_shift: [0.0; 2],
            tool_addendum: [1.0; 2],
            tool_dedendum: [1.0; 2],
            tip_radius: [0.0; 2],
            root_radius: [0.1; 2],
            tip_diameter: [None; 2],
            hub_radius: pair
                .hub_radius_mm
                .map_or([None; 2], |radii| radii.map(Some)),
            tooth_model: pair.tooth_model,
            tip_rule: pair.tip_rule,
            pinion_torque: sections.load.pinion_torque_nm * 1e3,
            material: sections.material.to_gear(),
        };
        Self { template, sections }
    }

    /// The scatter of manufacture; none without `[manufacture]`.
    #[must_use]
    pub fn scatter(&self) -> gear::Scatter {
        self.sections.manufacture.unwrap_or_default().to_gear()
    }

    /// A design in all cases of the campaign's load.
    ///
    /// # Errors
    ///
    /// The design is not simulable.
    pub fn loaded(&self, design: &Design) -> Result<LoadedCases, gear::Error> {
        Ok(self.cases_of(self.pair(design)?, self.wear())?)
    }

    /// A pair with this wear in all cases of the campaign's load.
    ///
    /// # Errors
    ///
    /// The contact under another torque cannot be solved.
    pub fn cases_of(
        &self,
        pair: gear::Pair,
        wear: &gear::Wear,
    ) -> Result<LoadedCases, gear::Infeasibility> {
        LoadedCases::new(pair, &self.sections.load, wear, self.scatter())
    }

    /// The analysis of a pair in one state: the ΔSTE combined from all cases, and the pressure under the load's own
    /// torque.
    #[must_use]
    pub fn analyse(&self, cases: &LoadedCases, state: State) -> Analysis {
        let pair = cases.pair();
        let load = &self.sections.load;
        let analyses = match state {
            State::Nominal => cases.unworn(),
            State::Baseline => cases.worn(),
        };
        let values: Vec<f64> = analyses.iter().map(|one| one.delta_ste_um).collect();
        let pressure = match (state, load.cases.is_empty()) {
            (State::Nominal, _) => pair.unworn().hertz_pressure_mpa,
            (State::Baseline, true) => analyses[0].hertz_pressure_mpa,
            (State::Baseline, false) => pair.archard(self.wear()).analysis.hertz_pressure_mpa,
        };
        Analysis {
            value: load.combined(&values),
            criteria: self.pair_criteria(pair, pressure).into(),
        }
    }

    /// A sampler of random flanks of a pair, with the campaign's wear and its scatter of manufacture.
    #[must_use]
    pub fn sampler(&self, pair: &gear::Pair) -> gear::Sampler {
        pair.sampler_with(&self.sections.wear, self.scatter())
    }

    /// The wear field.
    #[must_use]
    pub const fn wear(&self) -> &gear::Wear {
        &self.sections.wear
    }

    /// The corrections of a design; none in a campaign without `[corrections]`.
    #[must_use]
    pub fn corrections(&self, design: &Design) -> gear::Corrections {
        self.sections.corrections_of(design)
    }

    /// The design with these values, in which the values that the campaign ties to others, or that follow from others,
    /// are computed anew.
    #[must_use]
    pub fn dependent(&self, mut values: Vec<f64>) -> Design {
        for (place, setting) in self.sections.settings().into_iter().enumerate() {
            match setting {
                Setting::Relation(Relation::Tied) => values[place] = values[place - 1],
                Setting::Relation(Relation::Follows) => values[place] = self.mate_shift(&values),
                Setting::Free(_) | Setting::Stepped(_) | Setting::Fixed(_) => {}
            }
        }
        Design::new(values)
    }

    /// The simulator's input for a design, without its corrections.
    #[must_use]
    pub fn pair_input(&self, design: &Design) -> PairInput {
        let variables = design.gears();
        PairInput {
            helix_angle: variables.helix_angle_deg.to_radians(),
            profile_shift: variables.profile_shift,
            tool_addendum: variables.tool_addendum,
            tool_dedendum: variables.tool_dedendum,
            tip_radius: variables.tip_radius_mm,
            root_radius: variables.root_radius_mm,
            ..self.template.clone()
        }
    }

    /// The normal module of a design in mm: the campaign's, or the one that follows from its centre
    /// distance.
    ///
    /// # Errors
    ///
    /// The involute equation has no solution.
    pub fn normal_module(&self, design: &Design) -> Result<f64, gear::Infeasibility> {
        let variables = design.gears();
        let [pinion, mate] = variables.profile_shift;
        self.module_of(variables.helix_angle_deg, pinion + mate)
    }

    fn module_of(&self, helix_angle_deg: f64, shift: f64) -> Result<f64, gear::Infeasibility> {
        let template = &self.template;
        gear::normal_module(
            template.teeth,
            template.size,
            template.pressure_angle,
            helix_angle_deg.to_radians(),
            shift,
        )
    }

    /// The discretisation of pairs.
    #[must_use]
    pub const fn discretisation(&self) -> &Discretisation {
        &self.sections.grid
    }

    /// The geometry and the teeth of a design.
    ///
    /// # Errors
    ///
    /// The design is not simulable.
    pub fn unloaded(&self, design: &Design) -> Result<gear::UnloadedPair, gear::Error> {
        let input = self.pair_input(design);
        gear::UnloadedPair::new(&input, &self.corrections(design), &self.sections.grid)
    }

    /// A design with its contact.
    ///
    /// # Errors
    ///
    /// The design is not simulable.
    pub fn pair(&self, design: &Design) -> Result<gear::Pair, gear::Error> {
        Ok(self.unloaded(design)?.load()?)
    }

    /// The criteria of a pair, with the contact pressure of the relevant analysis, in MPa.
    #[must_use]
    pub fn pair_criteria(
        &self,
        pair: &gear::UnloadedPair,
        hertz_pressure_mpa: f64,
    ) -> GearCriteria {
        let sections = &self.sections;
        let is_detailed = sections.need_details();
        let factors = is_detailed.then_some(&sections.strength);
        GearCriteria::of_pair(pair, hertz_pressure_mpa, factors)
    }

    /// All constraints, with their signed distance from the limit.
    pub(super) fn constraints(&self, criteria: &GearCriteria) -> Vec<Constraint> {
        constraints(
            &self.sections.constraints,
            &self.sections.material.strength(self.sections.strength),
            criteria,
        )
    }
}

impl GearSections {
    /// The corrections of a design.
    fn corrections_of(&self, design: &Design) -> gear::Corrections {
        let section = self.corrections.as_ref();
        let shape = section.and_then(|section| section.tip_relief_shape);
        corrections::of_values(design.values(), shape.unwrap_or_default())
    }
}

impl DerivedValues for Gears {
    fn module(&self, values: &[f64]) -> f64 {
        self.module_of(values[HELIX_ANGLE], values[0] + values[1])
            .unwrap_or(1.0)
    }

    fn mate_shift(&self, values: &[f64]) -> f64 {
        let pair = &self.sections.pair;
        let (Some(centre_distance), Some(module)) =
            (pair.centre_distance_mm, pair.normal_module_mm)
        else {
            return 0.0;
        };
        let sum = gear::sum_profile_shift(
            self.template.teeth,
            module,
            centre_distance,
            self.template.pressure_angle,
            values[HELIX_ANGLE].to_radians(),
        );
        sum - values[0]
    }
}
