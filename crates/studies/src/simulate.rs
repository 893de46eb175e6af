//! `coordinator simulate`: all results of the simulator for one pair.

use clap::ValueEnum;
use gear::{Analysis, Discretisation, Geometry, Pair, Sliding, inspection, rating};
use problem::PairFile;
use problem::formulation::Constraint;
use problem::formulation::gears::{self, GearCriteria};
use results::doubts::pair::{self as doubts, Loaded};
use results::number::significant;
use results::sheet::{self, Section};
use serde::Serialize;
use stats::streams::{Purpose, stream};

mod cases;
mod exchange;
mod page;
mod text;

use cases::{CaseFigures, Cases};
pub use exchange::{PairImport, import};
pub use page::{Subject, write_page};
pub use text::describe;

/// Relative difference between two grids above which a figure is doubted.
const GRID_ERROR: f64 = 0.1;

/// The version of the JSON object.
const SCHEMA_VERSION: u32 = 3;

/// The wear of a simulated pair.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum WearChoice {
    /// New flanks.
    None,
    /// Archard's wear, the mean of the random one.
    Archard,
    /// Archard's wear times random fields, on flanks of the file's class, many samples.
    Random,
}

/// The simulation requested besides the analysis of the pair itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Request {
    pub wear: WearChoice,
    /// The seed of random wear.
    pub seed: u64,
    /// Number of samples of random wear.
    pub samples: u32,
}

/// All results of the simulator for one pair; arrays of two are pinion, mate.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Simulation {
    pub schema_version: u32,
    /// Whether the simulator gives numbers.
    pub simulable: bool,
    /// Whether the pair is simulable and all constraints hold.
    pub feasible: bool,
    /// Why the pair is not simulable: a code and a sentence.
    pub reason: Option<String>,
    /// The wear that `ste_um`, `delta_ste_um` and `hertz_pressure_mpa` are for; with random wear
    /// they are for its mean, Archard's wear.
    pub wear: WearChoice,
    /// Reasons to doubt the pair, a sentence each: those of the file, then those of its results.
    pub warnings: Vec<String>,
    /// The pair's constraints, those of the file and the defaults; empty for a pair that is not
    /// simulable.
    pub constraints: Vec<Constraint>,
    /// All other figures, if the pair can be simulated.
    #[serde(skip)]
    pub figures: Option<Figures>,
}

/// The figures of a pair that can be simulated.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Figures {
    /// The data sheet, transmission error and stiffness included: `sheet` in JSON.
    #[serde(skip)]
    sheet: Vec<Section>,
    normal_module_mm: f64,
    centre_distance_mm: f64,
    transverse_pressure_angle_deg: f64,
    working_pressure_angle_deg: f64,
    /// Zero unless module and centre distance are both given.
    backlash_mm: f64,
    reference_diameter_mm: [f64; 2],
    base_diameter_mm: [f64; 2],
    tip_diameter_mm: [f64; 2],
    root_diameter_mm: [f64; 2],
    contact_ratio: ContactRatio,
    specific_sliding: SpecificSliding,
    clearance_mm: [f64; 2],
    /// Thickness at the tip circle in the normal section, as if the tip were not rounded.
    tip_land_mm: [f64; 2],
    flank_margin_mm: [f64; 2],
    hertz_pressure_mpa: f64,
    root_stress_mpa: [f64; 2],
    notch_parameter_in_range: [bool; 2],
    iso_6336: StrengthFigures,
    pair_stiffness_n_per_mm_um: f64,
    ste_um: Curve,
    delta_ste_um: f64,
    /// The error of the tooth model in ΔSTE, in words.
    model_error: &'static str,
    /// The same pair on a finer grid; absent if its contact cannot be resolved there.
    #[serde(skip_serializing_if = "Option::is_none")]
    finer_grid: Option<FinerGrid>,
    #[serde(skip_serializing_if = "Option::is_none")]
    manufacture: Option<Scatter>,
    #[serde(skip_serializing_if = "Option::is_none")]
    samples_um: Option<Vec<f64>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    mean_um: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    sd_um: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    p90_um: Option<f64>,
    /// The 95 % interval of the percentile; absent if the samples are too few for one.
    #[serde(skip_serializing_if = "Option::is_none")]
    p90_interval_um: Option<[f64; 2]>,
    /// The pair in each of the file's load cases.
    #[serde(flatten)]
    cases: Cases,
}

