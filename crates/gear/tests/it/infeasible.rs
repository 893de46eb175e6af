//! Every refusal is reachable, and carries the numbers that decided it. One is not here: no design is
//! known whose compliance integral stays unresolved; the quadrature's own tests make it.

use gear::{Discretisation, Error, Infeasible, Member, Pair, PairInput, Size, ToothModel};

use crate::support::{figure_7, plain};

fn refusal(input: &PairInput) -> Infeasible {
    match Pair::new(input, &Discretisation::default()) {
        Err(Error::Infeasible(reason)) => reason,
        other => panic!(
            "expected a refusal, got {:?}",
            other.map(|pair| pair.unworn())
        ),
    }
}

fn check(input: &PairInput, code: &str) -> Infeasible {
    let reason = refusal(input);
    assert_eq!(reason.code(), code, "{reason}");
    let text = reason.to_string();
    assert!(
        text.len() > 30 && !text.ends_with('.') && !text.contains("NaN"),
        "{text}"
    );
    reason
}

#[test]
fn no_involute_solution() {
    let reason = check(
        &PairInput {
            profile_shift: [-1.0, -1.0],
            ..plain()
        },
        "no-involute-solution",
    );
    let Infeasible::NoInvoluteSolution { inv_alpha_wt } = reason else {
        unreachable!()
    };
    let (tan_n, z) = (20_f64.to_radians().tan(), 60.0);
    let tan_t = tan_n / 15_f64.to_radians().cos();
    let expected = tan_t - tan_t.atan() - 4.0 * tan_n / z;
    assert!((inv_alpha_wt - expected).abs() < 1e-12 && inv_alpha_wt < 0.0);
}

#[test]
fn root_circle_vanishes() {
    let reason = check(
        &PairInput {
            teeth: [6, 37],
            tool_addendum: [5.0, 1.25],
            ..plain()
        },
        "root-circle-vanishes",
    );
    assert!(matches!(
        reason,
        Infeasible::RootCircleVanishes {
            member: Member::Pinion,
            ..
        }
    ));
}

#[test]
fn tooth_without_thickness() {
    let reason = check(
        &PairInput {
            profile_shift: [-3.0, 3.0],
            tool_addendum: [1.0; 2],
            ..plain()
        },
        "tooth-without-thickness",
    );
    let Infeasible::ToothWithoutThickness { half_angle, .. } = reason else {
        unreachable!()
    };
    assert!(half_angle <= 0.0);
}

/// A pinion whose flanks meet between the base and the reference circle can be cut, but is no beam of
/// its thickness at the reference circle.
#[test]
fn beam_without_thickness() {
    let input = PairInput {
        teeth: [80, 80],
        profile_shift: [-2.3, 2.3],
        tool_addendum: [1.0; 2],
        tool_dedendum: [3.0, 1.0],
        ..plain()
    };
    let reason = check(
        &PairInput {
            tooth_model: ToothModel::PrismaticBeam,
            ..input
        },
        "beam-without-thickness",
    );
    assert!(matches!(
        reason,
        Infeasible::BeamWithoutThickness { thickness, .. } if thickness <= 0.0
    ));
}

#[test]
fn tip_below_base() {
    let reason = check(
        &PairInput {
            tip_diameter: [Some(40.0), None],
            ..plain()
        },
        "tip-below-base",
    );
    assert!(matches!(
        reason,
        Infeasible::TipBelowBase {
            tip_radius: 20.0,
            ..
        }
    ));
}

#[test]
fn tip_below_root() {
    // Many teeth: the root circle lies outside the base circle.
    check(
        &PairInput {
            teeth: [120, 37],
            tip_diameter: [Some(245.6), None],
            tool_addendum: [0.5, 1.25],
            ..plain()
        },
        "tip-below-root",
    );
}

#[test]
fn tip_rounding_too_large() {
    let reason = check(
        &PairInput {
            tip_radius: [9.0, 0.1],
            ..plain()
        },
        "tip-rounding-too-large",
    );
    assert!(matches!(
        reason,
        Infeasible::TipRoundingTooLarge {
            tip_rounding: 9.0,
            ..
        }
    ));
}

#[test]
fn rack_corner_does_not_fit() {
    let reason = check(
        &PairInput {
            root_radius: [0.6, 2.0],
            ..plain()
        },
        "rack-corner-does-not-fit",
    );
    assert!(matches!(
        reason,
        Infeasible::RackCornerDoesNotFit {
            member: Member::Gear,
            ..
        }
    ));
}

#[test]
fn no_involute_flank() {
    // A short tool with a large shift: the corner forms the flank up to the tip.
    check(
        &PairInput {
            teeth: [25, 32],
            profile_shift: [2.8, 0.1],
            tool_addendum: [0.65, 1.25],
            tool_dedendum: [1.95, 1.0],
            root_radius: [0.25, 0.6],
            helix_angle: 0.0,
            ..plain()
        },
        "no-involute-flank",
    );
}

#[test]
fn tooth_severed() {
    check(
        &PairInput {
            teeth: [9, 32],
            pressure_angle: 9_f64.to_radians(),
            profile_shift: [0.5, 0.7],
            tool_addendum: [3.3, 1.25],
            tool_dedendum: [1.3, 0.0],
            tip_radius: [0.0; 2],
            root_radius: [0.25, 0.2],
            helix_angle: 0.0,
            ..plain()
        },
        "tooth-severed",
    );
}

