//! Gear pairs on the way to their edges: sweeps that end where no pair exists.

use campaign::Campaign;
use campaign::file::GearLimits;
use campaign::formulation::gears::{GearCriteria, constraints};
use gear::{
    Corrections, Discretisation, Error, Infeasible, Kernel, Member, Pair, PairInput,
    ReliefShape, Size, TipRelief, TipRule, ToothModel, Wear, WearLaw,
    paper::{self, MATERIAL, WEAR},
};
use report::Scale;
use stats::streams::{Purpose, stream};

use crate::outcome::{Failed, Outcome};
use crate::{Entry, Method};

pub(super) const ENTRIES: [Entry; 10] = [
    Entry {
        id: "gear-apex",
        title: "A tip that runs to an apex",
        input: "A pinion of 14 teeth whose profile shift grows from 0.2 to 1.2 with the addendum of a full tooth",
        instead: "The tooth ends in the apex where its flanks meet, and the pair is simulated with that tip. \
                  `tip_land_min_modules`, here 0.2, keeps designs away from it.",
        check: apex,
        ..Entry::blank(Method::Gears)
    },
    Entry {
        id: "gear-contact-ratio-one",
        title: "A transverse contact ratio that falls to 1",
        input: "A spur pair whose tips are turned down until one pair of teeth parts before the next one meets",
        instead: "Two pairs of teeth share the load for an ever shorter time, which ΔSTE does not show: it is the step \
                  from one pair to two. Only at 1 itself, where the pair hands over at a point, the step is gone. Below, \
                  the pair is refused.",
        check: contact_ratio_one,
        ..Entry::blank(Method::Gears)
    },
    Entry {
        id: "gear-spur-limit",
        title: "A helix angle that falls to 0",
        input: "β from 30° to 10⁻⁹ degrees, and 0",
        instead: "The window of contact shrinks to a line. Below a limit the pair counts as a spur pair; there is no \
                  division by sin β that could fail.",
        check: spur_limit,
        ..Entry::blank(Method::Gears)
    },
    Entry {
        id: "gear-base-tangent",
        title: "A path of contact that touches the base tangent point",
        input: "A spur pair of 17 and 80 teeth whose larger gear gets a longer and longer tip",
        instead: "Specific sliding and pressure grow without bound and stay finite, until the pair is refused where the \
                  tip would touch below the base circle.",
        check: base_tangent,
        ..Entry::blank(Method::Gears)
    },
    Entry {
        id: "gear-contact-loss",
        title: "Contact that is lost under light loads",
        input: "A pair with 20 µm of tip relief over 2 mm of the path, torques from 1000 N m to 10⁻⁶ N m, and 0",
        instead: "Places that do not touch carry nothing; the balance is found for any load. At 0 the deflection ends, \
                  and what is left is the gap of the corrections.",
        check: contact_loss,
        ..Entry::blank(Method::Gears)
    },
    Entry {
        id: "gear-deep-wear",
        title: "Wear deeper than the deflection",
        input: "Archard’s wear of 0.1 µm to 1 mm on each flank",
        instead: "The worn flank carries where it still touches; ΔSTE grows in proportion to the depth. Wear does not feed \
                  back on itself, so that such depths are beyond the model.",
        check: deep_wear,
        ..Entry::blank(Method::Gears)
    },
    Entry {
        id: "gear-rough-field",
        title: "A random field rougher than its expansion",
        input: "Exponential correlation with ranges from 1 rad to 10⁻³ rad of roll angle",
        instead: "The expansion has 64 modes for each gear at most. What it loses is returned as a share of the variance; \
                  below a hundredth of the flank it is most of it.",
        check: rough_field,
        ..Entry::blank(Method::Gears)
    },
    Entry {
        id: "gear-large-variance",
        title: "A wear multiplier of large variance",
        input: "Variances of the multiplier from 0.01 to 100, 300 samples each",
        instead: "Where the multiplier falls below zero it counts as zero, so that wear never adds material.",
        check: large_variance,
        ..Entry::blank(Method::Gears)
    },
    Entry {
        id: "gear-coarse-grid",
        title: "A grid that is too coarse",
        input: "4 × 4 to 128 × 64 cells and phases, for the paper’s optimum without wear",
        instead: "Nodes are added where the solution has kinks, so that even the coarsest grid is off by some per cent at \
                  most. The default is 64 × 32.",
        check: coarse_grid,
        ..Entry::blank(Method::Gears)
    },
    Entry {
        id: "gear-absurd-load",
        title: "Absurd loads on Weber’s approach",
        input: "`weber-banaschek` with torques from 10⁻⁶ to 10⁶ N m",
        instead: "The logarithm of the approach is held between a floor and a ceiling, so that the compliance stays \
                  positive and the rounds end.",
        check: absurd_load,
        ..Entry::blank(Method::Gears)
    },
];