/// Figures of a pair on a grid with twice as many cells and phases.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct FinerGrid {
    delta_ste_um: f64,
    hertz_pressure_mpa: f64,
}

impl FinerGrid {
    fn of(file: &PairFile, wear: WearChoice) -> Option<Self> {
        let pair = pair(file, 2).ok()?;
        let analysis = worn(&pair, file, wear).unwrap_or_else(|| pair.unworn());
        Some(Self {
            delta_ste_um: analysis.delta_ste_um,
            hertz_pressure_mpa: analysis.hertz_pressure_mpa,
        })
    }

    /// Warnings about figures that depend on the grid, from those of the usual grid. A difference that no gear feels is
    /// none.
    fn doubts(&self, delta_ste_um: f64, hertz_pressure_mpa: f64) -> Vec<String> {
        let of = |(name, unit, least, coarse, fine): (&str, &str, f64, f64, f64)| {
            let difference = (coarse / fine - 1.0).abs();
            (difference > GRID_ERROR && (coarse - fine).abs() > least).then(|| {
                format!(
                    "{name} is {} {unit}, and {} {unit} on a grid twice as fine: its error by the grid is of the order of \
                     {:.0} %",
                    significant(coarse, 3),
                    significant(fine, 3),
                    100.0 * difference
                )
            })
        };
        [
            ("ΔSTE", "µm", 0.01, delta_ste_um, self.delta_ste_um),
            (
                "the contact pressure",
                "MPa",
                1.0,
                hertz_pressure_mpa,
                self.hertz_pressure_mpa,
            ),
        ]
        .into_iter()
        .filter_map(of)
        .collect()
    }
}

/// The scatter of slopes, of the shafts' misalignment and of the tip relief in the samples. Each deviation is normal, and its tolerance ±
/// is three standard deviations.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct Scatter {
    /// Flank tolerance class of ISO 1328-1.
    #[serde(skip_serializing_if = "Option::is_none")]
    flank_class: Option<u32>,
    /// f_HαT of each gear.
    #[serde(skip_serializing_if = "Option::is_none")]
    slope_tolerance_um: Option<[f64; 2]>,
    /// f_HβT of each gear, where the tooth model knows the face.
    #[serde(skip_serializing_if = "Option::is_none")]
    helix_slope_tolerance_um: Option<[f64; 2]>,
    /// Tolerance of the misalignment of the shafts.
    #[serde(skip_serializing_if = "Option::is_none")]
    misalignment_um: Option<f64>,
    /// Tolerance of the amounts of tip relief.
    #[serde(skip_serializing_if = "Option::is_none")]
    tip_relief_tolerance_um: Option<f64>,
}

impl Scatter {
    fn of(file: &PairFile, geometry: &Geometry) -> Option<Self> {
        let scatter = file.scatter();
        let class = scatter.flank_class;
        let may_tilt = file.pair.tooth_model.knows_the_face();
        let um = |tolerances: [f64; 2]| tolerances.map(|mm| 1e3 * mm);
        file.manufacture.map(|_| Self {
            flank_class: class.map(gear::FlankClass::number),
            slope_tolerance_um: class.map(|class| um(class.slope_tolerances(geometry))),
            helix_slope_tolerance_um: class.filter(|_| may_tilt).map(|class| {
                um(class.helix_slope_tolerances(geometry, file.pair.face_width_mm.each()))
            }),
            misalignment_um: Some(1e3 * scatter.misalignment).filter(|um| may_tilt && *um > 0.0),
            tip_relief_tolerance_um: Some(1e3 * scatter.tip_relief).filter(|um| *um > 0.0),
        })
    }
}

/// Stresses and safeties by ISO 6336, method B, with the factors of the file's `[strength]`; see [`gear::rating`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct StrengthFigures {
    /// Edition of ISO 6336-3.
    edition: rating::Edition,
    /// K_A, K_v, K_Hβ and K_Hα.
    load_factors: [f64; 4],
    /// Whether the transverse contact ratio is from 1 to 2, for which the formulas are meant.
    in_range: bool,
    /// σ_F0.
    nominal_root_stress_mpa: [f64; 2],
    /// σ_F.
    root_stress_mpa: [f64; 2],
    /// σ_H.
    flank_stress_mpa: [f64; 2],
    /// S_F, where the material's σ_FE is known.
    root_safety: [Option<f64>; 2],
    /// S_H.
    flank_safety: [f64; 2],
}

