//! `coordinator simulate`: one pair, everything the simulator says of it.

use campaign::PairFile;
use campaign::file::Material;
use clap::ValueEnum;
use gear::{Discretisation, Geometry, Pair, Sliding};
use serde::Serialize;
use stats::streams::{Purpose, stream};

/// The wear of a simulated pair.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum WearChoice {
    /// New flanks.
    None,
    /// Archard's wear, the mean of the random one.
    Archard,
    /// Archard's wear times random fields, many samples.
    Random,
}

/// What to simulate besides the pair itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Request {
    /// Which wear.
    pub wear: WearChoice,
    /// The seed of random wear.
    pub seed: u64,
    /// How many samples of random wear.
    pub samples: u32,
}

/// Everything the simulator says of one pair; arrays of two are pinion, mate.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Simulation {
    /// The version of this object.
    pub schema_version: u32,
    /// Whether the pair can be simulated.
    pub feasible: bool,
    /// Why not: a code and a sentence.
    pub reason: Option<String>,
    /// The wear that `ste_um`, `delta_ste_um` and `hertz_pressure_mpa` are for; with random wear
    /// they are for its mean, Archard's wear.
    pub wear: WearChoice,
    /// All the rest, when the pair can be simulated.
    #[serde(skip)]
    pub figures: Option<Figures>,
}

/// The figures of a pair that can be simulated.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Figures {
    normal_module_mm: f64,
    centre_distance_mm: f64,
    transverse_pressure_angle_deg: f64,
    working_pressure_angle_deg: f64,
    reference_diameter_mm: [f64; 2],
    base_diameter_mm: [f64; 2],
    tip_diameter_mm: [f64; 2],
    root_diameter_mm: [f64; 2],
    contact_ratio: ContactRatio,
    specific_sliding: SpecificSliding,
    clearance_mm: [f64; 2],
    flank_margin_mm: [f64; 2],
    hertz_pressure_mpa: f64,
    root_stress_mpa: [f64; 2],
    notch_parameter_in_range: [bool; 2],
    iso_6336: Nominal,
    pair_stiffness_n_per_mm_um: f64,
    ste_um: Curve,
    delta_ste_um: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    samples_um: Option<Vec<f64>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    mean_um: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    sd_um: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    p90_um: Option<f64>,
}

/// Nominal stresses by ISO 6336, method B with all application, dynamic and distribution factors 1, and the
/// limits of the material over them; see [`gear::rating`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct Nominal {
    /// Whether the transverse contact ratio is from 1 to 2, for which the formulas are meant.
    in_range: bool,
    /// σ_F0.
    root_stress_mpa: [f64; 2],
    /// σ_H0 with the single pair tooth contact factor.
    contact_stress_mpa: [f64; 2],
    /// S_F, the material's yield stress over σ_F0.
    root_safety: [f64; 2],
    /// S_H, the material's permissible pressure over the contact stress.
    flank_safety: [f64; 2],
}