/// A plain helical pair of module 2.
pub(super) fn plain() -> PairInput {
    PairInput {
        teeth: [23, 37],
        size: Size::NormalModule(2.0),
        pressure_angle: 20_f64.to_radians(),
        helix_angle: 15_f64.to_radians(),
        face_width: 25.0,
        profile_shift: [0.2, 0.1],
        tool_addendum: [1.25; 2],
        tool_dedendum: [1.0; 2],
        tip_radius: [0.1; 2],
        root_radius: [0.6; 2],
        tip_diameter: [None; 2],
        tooth_model: ToothModel::HertzBeam,
        tip_rule: TipRule::AsCut,
        pinion_torque: 100e3,
        material: MATERIAL,
    }
}

/// Records a refusal under its code, and asserts that it is the `expected` one.
pub(super) fn refused(found: &mut Outcome, result: Result<Pair, Error>, expected: &str) {
    let code = match &result {
        Err(Error::Infeasible(reason)) => {
            found.detected(reason.code(), reason);
            reason.code()
        }
        Err(Error::Input(error)) => {
            found.detected(error.field, error);
            error.field
        }
        Ok(_) => "not at all",
    };
    found.holds(&format!("it is refused as {expected}"), code == expected);
}

pub(super) fn pair(input: &PairInput) -> Result<Pair, Error> {
    Pair::new(input, &Discretisation::default())
}

/// The largest change from a point to the next, over the whole span of the values.
fn largest_jump(points: &[[f64; 2]]) -> f64 {
    let values = || points.iter().map(|p| p[1]);
    let span = values().fold(f64::MIN, f64::max) - values().fold(f64::MAX, f64::min);
    let steps = points.windows(2).map(|w| (w[1][1] - w[0][1]).abs());
    steps.fold(0.0, f64::max) / span
}

/// Thickness of the pinion's tooth at its tip circle over the module.
fn tip_land(pair: &Pair) -> Option<f64> {
    let criteria = GearCriteria::of_pair(pair, 0.0, true);
    Some(criteria.details?.tip_land_mm[0] / criteria.normal_module_mm)
}

/// Records the constraints that a pair breaks under the paper's limits, with a tip land of 0.2 modules, and
/// asserts that the `expected` one is among them.
pub(super) fn broken(found: &mut Outcome, pair: &Pair, expected: &str) -> Result<(), Failed> {
    let paper = Campaign::parse("paper.toml", Campaign::PAPER)?;
    let sections = paper.gears().ok_or("the paper’s campaign has gears")?;
    let limits = GearLimits {
        tip_land_min_modules: Some(0.2),
        ..sections.constraints
    };
    let criteria = GearCriteria::of_pair(pair, pair.unworn().hertz_pressure_mpa, true);
    let mut is_broken = false;
    for constraint in constraints(&limits, &sections.material, &criteria) {
        if !constraint.holds() {
            is_broken |= constraint.name == expected;
            found.detected(constraint.name.to_string(), &constraint);
        }
    }
    found.holds(&format!("the constraint {expected} is broken"), is_broken);
    Ok(())
}

fn all_finite(curve: &[[f64; 2]]) -> bool {
    !curve.is_empty() && curve.iter().all(|p| p[1].is_finite() && p[1] >= 0.0)
}

fn apex(found: &mut Outcome) -> Result<(), Failed> {
    let (mut ste, mut land) = (Vec::new(), Vec::new());
    let mut pointed_from = f64::NAN;
    for i in 0..=50 {
        let shift = 0.2 + 0.02 * f64::from(i);
        let pair = pair(&PairInput {
            teeth: [14, 50],
            profile_shift: [shift, 0.0],
            tip_radius: [0.0; 2],
            ..plain()
        })?;
        if pair.geometry().pointed[0] && pointed_from.is_nan() {
            pointed_from = shift;
            broken(found, &pair, "pinion tip land")?;
        }
        ste.push([shift, pair.unworn().delta_ste_um]);
        land.push([shift, tip_land(&pair).ok_or("criteria without details")?]);
    }
    found.at_least("profile shift at which the tip is an apex", pointed_from, "", 0.3);
    found.holds("ΔSTE is a number all the way", all_finite(&ste));
    found.at_most("largest jump of ΔSTE over its span", largest_jump(&ste), "", 0.2);
    let least = land.iter().map(|p| p[1]).fold(f64::MAX, f64::min);
    found.at_least("least tip land", least, "modules", -1e-9);
    found.chart(
        "ΔSTE on the way to the apex",
        ("profile shift of the pinion", Scale::Linear),
        ("ΔSTE (µm), tip land (modules)", Scale::Linear),
        vec![("ΔSTE", ste), ("tip land", land)],
    );
    Ok(())
}