#[test]
fn contact_beyond_base() {
    let reason = check(
        &PairInput {
            teeth: [8, 80],
            tool_dedendum: [1.0, 1.5],
            ..plain()
        },
        "contact-beyond-base",
    );
    let Infeasible::ContactBeyondBase {
        reach, available, ..
    } = reason
    else {
        unreachable!()
    };
    assert!(reach >= available);
}

#[test]
fn contact_gap() {
    // Tips turned down until the pairs no longer overlap.
    let spur = PairInput {
        helix_angle: 0.0,
        ..plain()
    };
    let reason = check(
        &PairInput {
            tip_diameter: [Some(47.6), Some(75.2)],
            ..spur
        },
        "contact-gap",
    );
    let Infeasible::ContactGap {
        eps_alpha,
        eps_beta,
    } = reason
    else {
        unreachable!()
    };
    assert!(eps_alpha < 1.0 && eps_beta == 0.0);
}

#[test]
fn fillet_cusp() {
    // Needs a corner wider than four times r sin²α/cos α, its centre just above the rolling line:
    // few teeth and a very small pressure angle.
    check(
        &PairInput {
            teeth: [6, 80],
            pressure_angle: 3_f64.to_radians(),
            helix_angle: 10_f64.to_radians(),
            face_width: 100.0,
            profile_shift: [0.5, 0.0],
            tool_addendum: [1.2304, 1.25],
            tool_dedendum: [0.8, 0.2],
            tip_radius: [0.0; 2],
            root_radius: [1.5, 0.2],
            ..plain()
        },
        "fillet-cusp",
    );
}

#[test]
fn bad_numbers_name_their_field() {
    let nan = f64::NAN;
    let cases: [(&str, PairInput); 16] = [
        (
            "teeth[1]",
            PairInput {
                teeth: [20, 0],
                ..plain()
            },
        ),
        (
            "centre_distance",
            PairInput {
                size: Size::CentreDistance(nan),
                ..plain()
            },
        ),
        (
            "normal_module",
            PairInput {
                size: Size::NormalModule(-1.0),
                ..plain()
            },
        ),
        (
            "pressure_angle",
            PairInput {
                pressure_angle: 0.0,
                ..plain()
            },
        ),
        (
            "helix_angle",
            PairInput {
                helix_angle: f64::INFINITY,
                ..plain()
            },
        ),
        (
            "face_width",
            PairInput {
                face_width: 0.0,
                ..plain()
            },
        ),
        (
            "profile_shift[0]",
            PairInput {
                profile_shift: [nan, 0.0],
                ..plain()
            },
        ),
        (
            "tool_addendum[1]",
            PairInput {
                tool_addendum: [1.0, -0.1],
                ..plain()
            },
        ),
        (
            "tool_dedendum[0]",
            PairInput {
                tool_dedendum: [1e9, 1.0],
                ..plain()
            },
        ),
        (
            "tip_radius[1]",
            PairInput {
                tip_radius: [0.0, -1e-9],
                ..plain()
            },
        ),
        (
            "root_radius[0]",
            PairInput {
                root_radius: [0.0, 0.5],
                ..plain()
            },
        ),
        (
            "tip_diameter[1]",
            PairInput {
                tip_diameter: [None, Some(nan)],
                ..plain()
            },
        ),
        (
            "pinion_torque",
            PairInput {
                pinion_torque: -1.0,
                ..plain()
            },
        ),
        ("poisson_ratio", {
            let mut input = plain();
            input.material.poisson_ratio = 0.5;
            input
        }),
        ("youngs_modulus_mpa", {
            let mut input = plain();
            input.material.youngs_modulus_mpa = nan;
            input
        }),
        ("yield_mpa", {
            let mut input = plain();
            input.material.yield_mpa = 0.0;
            input
        }),
    ];
    for (field, input) in cases {
        match Pair::new(&input, &Discretisation::default()) {
            Err(Error::Input(error)) => {
                assert_eq!(error.field, field);
                assert!(error.to_string().contains("must be"), "{error}");
            }
            other => panic!("{field}: {:?}", other.map(|pair| pair.unworn())),
        }
    }
    let coarse = Discretisation {
        cells: 1,
        phases: 48,
    };
    assert!(
        matches!(Pair::new(&plain(), &coarse), Err(Error::Input(error)) if error.field == "cells")
    );
}

/// `clear-root` turns a pressing tip down to zero clearance and leaves the others alone.
#[test]
fn clear_root_ends_at_zero_clearance() {
    let pressing = PairInput {
        tool_dedendum: [1.6, 1.0],
        ..plain()
    };
    let disc = Discretisation::default();
    let as_cut = Pair::new(&pressing, &disc).unwrap();
    assert!(as_cut.geometry().clearance[0] < -0.1);
    let cleared = PairInput {
        tip_rule: gear::TipRule::ClearRoot,
        ..pressing
    };
    let cleared = Pair::new(&cleared, &disc).unwrap();
    assert!(cleared.geometry().clearance[0].abs() < 1e-12);
    assert_eq!(
        cleared.geometry().clearance[1],
        as_cut.geometry().clearance[1]
    );
    let unchanged = PairInput {
        tip_rule: gear::TipRule::ClearRoot,
        ..figure_7()
    };
    assert_eq!(
        Pair::new(&unchanged, &disc).unwrap().geometry(),
        Pair::new(&figure_7(), &disc).unwrap().geometry()
    );
}