impl Nominal {
    fn of(pair: &Pair, material: &Material) -> Self {
        let rating = gear::rating::rate(pair, 1.0);
        let root_stress_mpa = rating.root.map(|root| root.stress_mpa);
        let contact_stress_mpa = rating.z_single.map(|z| z * rating.contact_stress_mpa);
        Self {
            in_range: rating.in_range,
            root_safety: root_stress_mpa.map(|stress| material.yield_mpa / stress),
            flank_safety: contact_stress_mpa.map(|stress| material.hertz_limit_mpa / stress),
            root_stress_mpa,
            contact_stress_mpa,
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
    let pair = match Pair::new(&file.to_gear(), &Discretisation::default()) {
        Ok(pair) => pair,
        Err(gear::Error::Infeasible(infeasible)) => {
            return Ok(Simulation {
                schema_version: 1,
                feasible: false,
                reason: Some(format!("{}: {infeasible}", infeasible.code())),
                wear: request.wear,
                figures: None,
            });
        }
        Err(error) => return Err(error.into()),
    };
    let wear = file.wear.to_gear();
    let analysis = match request.wear {
        WearChoice::None => pair.unworn(),
        WearChoice::Archard | WearChoice::Random => pair.archard(&wear).analysis,
    };
    let samples_um = (request.wear == WearChoice::Random).then(|| {
        let mut sampler = pair.sampler(&wear);
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
    let percentile = samples_um
        .as_deref()
        .map(stats::percentile_p90)
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
    Ok(Simulation {
        schema_version: 1,
        feasible: true,
        reason: None,
        wear: request.wear,
        figures: Some(Figures {
            normal_module_mm: geometry.normal_module,
            centre_distance_mm: geometry.centre_distance,
            transverse_pressure_angle_deg: geometry.alpha_t.to_degrees(),
            working_pressure_angle_deg: geometry.alpha_wt.to_degrees(),
            reference_diameter_mm: diameter(geometry.r),
            base_diameter_mm: diameter(geometry.r_b),
            tip_diameter_mm: diameter(geometry.r_a),
            root_diameter_mm: diameter(geometry.r_f),
            contact_ratio: ContactRatio {
                transverse: geometry.eps_alpha,
                overlap: geometry.eps_beta,
                total: geometry.contact_ratio,
            },
            specific_sliding: SpecificSliding {
                pinion_root,
                pinion_tip,
                gear_root,
                gear_tip,
                max,
            },
            clearance_mm: interference.clearance,
            flank_margin_mm: interference.flank_margin,
            hertz_pressure_mpa: analysis.hertz_pressure_mpa,
            root_stress_mpa: [roots[0].stress_mpa, roots[1].stress_mpa],
            notch_parameter_in_range: [roots[0].in_range, roots[1].in_range],
            iso_6336: Nominal::of(&pair, &file.material),
            pair_stiffness_n_per_mm_um: pair.pitch_stiffness(),
            ste_um: Curve {
                phase: analysis.phases,
                value: analysis.ste_um,
            },
            delta_ste_um: analysis.delta_ste_um,
            samples_um,
            mean_um: percentile.map(|percentile| percentile.mean),
            sd_um: percentile.map(|percentile| percentile.sd),
            p90_um: percentile.map(|percentile| percentile.p90),
        }),
    })
}

/// The simulation as one JSON object.
///
/// # Errors
///
/// A figure that is not finite; the simulator gives none.
pub fn to_json(simulation: &Simulation) -> anyhow::Result<serde_json::Value> {
    let mut object = serde_json::to_value(simulation)?;
    if let (Some(object), Some(figures)) = (object.as_object_mut(), &simulation.figures)
        && let serde_json::Value::Object(figures) = serde_json::to_value(figures)?
    {
        object.extend(figures);
    }
    Ok(object)
}

/// The simulation for people.
#[must_use]
pub fn describe(simulation: &Simulation) -> String {
    use std::fmt::Write as _;
    let Some(figures) = &simulation.figures else {
        let reason = simulation.reason.as_deref().unwrap_or_default();
        return format!("the pair cannot be simulated: {reason}\n");
    };
    let mut text = String::new();
    let pair = |values: [f64; 2]| format!("{:.4}, {:.4}", values[0], values[1]);
    let mut line = |name: &str, value: String| {
        // Writing to a string does not fail.
        let _ = writeln!(text, "{name:<28}{value}");
    };
    line(
        "normal module",
        format!("{:.5} mm", figures.normal_module_mm),
    );
    line(
        "centre distance",
        format!("{:.4} mm", figures.centre_distance_mm),
    );
    line(
        "transverse pressure angle",
        format!("{:.4}°", figures.transverse_pressure_angle_deg),
    );
    line(
        "working pressure angle",
        format!("{:.4}°", figures.working_pressure_angle_deg),
    );
    line(
        "reference diameters",
        format!("{} mm", pair(figures.reference_diameter_mm)),
    );
    line(
        "base diameters",
        format!("{} mm", pair(figures.base_diameter_mm)),
    );
    line(
        "tip diameters",
        format!("{} mm", pair(figures.tip_diameter_mm)),
    );
    line(
        "root diameters",
        format!("{} mm", pair(figures.root_diameter_mm)),
    );
    let ContactRatio {
        transverse,
        overlap,
        total,
    } = figures.contact_ratio;
    line(
        "contact ratio",
        format!("{total:.4} (transverse {transverse:.4}, overlap {overlap:.4})"),
    );
    line(
        "largest specific sliding",
        format!("{:.4}", figures.specific_sliding.max),
    );
    line(
        "tip clearances",
        format!("{} mm", pair(figures.clearance_mm)),
    );
    line(
        "flank margins",
        format!("{} mm", pair(figures.flank_margin_mm)),
    );
    line(
        "contact pressure",
        format!("{:.1} MPa", figures.hertz_pressure_mpa),
    );
    line(
        "root stresses",
        format!("{} MPa", pair(figures.root_stress_mpa)),
    );
    let nominal = &figures.iso_6336;
    let remark = if nominal.in_range {
        ""
    } else {
        " (contact ratio outside the formulas' range)"
    };
    line(
        "ISO 6336, nominal: S_F",
        format!("{}{remark}", pair(nominal.root_safety)),
    );
    line(
        "ISO 6336, nominal: S_H",
        format!("{}{remark}", pair(nominal.flank_safety)),
    );
    let stiffness = figures.pair_stiffness_n_per_mm_um;
    line(
        "pair stiffness at pitch",
        format!("{stiffness:.3} N/(mm µm)"),
    );
    line("ΔSTE", format!("{:.4} µm", figures.delta_ste_um));
    if let (Some(mean), Some(sd), Some(p90)) = (figures.mean_um, figures.sd_um, figures.p90_um) {
        line(
            "ΔSTE with random wear",
            format!("mean {mean:.4}, SD {sd:.4}, P90 {p90:.4} µm"),
        );
    }
    text
}
