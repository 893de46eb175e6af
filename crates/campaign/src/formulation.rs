//! The problem formulations: from a point of the design space to criteria and constraints.
//!
//! The deterministic problem (the paper's (2)–(3)) moves eleven variables, the problems with wear
//! ((6)–(7), (22), (23)) the first six of them. The number of teeth is a setting, the module (or
//! the centre distance) follows from the others.

use gear::{Discretisation, PairInput, Size};
use serde::{Deserialize, Serialize};

use crate::Campaign;

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

/// One of the paper's four ways to design the pair (section IV.D).
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
}

impl Approach {
    /// All of them, in the order of the paper's Table 5.
    pub const ALL: [Self; 4] = [Self::NoWear, Self::Archard, Self::Kriging, Self::BestOfDoe];

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
    wear: gear::Wear,
    discretisation: Discretisation,
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
            size: match (pair.centre_distance_mm, pair.normal_module_mm) {
                (Some(distance), _) => Size::CentreDistance(distance),
                (None, module) => Size::NormalModule(module.expect("validation asks for one")),
            },
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

    /// The sum of the relative violations in the paper's (5), and of the interferences in modules.
    ///
    /// Zero on the feasible side including its edge; [`Problem::is_feasible`] is strict.
    #[must_use]
    pub fn violation(&self, criteria: &Criteria) -> f64 {
        let limits = &self.campaign.constraints;
        let material = &self.campaign.material;
        let interference: f64 = criteria
            .clearance_mm
            .iter()
            .chain(&criteria.flank_margin_mm)
            .map(|amount| (-amount / criteria.normal_module_mm).max(0.0))
            .sum();
        (1.0 - criteria.contact_ratio / limits.contact_ratio_min).max(0.0)
            + (criteria.specific_sliding / limits.specific_sliding_max - 1.0).max(0.0)
            + (criteria.root_stress_mpa / material.yield_mpa - 1.0).max(0.0)
            + (criteria.hertz_pressure_mpa / material.hertz_limit_mpa - 1.0).max(0.0)
            + interference
    }

    /// Whether a design satisfies every constraint of (3) or (7), with their strict inequalities.
    #[must_use]
    pub fn is_feasible(&self, criteria: &Criteria) -> bool {
        let limits = &self.campaign.constraints;
        let material = &self.campaign.material;
        criteria.contact_ratio > limits.contact_ratio_min
            && criteria.specific_sliding < limits.specific_sliding_max
            && criteria.root_stress_mpa < material.yield_mpa
            && criteria.hertz_pressure_mpa < material.hertz_limit_mpa
            && criteria
                .clearance_mm
                .iter()
                .chain(&criteria.flank_margin_mm)
                .all(|&mm| mm >= 0.0)
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
        let module = gear::normal_module(
            self.template.teeth,
            self.template.size,
            self.template.pressure_angle,
            helix_angle_deg.to_radians(),
            x[0] + x[1],
        )?;
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
