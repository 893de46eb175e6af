//! The inputs of a sensitivity analysis: the deviating quantities, their deviations, and the resulting pair.
//!
//! - The profile shifts, the tool heights and all free variables deviate. A variable that is tied to another one, or
//!   that follows from module and centre distance, moves with the others.
//! - Tools keep their module, so the module stays as designed. The centre distance without backlash follows, unless the
//!   campaign gives it, too: the mate's profile shift then follows.
//! - The parameters of the wear field, the tolerances of manufacture that the campaign has, and the torque have
//!   factors.

use std::ops::Range;

use anyhow::Context as _;
use clap::Args;
use problem::Design;
use problem::file::{GearSections, Load, Setting};
use problem::formulation::Problem;
use problem::formulation::gears::{Gears, LoadedCases};

use crate::arguments::share;

/// Largest deviations of the inputs, all of which deviate evenly and independently up and down.
#[derive(Debug, Clone, Copy, PartialEq, Args)]
pub struct Tolerances {
    /// Largest deviation of profile shifts and tool heights, in modules
    ///
    /// Tools keep their module: it stays as designed, and the centre distance at which the pair
    /// meshes without backlash follows, or the mate's profile shift in a campaign that gives both.
    #[arg(long = "tolerance", value_name = "MODULES", default_value_t = 0.01, value_parser = share)]
    pub modules: f64,
    /// Largest deviation of free tip and root radii, in mm
    #[arg(long = "radius-tolerance", value_name = "MM", default_value_t = 0.02, value_parser = amount)]
    pub radius_mm: f64,
    /// Largest deviation of a free helix angle, in degrees
    #[arg(long = "helix-angle-tolerance", value_name = "DEG", default_value_t = 0.02, value_parser = amount)]
    pub helix_angle_deg: f64,
    /// Largest deviation of free amounts of tip relief, in µm
    #[arg(long = "tip-relief-tolerance", value_name = "UM", default_value_t = 2.0, value_parser = amount)]
    pub tip_relief_um: f64,
    /// Largest deviation of free lengths of tip relief, in mm along the path of contact
    #[arg(long = "relief-length-tolerance", value_name = "MM", default_value_t = 0.2, value_parser = amount)]
    pub relief_length_mm: f64,
    /// Largest deviation of a free crowning, in µm
    #[arg(long = "crowning-tolerance", value_name = "UM", default_value_t = 2.0, value_parser = amount)]
    pub crowning_um: f64,
    /// Largest deviation of a free helix slope, in µm
    #[arg(long = "helix-slope-tolerance", value_name = "UM", default_value_t = 4.0, value_parser = amount)]
    pub helix_slope_um: f64,
    /// Largest deviation of the wear's depth, variance and range, and of the tolerances of
    /// `[manufacture]`, as a share of each
    #[arg(long, value_name = "SHARE", default_value_t = 0.2, value_parser = share)]
    pub scenario: f64,
    /// Largest deviation of all torques together, as a share of them
    #[arg(long, value_name = "SHARE", default_value_t = 0.1, value_parser = share)]
    pub torque: f64,
}

/// One input.
#[derive(Debug, Clone, PartialEq)]
pub struct Input {
    /// The column of a variable, and words for all others.
    pub name: String,
    /// The largest deviation, in the unit; `None` for an input that is drawn at random.
    pub deviation: Option<f64>,
    /// The unit; empty for a share.
    pub unit: &'static str,
}

/// Multiplies a part of something by a factor.
type Change<T> = fn(&mut T, f64);

/// The part of a pair that an input changes.
#[derive(Debug, Clone, Copy)]
enum Effect {
    /// The variable with this place in a design, and its least value.
    Variable(usize, f64),
    Wear(Change<gear::Wear>),
    Scatter(Change<gear::Scatter>),
    Torque,
}

/// The parameters of the wear field.
pub(super) const WEAR: [(&str, Change<gear::Wear>); 3] = [
    ("wear depth", |wear, by| wear.law = wear.law.scaled(by)),
    ("wear variance", |wear, by| wear.variance *= by),
    ("wear range", |wear, by| wear.range *= by),
];

