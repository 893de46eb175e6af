//! Gear pairs under extreme loads and wear, and on coarse grids.

use gear::{
    Corrections, Discretisation, Error, Kernel, Member, Pair, PairInput, ReliefShape, TipRelief,
    ToothModel, Wear, WearLaw,
    paper::{self, WEAR},
};
use results::report::Scale;
use stats::streams::{Purpose, stream};

use super::gear_scene::{all_finite, pair, plain};
use crate::stability::outcome::{EntryError, Outcome};
use crate::stability::{Entry, Method};

pub(super) const ENTRIES: [Entry; 6] = [
    Entry {
        id: "gear-contact-loss",
        title: "Loss of contact under light loads",
        input: "A spur pair and a helical pair with 20 µm of tip relief over 2 mm of the path, torques from 1000 N m to \
                10⁻⁶ N m, and 0",
        instead: "Flanks that do not touch carry no load, and the load balance is found for any torque. Without load only \
                  the gap of the corrections is left.",
        check: contact_loss,
        ..Entry::blank(Method::Gears)
    },
    Entry {
        id: "gear-deep-wear",
        title: "Wear deeper than the deflection",
        input: "Archard’s wear of 0.1 µm to 1 mm on each flank",
        instead: "The worn flank carries load where it still touches, and ΔSTE grows in proportion to the depth. The model \
                  has no effect of wear on further wear, so it is not valid at such depths.",
        check: deep_wear,
        ..Entry::blank(Method::Gears)
    },
    Entry {
        id: "gear-rough-field",
        title: "A random field too rough for its expansion",
        input: "Exponential correlation with ranges from 1 rad to 10⁻³ rad of roll angle",
        instead: "The expansion has at most 64 modes for each gear. The share of the variance that it loses is returned; at \
                  a range of 10⁻³ rad it is more than half.",
        check: rough_field,
        ..Entry::blank(Method::Gears)
    },
    Entry {
        id: "gear-large-variance",
        title: "A wear multiplier of large variance",
        input: "Variances of the multiplier from 0.01 to 100, 300 samples each",
        instead: "A multiplier below zero counts as zero, so that wear never adds material.",
        check: large_variance,
        ..Entry::blank(Method::Gears)
    },
    Entry {
        id: "gear-coarse-grid",
        title: "A grid that is too coarse",
        input: "4 × 4 to 128 × 64 cells and phases, for the paper’s optimum without wear",
        instead: "Nodes are added at the kinks of the solution, so that even 4 × 4 has an error of only an eighth. The \
                  default is 64 × 32.",
        check: coarse_grid,
        ..Entry::blank(Method::Gears)
    },
    Entry {
        id: "gear-absurd-load",
        title: "Extreme loads on Weber’s approach",
        input: "“weber-banaschek” with torques from 10⁻⁶ to 10⁶ N m",
        instead: "The logarithm of the approach has a lower and an upper limit, so that the compliance stays positive and \
                  the iteration ends.",
        check: absurd_load,
        ..Entry::blank(Method::Gears)
    },
];

fn contact_loss(outcome: &mut Outcome) -> Result<(), EntryError> {
    let relief = TipRelief {
        amount: 0.02,
        length: 2.0,
        shape: ReliefShape::Linear,
    };
    let corrections = Corrections::default()
        .with_tip_relief(Member::Pinion, relief)
        .with_tip_relief(Member::Gear, relief);
    let with_helix =
        |helix_angle: f64, torque: f64, corrections: &Corrections| -> Result<f64, Error> {
            let input = PairInput {
                helix_angle,
                pinion_torque: torque * 1e3,
                ..plain()
            };
            let pair = Pair::with_corrections(&input, corrections, &Discretisation::default())?;
            Ok(pair.unworn().delta_ste_um)
        };
    let delta = |torque, corrections: &Corrections| with_helix(0.0, torque, corrections);
    let (mut relieved, mut bare) = (Vec::new(), Vec::new());
    for i in 0..=36 {
        let torque = 1000.0 * 10_f64.powf(-f64::from(i) / 4.0);
        relieved.push([torque, delta(torque, &corrections)?]);
        bare.push([torque, delta(torque, &Corrections::default())?]);
    }
    outcome.holds(
        "ΔSTE is finite at every torque",
        all_finite(&relieved) && all_finite(&bare),
    );
    let none = delta(0.0, &corrections)?;
    for (name, helix_angle) in [("spur", 0.0), ("helical", 15_f64.to_radians())] {
        let light = with_helix(helix_angle, 1e-6, &corrections)?;
        let none = with_helix(helix_angle, 0.0, &corrections)?;
        let name = format!("distance of ΔSTE at 10⁻⁶ N m from that without load, {name} pair");
        outcome.at_most(&name, (light - none).abs(), "µm", 1e-3);
    }
    outcome.figure("ΔSTE without load, with relief", none, "µm");
    outcome.at_most(
        "ΔSTE without load, bare",
        delta(0.0, &Corrections::default())?,
        "µm",
        1e-9,
    );
    outcome.chart(
        "ΔSTE as the load falls",
        ("torque (N m)", Scale::Log),
        ("ΔSTE (µm)", Scale::Log),
        vec![("with tip relief", relieved), ("bare", bare)],
    );
    Ok(())
}

