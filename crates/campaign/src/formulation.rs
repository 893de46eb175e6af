//! The problem formulations: from a point of the design space to criteria and constraints.
//!
//! The deterministic problem (the paper's (2)–(3)) moves eleven variables, the problems with wear
//! ((6)–(7), (22), (23)) the first six of them. The number of teeth is a setting, the module (or
//! the centre distance) follows from the others.

use gear::{Discretisation, PairInput};
use serde::{Deserialize, Serialize};

use crate::Campaign;
use crate::file::gear_size;

mod constraint;

pub use constraint::{Bound, Constraint};

/// The number of variables of the problems with wear, and of the DoE.
pub const ROBUST_VARIABLES: usize = 6;
/// The number of variables of the problem without wear.
pub const ALL_VARIABLES: usize = 11;

/// The names of all variables in their order, as in exported columns.
pub const VARIABLE_NAMES: [&str; ALL_VARIABLES] = [
    "x_p",
    "x_r",
    "ha0_p",
    "ha0_r",
    "hf0_p",
    "hf0_r",
    "rho_a_p_mm",
    "rho_a_r_mm",
    "rho_f_p_mm",
    "rho_f_r_mm",
    "beta_deg",
];

/// One of the paper's four ways to design the pair (section IV.D), and one beyond it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Approach {
    /// 1) ΔSTE without wear, eleven variables.
    NoWear,
    /// 2) ΔSTE with Archard's wear, six variables.
    Archard,
    /// 3) The kriging mean of P90, six variables.
    Kriging,
    /// 4) The best feasible point of the DoE.
    BestOfDoe,
    /// The kriging prediction of P90 after rounds of infill, for campaigns with an enrichment.
    EnrichedKriging,
}

impl Approach {
    /// All of them, those of the paper's Table 5 first and in its order.
    pub const ALL: [Self; 5] = [
        Self::NoWear,
        Self::Archard,
        Self::Kriging,
        Self::BestOfDoe,
        Self::EnrichedKriging,
    ];

    /// Those of a campaign: the fifth only if it has an enrichment.
    pub fn of(campaign: &Campaign) -> impl Iterator<Item = Self> + use<> {
        let enriches = campaign.enrichment.is_some();
        let belongs = move |approach: &Self| *approach != Self::EnrichedKriging || enriches;
        Self::ALL.into_iter().filter(belongs)
    }

    /// The approaches that run an optimiser.
    pub const OPTIMISED: [Self; 3] = [Self::NoWear, Self::Archard, Self::Kriging];

    /// The name in tables, exports and on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::NoWear => "no-wear",
            Self::Archard => "archard",
            Self::Kriging => "kriging",
            Self::BestOfDoe => "best-of-doe",
            Self::EnrichedKriging => "enriched-kriging",
        }
    }

    /// The number in the paper's Table 5; it also names random streams and jobs.
    #[must_use]
    pub const fn number(self) -> u64 {
        match self {
            Self::NoWear => 1,
            Self::Archard => 2,
            Self::Kriging => 3,
            Self::BestOfDoe => 4,
            Self::EnrichedKriging => 5,
        }
    }

    /// How many variables its problem moves.
    #[must_use]
    pub const fn variables(self) -> usize {
        match self {
            Self::NoWear => ALL_VARIABLES,
            _ => ROBUST_VARIABLES,
        }
    }
}

/// One design: the eleven variables of the paper's (1). Pairs are pinion, mate.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Variables {
    /// Addendum modification coefficients.
    pub profile_shift: [f64; 2],
    /// Tool addendum, modules.
    pub tool_addendum: [f64; 2],
    /// Tool dedendum, modules.
    pub tool_dedendum: [f64; 2],
    /// Tip rounding radii, mm.
    pub tip_radius_mm: [f64; 2],
    /// Root fillet radii, mm.
    pub root_radius_mm: [f64; 2],
    /// Helix angle, degrees.
    pub helix_angle_deg: f64,
}

impl Variables {
    /// The design with the six robust variables `x` and the `frozen` five.
    #[must_use]
    pub const fn robust(x: &[f64; ROBUST_VARIABLES], frozen: &Frozen) -> Self {
        Self {
            profile_shift: [x[0], x[1]],
            tool_addendum: [x[2], x[3]],
            tool_dedendum: [x[4], x[5]],
            tip_radius_mm: frozen.tip_radius_mm,
            root_radius_mm: frozen.root_radius_mm,
            helix_angle_deg: frozen.helix_angle_deg,
        }
    }

    /// The design with these eleven values, in the order of [`VARIABLE_NAMES`].
    #[must_use]
    pub const fn of_values(values: &[f64; ALL_VARIABLES]) -> Self {
        let [
            a,
            b,
            c,
            d,
            e,
            f,
            tip_p,
            tip_r,
            root_p,
            root_r,
            helix_angle_deg,
        ] = *values;
        let frozen = Frozen {
            tip_radius_mm: [tip_p, tip_r],
            root_radius_mm: [root_p, root_r],
            helix_angle_deg,
        };
        Self::robust(&[a, b, c, d, e, f], &frozen)
    }