/// The deviation of a kind of variables, its unit, and the least value of such a variable.
type Kind = (f64, &'static str, f64);

/// Places in a design of the variables that deviate in every campaign: profile shifts and tool heights.
const ALWAYS: Range<usize> = 0..6;

impl Tolerances {
    /// The kind of the variable with this place in a design.
    const fn of_variable(&self, place: usize) -> Kind {
        match place {
            0..6 => (self.modules, "modules", f64::NEG_INFINITY),
            6..10 => (self.radius_mm, "mm", 0.0),
            10 => (self.helix_angle_deg, "°", f64::NEG_INFINITY),
            11 | 12 => (self.tip_relief_um, "µm", 0.0),
            13 | 14 => (self.relief_length_mm, "mm", 1e-3),
            15 => (self.crowning_um, "µm", 0.0),
            _ => (self.helix_slope_um, "µm", f64::NEG_INFINITY),
        }
    }

    /// The inputs of a campaign.
    fn inputs(&self, problem: &Problem, sections: &GearSections) -> Vec<(Input, Effect)> {
        let settings = sections.settings().into_iter();
        let mut inputs = Vec::new();
        let mut vary = |name: &str, deviation, unit, effect| {
            let (name, deviation) = (name.to_owned(), Some(deviation));
            let input = Input {
                name,
                deviation,
                unit,
            };
            inputs.push((input, effect));
        };
        for (place, (setting, variable)) in settings.zip(problem.variables()).enumerate() {
            let deviates = match setting {
                Setting::Free(_) | Setting::Stepped(_) => true,
                Setting::Fixed(_) => ALWAYS.contains(&place),
                Setting::Relation(_) => false,
            };
            if deviates {
                let (deviation, unit, least) = self.of_variable(place);
                vary(
                    &variable.name,
                    deviation,
                    unit,
                    Effect::Variable(place, least),
                );
            }
        }
        for (name, change) in WEAR {
            vary(name, self.scenario, "", Effect::Wear(change));
        }
        let has = sections.manufacture.unwrap_or_default();
        let has_class = has.flank_class.is_some();
        let scatter: [(&str, bool, Change<gear::Scatter>); 4] = [
            (
                "profile slope tolerance f_HαT",
                has_class,
                |scatter, by| {
                    scatter.class_factors[0] *= by;
                },
            ),
            (
                "helix slope tolerance f_HβT",
                has_class && sections.pair.tooth_model.knows_the_face(),
                |scatter, by| scatter.class_factors[1] *= by,
            ),
            (
                "misalignment tolerance",
                has.misalignment_um.is_some_and(|um| um > 0.0),
                |scatter, by| scatter.misalignment *= by,
            ),
            (
                "tip relief tolerance",
                has.tip_relief_tolerance_um.is_some_and(|um| um > 0.0),
                |scatter, by| scatter.tip_relief *= by,
            ),
        ];
        for (name, _, change) in scatter.into_iter().filter(|(_, has_one, _)| *has_one) {
            vary(name, self.scenario, "", Effect::Scatter(change));
        }
        vary("torque", self.torque, "", Effect::Torque);
        inputs
    }
}

/// A design without deviations, and the inputs that deviate.
pub(super) struct Nominal<'a> {
    gears: &'a Gears,
    load: &'a Load,
    design: Design,
    /// The module of the tools, mm.
    module: f64,
    inputs: Vec<(Input, Effect)>,
}

impl<'a> Nominal<'a> {
    pub(super) fn new(
        problem: &'a Problem,
        design: Design,
        tolerances: &Tolerances,
    ) -> anyhow::Result<Self> {
        let gears = problem.gears().context(super::NO_GEARS)?;
        let sections = problem.campaign().gears().context(super::NO_GEARS)?;
        Ok(Self {
            module: gears.normal_module(&design)?,
            inputs: tolerances.inputs(problem, sections),
            load: &sections.load,
            gears,
            design,
        })
    }

    /// The inputs, in the order of a point's coordinates.
    pub(super) fn inputs(&self) -> Vec<Input> {
        self.inputs.iter().map(|(input, _)| input.clone()).collect()
    }

    /// The loaded pair at a point of the unit cube; `None` if the pair is not simulable.
    pub(super) fn deviated(&self, point: &[f64]) -> Option<LoadedCases> {
        let mut values = self.design.values().to_vec();
        let (mut wear, mut scatter) = (*self.gears.wear(), self.gears.scatter());
        let mut load = self.load.clone();
        for ((input, effect), unit) in self.inputs.iter().zip(point) {
            let deviation = input.deviation.unwrap_or_default() * (2.0 * unit - 1.0);
            let factor = 1.0 + deviation;
            match *effect {
                Effect::Variable(place, least) => {
                    values[place] = (values[place] + deviation).max(least);
                }
                Effect::Wear(change) => change(&mut wear, factor),
                Effect::Scatter(change) => change(&mut scatter, factor),
                Effect::Torque => {
                    let cases = load.cases.iter_mut();
                    let torques = cases.filter_map(|case| case.pinion_torque_nm.as_mut());
                    torques.for_each(|torque| *torque *= factor);
                    load.pinion_torque_nm *= factor;
                }
            }
        }
        let design = self.gears.dependent(values);
        let input = gear::PairInput {
            size: gear::Size::NormalModule(self.module),
            pinion_torque: 1e3 * load.pinion_torque_nm,
            ..self.gears.pair_input(&design)
        };
        let corrections = self.gears.corrections(&design);
        let grid = self.gears.discretisation();
        let pair = gear::Pair::with_corrections(&input, &corrections, grid).ok()?;
        LoadedCases::new(pair, &load, &wear, scatter).ok()
    }
}

/// Parses a deviation in a unit of its own.
fn amount(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(amount) if (0.0..=1000.0).contains(&amount) => Ok(amount),
        _ => Err("it must be a number from 0 to 1000".to_owned()),
    }
}