impl StrengthFigures {
    fn of(pair: &Pair, strength: &rating::Strength) -> Self {
        let factors = &strength.factors;
        let rating = rating::rate(pair, 1.0, factors);
        Self {
            edition: factors.edition,
            load_factors: [
                factors.application_factor,
                factors.dynamic_factor,
                factors.face_load_factor,
                factors.transverse_load_factor,
            ],
            in_range: rating.in_range,
            nominal_root_stress_mpa: rating.root.map(|root| root.stress_mpa),
            root_stress_mpa: rating.root_stress_mpa,
            flank_stress_mpa: rating.flank_stress_mpa,
            root_safety: strength.root_safety(rating.root_stress_mpa),
            flank_safety: strength.flank_safety(rating.flank_stress_mpa),
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct ContactRatio {
    transverse: f64,
    overlap: f64,
    total: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct SpecificSliding {
    pinion_root: f64,
    pinion_tip: f64,
    gear_root: f64,
    gear_tip: f64,
    max: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct Curve {
    phase: Vec<f64>,
    value: Vec<f64>,
}

/// Simulates one pair.
///
/// # Errors
///
/// An input that the simulator does not accept, or a percentile of too few samples.
pub fn run(file: &PairFile, request: Request) -> anyhow::Result<Simulation> {
    let pair = match pair(file, 1) {
        Ok(pair) => pair,
        Err(gear::Error::Infeasible(infeasible)) => {
            return Ok(Simulation {
                schema_version: SCHEMA_VERSION,
                simulable: false,
                feasible: false,
                reason: Some(format!("{}: {infeasible}", infeasible.code())),
                wear: request.wear,
                warnings: file.warnings(),
                constraints: Vec::new(),
                figures: None,
            });
        }
        Err(error) => return Err(error.into()),
    };
    let (unworn, worn) = (pair.unworn(), worn(&pair, file, request.wear));
    let mut warnings = file.warnings();
    let loaded = Loaded::new(&unworn, worn.as_ref());
    warnings.extend(doubts::of(&pair, &loaded, file.allowances.as_ref()));
    let figures = figures(&pair, file, request, unworn, worn)?;
    if let Some(finer) = &figures.finer_grid {
        warnings.extend(finer.doubts(figures.delta_ste_um, figures.hertz_pressure_mpa));
    }
    let has_limits = file
        .load
        .cases
        .iter()
        .any(|case| case.delta_ste_max_um.is_some());
    if has_limits && request.wear != WearChoice::Random {
        warnings.push(
            "the limits delta_ste_max_um of the load cases need random pairs: add --wear random"
                .to_owned(),
        );
    }
    let strength = file.material.strength(file.strength);
    let criteria = GearCriteria::of_pair(&pair, figures.hertz_pressure_mpa, Some(&file.strength));
    let mut constraints = gears::constraints(&file.limits(), &strength, &criteria);
    constraints.extend(
        figures
            .cases
            .each
            .iter()
            .filter_map(CaseFigures::constraint),
    );
    Ok(Simulation {
        schema_version: SCHEMA_VERSION,
        simulable: true,
        feasible: constraints.iter().all(Constraint::holds),
        reason: None,
        wear: request.wear,
        warnings,
        constraints,
        figures: Some(figures),
    })
}

/// The pair of a file, with its corrections, on a grid that is `times` as fine as usual.
fn pair(file: &PairFile, times: usize) -> Result<Pair, gear::Error> {
    let grid = Discretisation::of(file.pair.tooth_model).refined(times);
    Pair::with_corrections(&file.to_gear(), &file.corrections(), &grid)
}

/// The analysis with the mean wear, if there is any.
fn worn(pair: &Pair, file: &PairFile, wear: WearChoice) -> Option<Analysis> {
    match wear {
        WearChoice::None => None,
        WearChoice::Archard | WearChoice::Random => Some(pair.archard(&file.wear).analysis),
    }
}

/// All results of the simulator for a pair with the requested wear, from its analyses.
fn figures(
    pair: &Pair,
    file: &PairFile,
    request: Request,
    unworn: Analysis,
    worn: Option<Analysis>,
) -> anyhow::Result<Figures> {
    let mut sections = sheet::sections(file, pair);
    let analysis = worn.as_ref().unwrap_or(&unworn);
    sections.push(sheet::transmission_error(pair, analysis, worn.is_some()));
    sections.push(sheet::stiffness(pair, &file.strength, &unworn));
    let analysis = worn.unwrap_or(unworn);
    let samples = (request.wear == WearChoice::Random).then(|| {
        let mut sampler = file.sampler(pair);
        (0..request.samples)
            .map(|index| {
                sampler.draw(&mut stream(
                    request.seed,
                    Purpose::Wear,
                    0,
                    u64::from(index),
                ))
            })
            .collect::<Vec<f64>>()
    });
    let moments = samples.as_deref().map(stats::mean_sd).transpose()?;
    let percentile = samples
        .as_deref()
        .map(|samples| stats::order_statistic(samples, 0.9, 0.95))
        .transpose()?;

    let geometry: &Geometry = pair.geometry();
    let Sliding {
        pinion_root,
        pinion_tip,
        gear_root,
        gear_tip,
        max,
    } = pair.sliding();
    let interference = pair.interference();
    let roots = pair.root_stress();
    let diameter = |radius: [f64; 2]| radius.map(|radius| 2.0 * radius);
    Ok(Figures {
        sheet: sections,
        normal_module_mm: geometry.normal_module,
        centre_distance_mm: geometry.centre_distance,
        transverse_pressure_angle_deg: geometry.alpha_t.to_degrees(),
        working_pressure_angle_deg: geometry.alpha_wt.to_degrees(),
        backlash_mm: geometry.backlash,
        reference_diameter_mm: diameter(geometry.r),
        base_diameter_mm: diameter(geometry.r_b),
        tip_diameter_mm: diameter(geometry.r_a),
        root_diameter_mm: diameter(geometry.r_f),
        contact_ratio: ContactRatio {
            transverse: geometry.eps_alpha_left(),
            overlap: geometry.eps_beta,
            total: geometry.eps_alpha_left() + geometry.eps_beta,
        },
        specific_sliding: SpecificSliding {
            pinion_root,
            pinion_tip,
            gear_root,
            gear_tip,
            max,
        },
        clearance_mm: interference.clearance,
        tip_land_mm: inspection::tip_land(geometry),
        flank_margin_mm: interference.flank_margin,
        hertz_pressure_mpa: analysis.hertz_pressure_mpa,
        root_stress_mpa: [roots[0].stress_mpa, roots[1].stress_mpa],
        notch_parameter_in_range: [roots[0].in_range, roots[1].in_range],
        iso_6336: StrengthFigures::of(pair, &file.material.strength(file.strength)),
        pair_stiffness_n_per_mm_um: pair.pitch_stiffness(),
        ste_um: Curve {
            phase: analysis.phases,
            value: analysis.ste_um,
        },
        delta_ste_um: analysis.delta_ste_um,
        model_error: gear::model_error(file.pair.tooth_model),
        finer_grid: FinerGrid::of(file, request.wear),
        manufacture: Scatter::of(file, geometry).filter(|_| samples.is_some()),
        samples_um: samples,
        mean_um: moments.map(|(mean, _)| mean),
        sd_um: moments.map(|(_, sd)| sd),
        cases: Cases::of(pair, file, request)?,
        p90_um: percentile.map(|percentile| percentile.value),
        p90_interval_um: percentile
            .and_then(|percentile| percentile.interval.map(<[f64; 2]>::from)),
    })
}

/// The simulation as one JSON object.
///
/// # Errors
///
/// A figure cannot be serialised.
pub fn to_json(simulation: &Simulation) -> anyhow::Result<serde_json::Value> {
    let mut object = serde_json::to_value(simulation)?;
    if let (Some(object), Some(figures)) = (object.as_object_mut(), &simulation.figures)
        && let serde_json::Value::Object(values) = serde_json::to_value(figures)?
    {
        object.extend(values);
        object.insert("sheet".to_owned(), sheet::json(&figures.sheet).into());
    }
    Ok(object)
}

#[cfg(test)]
mod tests;