    /// The six robust variables.
    #[must_use]
    pub const fn robust_part(&self) -> [f64; ROBUST_VARIABLES] {
        let (x, ha, hf) = (
            &self.profile_shift,
            &self.tool_addendum,
            &self.tool_dedendum,
        );
        [x[0], x[1], ha[0], ha[1], hf[0], hf[1]]
    }

    /// The five variables that the problems with wear leave alone.
    #[must_use]
    pub const fn frozen_part(&self) -> Frozen {
        Frozen {
            tip_radius_mm: self.tip_radius_mm,
            root_radius_mm: self.root_radius_mm,
            helix_angle_deg: self.helix_angle_deg,
        }
    }

    /// All eleven values, in the order of [`VARIABLE_NAMES`].
    #[must_use]
    pub const fn values(&self) -> [f64; ALL_VARIABLES] {
        let [a, b, c, d, e, f] = self.robust_part();
        let (tip, root) = (&self.tip_radius_mm, &self.root_radius_mm);
        [
            a,
            b,
            c,
            d,
            e,
            f,
            tip[0],
            tip[1],
            root[0],
            root[1],
            self.helix_angle_deg,
        ]
    }
}

/// The five variables that the problems with wear leave alone. Pairs are pinion, mate.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Frozen {
    /// Tip rounding radii, mm.
    pub tip_radius_mm: [f64; 2],
    /// Root fillet radii, mm.
    pub root_radius_mm: [f64; 2],
    /// Helix angle, degrees.
    pub helix_angle_deg: f64,
}

impl Frozen {
    /// All five values, in the order of [`VARIABLE_NAMES`].
    #[must_use]
    pub const fn values(&self) -> [f64; ALL_VARIABLES - ROBUST_VARIABLES] {
        let (tip, root) = (&self.tip_radius_mm, &self.root_radius_mm);
        [tip[0], tip[1], root[0], root[1], self.helix_angle_deg]
    }

    /// With these five values.
    #[must_use]
    pub const fn of_values(values: &[f64; ALL_VARIABLES - ROBUST_VARIABLES]) -> Self {
        let [tip_p, tip_r, root_p, root_r, helix_angle_deg] = *values;
        Self {
            tip_radius_mm: [tip_p, tip_r],
            root_radius_mm: [root_p, root_r],
            helix_angle_deg,
        }
    }
}

/// What a design is judged by besides ΔSTE.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Criteria {
    /// r_c = ε_α + ε_β.
    pub contact_ratio: f64,
    /// g_s, the largest absolute specific sliding.
    pub specific_sliding: f64,
    /// F, the largest contact pressure, MPa.
    pub hertz_pressure_mpa: f64,
    /// σ_vm, the larger of the two root stresses, MPa.
    pub root_stress_mpa: f64,
    /// Tip-to-root clearance of pinion tip and mate tip, mm; negative when a tip is pressed in.
    pub clearance_mm: [f64; 2],
    /// How far the active flank ends above the fillet on pinion and mate, mm along the path of
    /// contact; negative when the mate's tip runs into the fillet.
    pub flank_margin_mm: [f64; 2],
    /// Normal module, mm.
    pub normal_module_mm: f64,
}

/// A design of a campaign, ready to be simulated.
#[derive(Debug, Clone)]
pub struct Problem {
    campaign: Campaign,
    template: PairInput,
    pub(crate) wear: gear::Wear,
    pub(crate) discretisation: Discretisation,
}

impl Problem {
    /// The problem that `campaign` states.
    ///
    /// # Panics
    ///
    /// Never for a validated campaign: names and sizes were checked before.
    #[must_use]
    pub fn new(campaign: Campaign) -> Self {
        let pair = &campaign.pair;
        let template = PairInput {
            teeth: campaign.teeth(),
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
            tooth_model: pair
                .tooth_model
                .parse()
                .expect("validation has parsed this name"),
            tip_rule: pair
                .tip_rule
                .parse()
                .expect("validation has parsed this name"),
            pinion_torque: campaign.load.pinion_torque_nm * 1e3,
            material: campaign.material.to_gear(),
        };
        let wear = campaign.wear.to_gear();
        Self {
            campaign,
            template,
            wear,
            discretisation: Discretisation::default(),
        }
    }

    /// The campaign that states the problem.
    #[must_use]
    pub const fn campaign(&self) -> &Campaign {
        &self.campaign
    }

    /// The wear field.
    #[must_use]
    pub const fn wear(&self) -> &gear::Wear {
        &self.wear
    }

    /// The frozen variables that the campaign file gives.
    #[must_use]
    pub const fn printed_frozen(&self) -> Frozen {
        let section = &self.campaign.frozen;
        Frozen {
            tip_radius_mm: section.tip_radius_mm,
            root_radius_mm: section.root_radius_mm,
            helix_angle_deg: section.helix_angle_deg,
        }
    }