fn contact_ratio_one(found: &mut Outcome) -> Result<(), Failed> {
    let input = |cut: f64| PairInput {
        helix_angle: 0.0,
        tip_radius: [0.0; 2],
        tip_diameter: [Some(50.8 - cut), Some(78.4 - cut)],
        ..plain()
    };
    let ratio = |cut: f64| match pair(&input(cut)) {
        Ok(pair) => pair.geometry().eps_alpha,
        Err(_) => 0.0,
    };
    // The last cut that still hands over.
    let (mut low, mut high) = (0.0, 4.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if ratio(middle) >= 1.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    let mut curve = Vec::new();
    for i in 0..=40 {
        let pair = pair(&input(low * f64::from(i) / 40.0))?;
        curve.push([pair.geometry().eps_alpha, pair.unworn().delta_ste_um]);
    }
    found.at_most("least contact ratio simulated, less 1", ratio(low) - 1.0, "", 1e-9);
    found.holds("ΔSTE is a number all the way", all_finite(&curve));
    let above = &curve[..40];
    found.at_most("largest jump of ΔSTE over its span, above 1", largest_jump(above), "", 0.2);
    found.figure("ΔSTE just above 1", curve[39][1], "µm");
    found.figure("ΔSTE at 1", curve[40][1], "µm");
    refused(found, pair(&input(high + 1e-9)), "contact-gap");
    found.chart(
        "ΔSTE of a spur pair as its tips are turned down",
        ("transverse contact ratio", Scale::Linear),
        ("ΔSTE (µm)", Scale::Linear),
        vec![("ΔSTE", curve)],
    );
    Ok(())
}

fn spur_limit(found: &mut Outcome) -> Result<(), Failed> {
    let delta = |degrees: f64| -> Result<f64, Error> {
        let helix_angle = degrees.to_radians();
        let pair = pair(&PairInput { helix_angle, ..plain() })?;
        Ok(pair.unworn().delta_ste_um)
    };
    let spur = delta(0.0)?;
    let mut curve = Vec::new();
    for i in 0..=42 {
        let degrees = 30.0 * 10_f64.powf(-f64::from(i) / 4.0);
        curve.push([degrees, delta(degrees)?]);
    }
    found.holds("ΔSTE is a number all the way", all_finite(&curve));
    let from_spur = |degrees: f64| -> Result<f64, Error> {
        Ok((delta(degrees)? / spur - 1.0).abs())
    };
    found.at_most("relative distance from the spur pair at 10⁻³ degrees", from_spur(1e-3)?, "", 1e-3);
    found.at_most("relative distance from the spur pair at 10⁻⁹ degrees", from_spur(1e-9)?, "", 1e-6);
    found.figure("ΔSTE of the spur pair", spur, "µm");
    found.chart(
        "ΔSTE as the helix angle falls",
        ("helix angle (degrees)", Scale::Log),
        ("ΔSTE (µm)", Scale::Linear),
        vec![("ΔSTE", curve)],
    );
    Ok(())
}

fn base_tangent(found: &mut Outcome) -> Result<(), Failed> {
    let input = |dedendum: f64| PairInput {
        teeth: [17, 80],
        helix_angle: 0.0,
        profile_shift: [0.0; 2],
        tool_addendum: [1.25, 1.25],
        tool_dedendum: [1.0, dedendum],
        tip_radius: [0.0; 2],
        root_radius: [0.3; 2],
        ..plain()
    };
    let (mut low, mut high) = (0.4, 2.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        match pair(&input(middle)) {
            Ok(_) => low = middle,
            Err(_) => high = middle,
        }
    }
    let beyond = pair(&input(high));
    let names = matches!(&beyond, Err(Error::Infeasible(Infeasible::ContactBeyondBase { .. })));
    found.holds("the last pair stands where the base tangent point is touched", names);
    refused(found, beyond, "contact-beyond-base");
    broken(found, &pair(&input(low))?, "specific sliding")?;
    let (mut sliding, mut pressure, mut ste) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..=40 {
        let dedendum = low - (low - 0.4) * 10_f64.powf(-f64::from(i) / 4.0);
        let pair = pair(&input(dedendum))?;
        let distance = pair.geometry().s_in;
        sliding.push([distance, pair.sliding().max]);
        pressure.push([distance, pair.unworn().hertz_pressure_mpa]);
        ste.push([distance, pair.unworn().delta_ste_um]);
    }
    for (name, curve) in [("specific sliding", &sliding), ("pressure", &pressure), ("ΔSTE", &ste)] {
        found.holds(&format!("{name} is a number all the way"), all_finite(curve));
    }
    let last = sliding.len() - 1;
    found.at_most("least distance simulated from the base tangent point", sliding[last][0], "mm", 1e-6);
    found.at_least("specific sliding there", sliding[last][1], "", 1e4);
    found.figure("pressure there", pressure[last][1], "MPa");
    found.figure("ΔSTE there", ste[last][1], "µm");
    found.chart(
        "Sliding and pressure towards the base tangent point",
        ("start of contact from the base tangent point (mm)", Scale::Log),
        ("specific sliding; pressure (MPa)", Scale::Log),
        vec![("specific sliding", sliding), ("pressure", pressure)],
    );
    Ok(())
}

fn contact_loss(found: &mut Outcome) -> Result<(), Failed> {
    let relief = TipRelief {
        amount: 0.02,
        length: 2.0,
        shape: ReliefShape::Linear,
    };
    let corrections = Corrections::default()
        .with_tip_relief(Member::Pinion, relief)
        .with_tip_relief(Member::Gear, relief);
    let delta = |torque: f64, corrections: &Corrections| -> Result<f64, Error> {
        let input = PairInput {
            helix_angle: 0.0,
            pinion_torque: torque * 1e3,
            ..plain()
        };
        let pair = Pair::with_corrections(&input, corrections, &Discretisation::default())?;
        Ok(pair.unworn().delta_ste_um)
    };
    let (mut relieved, mut bare) = (Vec::new(), Vec::new());
    for i in 0..=36 {
        let torque = 1000.0 * 10_f64.powf(-f64::from(i) / 4.0);
        relieved.push([torque, delta(torque, &corrections)?]);
        bare.push([torque, delta(torque, &Corrections::default())?]);
    }
    found.holds("ΔSTE is a number at every torque", all_finite(&relieved) && all_finite(&bare));
    let none = delta(0.0, &corrections)?;
    let last = relieved[relieved.len() - 1][1];
    found.at_most("distance of ΔSTE at 10⁻⁶ N m from that without load", (last - none).abs(), "µm", 0.01);
    found.figure("ΔSTE without load, with relief", none, "µm");
    found.at_most("ΔSTE without load, bare", delta(0.0, &Corrections::default())?, "µm", 1e-9);
    found.chart(
        "ΔSTE as the load falls",
        ("torque (N m)", Scale::Log),
        ("ΔSTE (µm)", Scale::Log),
        vec![("with tip relief", relieved), ("bare", bare)],
    );
    Ok(())
}

fn deep_wear(found: &mut Outcome) -> Result<(), Failed> {
    let pair = pair(&paper::design(paper::FIGURE_7))?;
    let delta = |max_depth: f64| {
        let law = WearLaw::Archard { max_depth };
        pair.archard(&Wear { law, ..WEAR }).analysis.delta_ste_um
    };
    let depths = (0..=16).map(|i| 1e-4 * 10_f64.powf(f64::from(i) / 4.0));
    let curve: Vec<[f64; 2]> = depths.map(|depth| [1e3 * depth, delta(depth)]).collect();
    found.holds("ΔSTE is a number at every depth", all_finite(&curve));
    found.at_most("ΔSTE at 1 mm over ten times that at 0.1 mm", delta(1.0) / (10.0 * delta(0.1)), "", 1.1);
    found.figure("ΔSTE at 1 mm", delta(1.0), "µm");
    found.chart(
        "ΔSTE as wear deepens",
        ("depth (µm)", Scale::Log),
        ("ΔSTE (µm)", Scale::Log),
        vec![("Archard’s wear", curve)],
    );
    Ok(())
}

fn rough_field(found: &mut Outcome) -> Result<(), Failed> {
    let pair = pair(&paper::design(paper::FIGURE_7))?;
    let lost = |kernel, range| {
        let sampler = pair.sampler(&Wear { kernel, range, ..WEAR });
        let [pinion, gear] = sampler.truncation();
        100.0 * pinion.max(gear)
    };
    let curve = |kernel| -> Vec<[f64; 2]> {
        let ranges = (0..=24).map(|i| 10_f64.powf(-f64::from(i) / 8.0));
        ranges.map(|range| [range, lost(kernel, range)]).collect()
    };
    let (rough, smooth) = (curve(Kernel::Exponential), curve(Kernel::SquaredExponential));
    found.at_most("variance lost at 0.2 rad, exponential", lost(Kernel::Exponential, 0.2), "%", 2.5);
    found.at_most("variance lost at 0.2 rad, squared exponential", lost(Kernel::SquaredExponential, 0.2), "%", 1e-2);
    found.at_least("variance lost at 0.001 rad, exponential", lost(Kernel::Exponential, 1e-3), "%", 50.0);
    found.holds("every loss is a share", rough.iter().chain(&smooth).all(|p| (-1e-6..=100.0).contains(&p[1])));
    found.chart(
        "Variance that the expansion loses",
        ("range (rad of roll angle)", Scale::Log),
        ("lost (%)", Scale::Linear),
        vec![("exponential", rough), ("squared exponential", smooth)],
    );
    Ok(())
}

fn large_variance(found: &mut Outcome) -> Result<(), Failed> {
    let pair = pair(&paper::design(paper::FIGURE_7))?;
    let mut curve = Vec::new();
    let mut deepest = 0.0_f64;
    for variance in [0.01, 0.04, 0.25, 1.0, 10.0, 100.0] {
        let mut sampler = pair.sampler(&Wear { variance, ..WEAR });
        let mut draws = Vec::new();
        for index in 0..300 {
            let mut rng = stream(25, Purpose::Test, 0, index);
            draws.push(sampler.draw(&mut rng));
        }
        for index in 0..20 {
            let mut rng = stream(25, Purpose::Test, 1, index);
            let profile = sampler.draw_profile(&mut rng);
            let added = profile.depth.iter().flatten().map(|d| -d);
            deepest = added.fold(deepest, f64::max);
        }
        curve.push([variance, stats::mean_sd(&draws)?.0]);
    }
    found.holds("every mean of ΔSTE is a number", all_finite(&curve));
    found.at_most("material that wear adds", 1e3 * deepest, "µm", 0.0);
    found.figure("mean ΔSTE at a variance of 0.01", curve[0][1], "µm");
    found.figure("mean ΔSTE at a variance of 100", curve[5][1], "µm");
    Ok(())
}

fn coarse_grid(found: &mut Outcome) -> Result<(), Failed> {
    let input = paper::design(paper::FIGURE_7);
    let exact = Pair::converged(&input, &WEAR, 1e-5)?.pair.unworn().delta_ste_um;
    let mut curve = Vec::new();
    for cells in [4, 8, 16, 32, 64, 128] {
        let disc = Discretisation {
            cells,
            phases: (cells / 2).max(4),
        };
        let error = Pair::new(&input, &disc)?.unworn().delta_ste_um / exact - 1.0;
        curve.push([cells as f64, 100.0 * error.abs()]);
    }
    found.at_most("error of 4 × 4", curve[0][1], "%", 20.0);
    found.at_most("error of 64 × 32, the default", curve[4][1], "%", 0.3);
    found.chart(
        "Error of ΔSTE against the grid",
        ("cells", Scale::Log),
        ("error (%)", Scale::Log),
        vec![("unworn", curve)],
    );
    Ok(())
}

fn absurd_load(found: &mut Outcome) -> Result<(), Failed> {
    let (mut ste, mut stiffness) = (Vec::new(), Vec::new());
    for i in 0..=24 {
        let torque = 1e-6 * 10_f64.powf(f64::from(i) / 2.0);
        let pair = pair(&PairInput {
            tooth_model: ToothModel::WeberBanaschek,
            pinion_torque: torque * 1e3,
            ..plain()
        })?;
        ste.push([torque, pair.unworn().delta_ste_um]);
        stiffness.push([torque, pair.pitch_stiffness()]);
    }
    found.holds("ΔSTE is a number at every torque", all_finite(&ste));
    let least = stiffness.iter().map(|p| p[1]).fold(f64::MAX, f64::min);
    let most = stiffness.iter().map(|p| p[1]).fold(0.0, f64::max);
    found.at_least("least stiffness at the pitch point", least, "N/(mm µm)", 1.0);
    found.at_most("greatest over least stiffness", most / least, "", 4.0);
    found.chart(
        "Stiffness at the pitch point",
        ("torque (N m)", Scale::Log),
        ("stiffness (N/(mm µm))", Scale::Linear),
        vec![("weber-banaschek", stiffness)],
    );
    Ok(())
}