fn deep_wear(outcome: &mut Outcome) -> Result<(), EntryError> {
    let pair = pair(&paper::design(paper::FIGURE_7))?;
    let delta = |max_depth: f64| {
        let law = WearLaw::Archard {
            max_depth_um: 1e3 * max_depth,
        };
        pair.archard(&Wear { law, ..WEAR }).analysis.delta_ste_um
    };
    let depths = (0..=16).map(|i| 1e-4 * 10_f64.powf(f64::from(i) / 4.0));
    let curve: Vec<[f64; 2]> = depths.map(|depth| [1e3 * depth, delta(depth)]).collect();
    outcome.holds("ΔSTE is finite at every depth", all_finite(&curve));
    outcome.at_most(
        "ΔSTE at 1 mm over ten times that at 0.1 mm",
        delta(1.0) / (10.0 * delta(0.1)),
        "",
        1.1,
    );
    outcome.figure("ΔSTE at 1 mm", delta(1.0), "µm");
    outcome.chart(
        "ΔSTE as wear deepens",
        ("depth (µm)", Scale::Log),
        ("ΔSTE (µm)", Scale::Log),
        vec![("Archard’s wear", curve)],
    );
    Ok(())
}

fn rough_field(outcome: &mut Outcome) -> Result<(), EntryError> {
    let pair = pair(&paper::design(paper::FIGURE_7))?;
    let lost = |kernel, range| {
        let sampler = pair.sampler(&Wear {
            kernel,
            range,
            ..WEAR
        });
        let [pinion, gear] = sampler.truncation();
        100.0 * pinion.max(gear)
    };
    let curve = |kernel| -> Vec<[f64; 2]> {
        let ranges = (0..=24).map(|i| 10_f64.powf(-f64::from(i) / 8.0));
        ranges.map(|range| [range, lost(kernel, range)]).collect()
    };
    let (rough, smooth) = (
        curve(Kernel::Exponential),
        curve(Kernel::SquaredExponential),
    );
    outcome.at_most(
        "variance lost at 0.2 rad, exponential",
        lost(Kernel::Exponential, 0.2),
        "%",
        2.5,
    );
    outcome.at_most(
        "variance lost at 0.2 rad, squared exponential",
        lost(Kernel::SquaredExponential, 0.2),
        "%",
        1e-2,
    );
    outcome.at_least(
        "variance lost at 0.001 rad, exponential",
        lost(Kernel::Exponential, 1e-3),
        "%",
        50.0,
    );
    outcome.holds(
        "every loss is a share",
        rough
            .iter()
            .chain(&smooth)
            .all(|p| (-1e-6..=100.0).contains(&p[1])),
    );
    outcome.chart(
        "Variance that the expansion loses",
        ("range (rad of roll angle)", Scale::Log),
        ("lost (%)", Scale::Linear),
        vec![("exponential", rough), ("squared exponential", smooth)],
    );
    Ok(())
}

fn large_variance(outcome: &mut Outcome) -> Result<(), EntryError> {
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
    outcome.holds("every mean of ΔSTE is finite", all_finite(&curve));
    outcome.at_most("material that wear adds", 1e3 * deepest, "µm", 0.0);
    outcome.figure("mean ΔSTE at a variance of 0.01", curve[0][1], "µm");
    outcome.figure("mean ΔSTE at a variance of 100", curve[5][1], "µm");
    Ok(())
}

fn coarse_grid(outcome: &mut Outcome) -> Result<(), EntryError> {
    let input = paper::design(paper::FIGURE_7);
    let exact = Pair::converged(&input, &WEAR, 1e-5)?
        .pair
        .unworn()
        .delta_ste_um;
    let mut curve = Vec::new();
    for cells in [4, 8, 16, 32, 64, 128] {
        let disc = Discretisation {
            cells,
            phases: (cells / 2).max(4),
        };
        let error = Pair::new(&input, &disc)?.unworn().delta_ste_um / exact - 1.0;
        curve.push([cells as f64, 100.0 * error.abs()]);
    }
    outcome.at_most("error of 4 × 4", curve[0][1], "%", 20.0);
    outcome.at_most("error of 64 × 32, the default", curve[4][1], "%", 0.3);
    outcome.chart(
        "Error of ΔSTE against the grid",
        ("cells", Scale::Log),
        ("error (%)", Scale::Log),
        vec![("unworn", curve)],
    );
    Ok(())
}

fn absurd_load(outcome: &mut Outcome) -> Result<(), EntryError> {
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
    outcome.holds("ΔSTE is finite at every torque", all_finite(&ste));
    let least = stiffness.iter().map(|p| p[1]).fold(f64::MAX, f64::min);
    let most = stiffness.iter().map(|p| p[1]).fold(0.0, f64::max);
    outcome.at_least(
        "least stiffness at the pitch point",
        least,
        "N/(mm µm)",
        1.0,
    );
    outcome.at_most("greatest over least stiffness", most / least, "", 4.0);
    outcome.chart(
        "Stiffness at the pitch point",
        ("torque (N m)", Scale::Log),
        ("stiffness (N/(mm µm))", Scale::Linear),
        vec![("weber-banaschek", stiffness)],
    );
    Ok(())
}
