//! Coupled cells: extreme loads, gaps and pairs far outside the range of the model's constants.

use gear::{
    Corrections, Discretisation, Error, Infeasibility, Member, Pair, PairInput, ReliefShape, Size,
    TipRelief, ToothModel, Wear, WearLaw, paper::WEAR,
};
use results::report::Scale;

use super::gear_scene::{all_finite, plain};
use crate::stability::outcome::{EntryError, Outcome};
use crate::stability::{Entry, Method};

pub(super) const ENTRIES: [Entry; 3] = [
    Entry {
        id: "gear-coupled-loads",
        title: "Coupled cells under extreme loads and wear",
        input: "“coupled”, spur and helical, 20 µm of tip relief over 2 mm, torques from 10⁶ N m to 10⁻⁶ N m and 0; wear of \
                0.1 µm to 1 mm",
        instead: "The search for the touching cells starts with some cell closed, and changes one cell at a time if it has \
                  not ended after 25 rounds, so that it cannot cycle. A contact of one cell is found, and an empty one \
                  without load.",
        check: loads,
        ..Entry::blank(Method::Gears)
    },
    Entry {
        id: "gear-coupled-slopes",
        title: "Coupled cells under a helix slope beyond the deflection",
        input: "“coupled”, spur and helical, helix slopes from 1 µm to 10 mm over the face, both signs",
        instead: "The contact shrinks to the cells at one end of the face.",
        check: slopes,
        ..Entry::blank(Method::Gears)
    },
    Entry {
        id: "gear-coupled-range",
        title: "Pairs far outside the range of the coupled model",
        input: "“coupled”, 5 to 300 teeth, faces of 0.1 to 60 modules, helix angles from 0 to 45°",
        instead: "The constants are extrapolated. A compliance that loses its positive definiteness is refused as \
                  contact-unresolved, too wide a face with its limit; every other pair has numbers, and files are warned \
                  of.",
        check: range,
        ..Entry::blank(Method::Gears)
    },
];

/// A pair of the coupled model with this helix angle, degrees.
fn input(helix_angle_deg: f64) -> PairInput {
    PairInput {
        helix_angle: helix_angle_deg.to_radians(),
        tooth_model: ToothModel::Coupled,
        ..plain()
    }
}

fn delta(input: &PairInput, corrections: &Corrections) -> Result<f64, Error> {
    let grid = Discretisation::of(ToothModel::Coupled);
    Ok(Pair::with_corrections(input, corrections, &grid)?
        .unworn()
        .delta_ste_um)
}

fn loads(outcome: &mut Outcome) -> Result<(), EntryError> {
    let relief = TipRelief {
        amount: 0.02,
        length: 2.0,
        shape: ReliefShape::Linear,
    };
    let corrections = Corrections::default()
        .with_tip_relief(Member::Pinion, relief)
        .with_tip_relief(Member::Gear, relief);
    let mut curves = Vec::new();
    for (name, angle) in [("spur", 0.0), ("helical", 15.0)] {
        let at = |torque: f64| {
            let input = PairInput {
                pinion_torque: 1e3 * torque,
                ..input(angle)
            };
            delta(&input, &corrections)
        };
        let torques = (0..=48).map(|i| 10_f64.powf(6.0 - f64::from(i) / 4.0));
        let curve = torques
            .map(|torque| Ok([torque, at(torque)?]))
            .collect::<Result<Vec<[f64; 2]>, Error>>()?;
        outcome.holds(
            &format!("ΔSTE is finite at every torque, {name} pair"),
            all_finite(&curve),
        );
        outcome.at_most(
            &format!("distance of ΔSTE at 10⁻⁶ N m from that without load, {name} pair"),
            (at(1e-6)? - at(0.0)?).abs(),
            "µm",
            1e-3,
        );
        curves.push((name, curve));
        let pair = Pair::new(&input(angle), &Discretisation::of(ToothModel::Coupled))?;
        let worn = (0..=16).map(|i| {
            let max_depth_um = 0.1 * 10_f64.powf(f64::from(i) / 4.0);
            let law = WearLaw::Archard { max_depth_um };
            let worn = pair.archard(&Wear { law, ..WEAR });
            [max_depth_um, worn.analysis.delta_ste_um]
        });
        outcome.holds(
            &format!("ΔSTE is finite at every depth of wear, {name} pair"),
            all_finite(&worn.collect::<Vec<[f64; 2]>>()),
        );
    }
    outcome.chart(
        "ΔSTE of coupled cells as the load falls",
        ("torque (N m)", Scale::Log),
        ("ΔSTE (µm)", Scale::Log),
        curves,
    );
    Ok(())
}

fn slopes(outcome: &mut Outcome) -> Result<(), EntryError> {
    let mut curves = Vec::new();
    for (name, angle) in [("spur", 0.0), ("helical", 15.0)] {
        let mut curve = Vec::new();
        for i in 0..=16 {
            let slope = 1e-3 * 10_f64.powf(f64::from(i) / 4.0);
            for sign in [1.0, -1.0] {
                let corrections = Corrections::default().with_helix_slope(sign * slope);
                let delta = delta(&input(angle), &corrections)?;
                if sign > 0.0 {
                    curve.push([1e3 * slope, delta]);
                }
                outcome.holds("ΔSTE is finite at every slope", delta.is_finite());
            }
        }
        curves.push((name, curve));
    }
    outcome.chart(
        "ΔSTE of coupled cells as the helix slope grows",
        ("helix slope (µm)", Scale::Log),
        ("ΔSTE (µm)", Scale::Log),
        curves,
    );
    Ok(())
}

fn range(outcome: &mut Outcome) -> Result<(), EntryError> {
    let (mut numbers, mut strange, mut unresolved, mut other) = (0, 0, 0, 0);
    for pinion in [5, 8, 12, 17, 40, 300] {
        for mate in [17, 60, 300] {
            for width in [0.1, 0.5, 1.0, 2.0, 6.0, 20.0, 60.0] {
                for angle in [0.0, 1.0, 15.0, 30.0, 45.0] {
                    let input = PairInput {
                        teeth: [pinion, mate],
                        size: Size::NormalModule(2.0),
                        face_width: [2.0 * width; 2],
                        ..input(angle)
                    };
                    match delta(&input, &Corrections::default()) {
                        Ok(delta) if delta.is_finite() => numbers += 1,
                        Ok(_) => strange += 1,
                        Err(Error::Infeasible(Infeasibility::ContactUnresolved { .. })) => {
                            unresolved += 1;
                        }
                        Err(_) => other += 1,
                    }
                }
            }
        }
    }
    outcome.holds("every pair has numbers or is refused", strange == 0);
    outcome.figure("pairs with numbers", f64::from(numbers), "");
    outcome.figure(
        "pairs refused as contact-unresolved",
        f64::from(unresolved),
        "",
    );
    outcome.figure("pairs refused for another reason", f64::from(other), "");
    Ok(())
}