    /// The simulator's input for a design.
    #[must_use]
    pub fn pair_input(&self, variables: &Variables) -> PairInput {
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

    /// The normal module of a design in mm, which follows from the campaign's centre distance.
    ///
    /// # Errors
    ///
    /// The involute equation has no solution.
    pub fn normal_module(&self, variables: &Variables) -> Result<f64, gear::Infeasible> {
        let [pinion, mate] = variables.profile_shift;
        self.module_of(variables.helix_angle_deg, pinion + mate)
    }

    fn module_of(&self, helix_angle_deg: f64, shift: f64) -> Result<f64, gear::Infeasible> {
        gear::normal_module(
            self.template.teeth,
            self.template.size,
            self.template.pressure_angle,
            helix_angle_deg.to_radians(),
            shift,
        )
    }

    /// Geometry and compliance of a design.
    ///
    /// # Errors
    ///
    /// Why the design cannot be simulated.
    pub fn pair(&self, variables: &Variables) -> Result<gear::Pair, gear::Error> {
        gear::Pair::new(&self.pair_input(variables), &self.discretisation)
    }

    /// The criteria of a design, with the contact pressure of the analysis that matters.
    #[must_use]
    pub fn criteria(&self, pair: &gear::Pair, hertz_pressure_mpa: f64) -> Criteria {
        let geometry = pair.geometry();
        let interference = pair.interference();
        let roots = pair.root_stress();
        Criteria {
            contact_ratio: geometry.contact_ratio,
            specific_sliding: pair.sliding().max,
            hertz_pressure_mpa,
            root_stress_mpa: roots[0].stress_mpa.max(roots[1].stress_mpa),
            clearance_mm: interference.clearance,
            flank_margin_mm: interference.flank_margin,
            normal_module_mm: geometry.normal_module,
        }
    }

    /// Every constraint of (3) or (7), with how far a design is from breaking it.
    #[must_use]
    pub fn constraints(&self, criteria: &Criteria) -> [Constraint; 8] {
        let limits = &self.campaign.constraints;
        let material = &self.campaign.material;
        let room = |name, value| Constraint {
            scale: criteria.normal_module_mm,
            ..Constraint::at_least(name, " mm", value, 0.0)
        };
        [
            Constraint::above("r_c", "", criteria.contact_ratio, limits.contact_ratio_min),
            Constraint::below(
                "g_s",
                "",
                criteria.specific_sliding,
                limits.specific_sliding_max,
            ),
            Constraint::below("σ_vm", " MPa", criteria.root_stress_mpa, material.yield_mpa),
            Constraint::below(
                "F",
                " MPa",
                criteria.hertz_pressure_mpa,
                material.hertz_limit_mpa,
            ),
            room("pinion tip clearance", criteria.clearance_mm[0]),
            room("mate tip clearance", criteria.clearance_mm[1]),
            room("pinion flank margin", criteria.flank_margin_mm[0]),
            room("mate flank margin", criteria.flank_margin_mm[1]),
        ]
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

    /// The point of the design space at `unit` in the unit cube of the six robust variables.
    #[must_use]
    pub fn robust_point(&self, unit: &[f64]) -> [f64; ROBUST_VARIABLES] {
        let bounds = &self.campaign.bounds;
        let ranges = [
            bounds.profile_shift,
            bounds.tool_addendum,
            bounds.tool_dedendum,
        ];
        std::array::from_fn(|index| scale(ranges[index / 2], unit[index]))
    }

    /// The inverse of [`Self::robust_point`].
    #[must_use]
    pub fn unit_point(&self, x: &[f64; ROBUST_VARIABLES]) -> [f64; ROBUST_VARIABLES] {
        let bounds = &self.campaign.bounds;
        let ranges = [
            bounds.profile_shift,
            bounds.tool_addendum,
            bounds.tool_dedendum,
        ];
        std::array::from_fn(|index| {
            let [low, high] = ranges[index / 2];
            (x[index] - low) / (high - low)
        })
    }

    /// The design at `unit` in the unit cube of all eleven variables.
    ///
    /// The radii's bounds are multiples of the design's own module (the paper's (3)), so the last
    /// step of the scaling solves for it.
    ///
    /// # Errors
    ///
    /// The involute equation has no solution, so there is no module.
    pub fn full_point(&self, unit: &[f64]) -> Result<Variables, gear::Infeasible> {
        let bounds = &self.campaign.bounds;
        let x = self.robust_point(unit);
        let helix_angle_deg = scale(bounds.helix_angle_deg, unit[10]);
        let module = self.module_of(helix_angle_deg, x[0] + x[1])?;
        let tip = bounds.tip_radius_modules;
        let root = bounds.root_radius_modules;
        let frozen = Frozen {
            tip_radius_mm: [module * scale(tip, unit[6]), module * scale(tip, unit[7])],
            root_radius_mm: [module * scale(root, unit[8]), module * scale(root, unit[9])],
            helix_angle_deg,
        };
        Ok(Variables::robust(&x, &frozen))
    }
}

fn scale([low, high]: [f64; 2], unit: f64) -> f64 {
    low + (high - low) * unit
}

#[cfg(test)]
mod tests;
