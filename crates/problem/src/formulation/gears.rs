//! The gear pair: named variables and criteria, and the conversion of a design to a pair.

use gear::{Discretisation, PairInput};

use super::space::DerivedValues;
use super::{Constraint, Design};
use crate::file::{GearSections, HELIX_ANGLE, gear_size};

pub(super) mod corrections;
mod criteria;
mod limits;
mod pair_file;
mod spaces;
mod variables;

pub use criteria::{GearCriteria, GearDetails};
pub(super) use criteria::{
    SAMPLED, analysis, belongs_to, check, check_delta_ste, criteria, responses, responses_of,
};
pub use limits::constraints;
pub(super) use spaces::{base, free, whole};
pub(super) use variables::variables;
pub use variables::{ALL_VARIABLES, GearVariables, VARIABLE_NAMES};

/// The values common to all pairs of a campaign.
#[derive(Debug, Clone)]
pub struct Gears {
    sections: GearSections,
    template: PairInput,
    /// The shape of tip relief, for designs whose variables include it.
    relief_shape: gear::ReliefShape,
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
            face_width: pair.face_width_mm,
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
        Self {
            template,
            relief_shape: gear::ReliefShape::Linear,
            sections,
        }
    }

    /// The scatter of manufacture; none without `[manufacture]`.
    #[must_use]
    pub fn scatter(&self) -> gear::Scatter {
        self.sections.manufacture.unwrap_or_default().to_gear()
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

    pub(super) const fn set_relief_shape(&mut self, shape: gear::ReliefShape) {
        self.relief_shape = shape;
    }

    /// The profile corrections of a design; none unless its problem has them as
    /// [variables](super::Problem::with_corrections).
    #[must_use]
    pub fn corrections(&self, design: &Design) -> gear::Corrections {
        corrections::of_values(design.values(), self.relief_shape)
    }

    /// The simulator's input for a design, without profile corrections.
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
        let is_detailed = sections.constraints.need_details();
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
