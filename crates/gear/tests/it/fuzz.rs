//! A fixed budget of random and hostile inputs: never a panic, a NaN or an endless loop. The `fuzz`
//! example runs the same with any budget.

use gear::{Kernel, LocalAmount, Wear, WearLaw};

use crate::adversary;
use crate::support::rng;

#[test]
fn no_input_breaks_the_simulator() {
    let outcomes = adversary::run(20_000, &mut rng(77)).unwrap_or_else(|what| panic!("{what}"));
    assert!(
        outcomes["feasible"] > 4_000,
        "the fuzz should reach the solver often: {outcomes:?}"
    );
    // Refusals, refused numbers and pairs that pass; the rarest reasons need a longer run.
    assert!(
        outcomes.len() >= 10,
        "the fuzz should see most refusals: {outcomes:?}"
    );
}

/// Found by the long fuzz: a torque of the smallest positive number, against worn flanks, is lost in
/// the rounding of the gap and came out as a deflection of −1e-25.
#[test]
fn a_vanishing_torque_does_not_pull() {
    let input = gear::PairInput {
        pinion_torque: f64::MIN_POSITIVE,
        ..crate::support::plain()
    };
    for max_depth_um in [0.01, 1.0, 100.0] {
        let wear = Wear {
            law: WearLaw::Archard { max_depth_um },
            ..crate::support::WEAR
        };
        let analysis = crate::support::pair(&input).archard(&wear).analysis;
        assert!(analysis.ste_um.iter().all(|&ste| ste >= 0.0));
    }
}

/// Found by the long fuzz: a tooth left standing on a waist of 1e-7 mm, whose 1/x³ is lost in the
/// rounding of the coordinates, is severed for every purpose.
#[test]
fn a_waist_of_rounding_is_severed() {
    let input = gear::PairInput {
        teeth: [11, 37],
        size: gear::Size::CentreDistance(56.90769413193406),
        pressure_angle: 0.09326553507557911,
        helix_angle: 0.21993414515416576,
        face_width: [424.0166121026698; 2],
        profile_shift: [2.1026077500658236, -0.9045902708532203],
        tool_addendum: [2.509818346600639, 2.592574144051521],
        tool_dedendum: [2.4810130191739543, 1.9534047976768738],
        tip_radius: [0.3536401135382794, 0.9],
        root_radius: [1.2162266016285461, 0.05506905044608207],
        tip_rule: gear::TipRule::ClearRoot,
        ..crate::support::plain()
    };
    match gear::Pair::new(&input, &gear::Discretisation::default()) {
        Err(gear::Error::Infeasible(gear::Infeasibility::ToothSevered {
            half_thickness, ..
        })) => {
            assert!(half_thickness < 3e-6, "{half_thickness}");
        }
        other => panic!("{:?}", other.map(|pair| pair.pitch_stiffness())),
    }
}

/// Found by the fuzz: in the middle of the path the load lies below the roots of both teeth, so that whole
/// teeth have contact compliance alone there.
#[test]
fn whole_teeth_that_do_not_bend_have_an_error() {
    let input = gear::PairInput {
        teeth: [629, 141],
        size: gear::Size::CentreDistance(337.99580516452727),
        pressure_angle: 0.7710656630102593,
        helix_angle: -0.6351528898489597,
        face_width: [218.15534747251795; 2],
        profile_shift: [2.7796301003235877, 2.386810655218194],
        tool_addendum: [0.5623853790019995, 0.15227823532916024],
        tool_dedendum: [3.2843885601423786, 3.4],
        tip_radius: [0.385424711527318, 0.546935703572801],
        root_radius: [0.1746851491553291, 0.31940164594299747],
        tooth_model: gear::ToothModel::WholeFaceBeam,
        ..crate::support::plain()
    };
    let whole = crate::support::pair(&input).unworn();
    let slices = crate::support::pair(&gear::PairInput {
        tooth_model: gear::ToothModel::HertzBeam,
        ..input
    });
    let ratio = whole.ste_um[0] / slices.unworn().ste_um[0];
    assert!((0.9..1.1).contains(&ratio), "{ratio}");
}

/// A wear that does not validate gives NaN at worst.
#[test]
fn an_invalid_wear_does_not_panic() {
    let pair = crate::support::pair(&crate::support::plain());
    for (depth, range, variance) in [
        (f64::NAN, 0.2, 0.01),
        (1e-3, 0.0, 0.01),
        (1e-3, f64::NAN, 0.01),
        (1e-3, f64::INFINITY, 0.01),
        (1e-3, 0.2, f64::NAN),
        (-1.0, -1.0, -1.0),
    ] {
        let (max_depth_um, coefficient) = (depth, depth);
        for law in [
            WearLaw::Archard { max_depth_um },
            WearLaw::Signed { coefficient },
            WearLaw::LocalArchard {
                amount: LocalAmount::MaxDepth { max_depth_um },
            },
            WearLaw::LocalArchard {
                amount: LocalAmount::Cycles {
                    coefficient,
                    pinion_cycles: 1e6,
                },
            },
            WearLaw::LocalArchard {
                amount: LocalAmount::Cycles {
                    coefficient: 1e-10,
                    pinion_cycles: depth,
                },
            },
        ] {
            let wear = Wear {
                law,
                kernel: Kernel::Exponential,
                range,
                variance,
                life: None,
            };
            assert!(wear.validate().is_err());
            let _ = pair.archard(&wear);
            let _ = pair.sampler(&wear).draw(&mut rng(1));
        }
    }
}
