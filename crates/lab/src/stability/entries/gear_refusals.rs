//! Gear pairs that do not exist, and pairs that can be simulated but should not be built.

use gear::{
    Corrections, Discretisation, FlankClass, Infeasibility, Member, Pair, PairInput, ReliefShape,
    Size, TipRelief, ToothModel,
    paper::{self, FIGURE_7},
};

use super::gear_scene::{broken, pair, plain, refused, refused_with};
use crate::stability::outcome::{EntryError, Outcome};
use crate::stability::{Entry, Method};

pub(super) const ENTRIES: [Entry; 5] = [
    Entry {
        id: "gear-no-tooth",
        title: "Teeth that do not exist",
        input: "No working pressure angle, no root circle, no thickness at the base circle or at the reference circle, \
                a tip below base or root circle",
        instead: "Each is refused with the deciding values, before the costly part of the computation.",
        check: no_tooth,
        ..Entry::blank(Method::Gears)
    },
    Entry {
        id: "gear-no-flank",
        title: "Tools that leave no flank",
        input: "A tip rounding wider than the flank, a rack corner wider than its tooth, a corner that sweeps a cusp, a \
                fillet over the whole flank, an undercut that severs the tooth",
        instead: "Each is refused with the deciding values.",
        check: no_flank,
        ..Entry::blank(Method::Gears)
    },
    Entry {
        id: "gear-below-form-circle",
        title: "A mate’s tip below the form circle",
        input: "The paper’s Figure 7 with the pinion’s corner grown until the fillet reaches into the active flank",
        instead: "As in the paper, the pair is simulated along an involute that the fillet has cut away. Its flank margin \
                  is negative: the pair is simulable but not feasible, and never an optimum.",
        check: below_form_circle,
        ..Entry::blank(Method::Gears)
    },
    Entry {
        id: "gear-crowning",
        title: "Corrections that the model does not take",
        input: "Crowning with “whole-face-beam” and with a contact ratio above 100; a crowning of −0.001 mm and of NaN; a \
                tip relief of length 0 and one of −1 mm",
        instead: "Each is refused with the field, the value and the domain. “whole-face-beam” has one gap for the whole \
                  face, and so large a contact ratio would take too long.",
        check: corrections,
        ..Entry::blank(Method::Gears)
    },
    Entry {
        id: "gear-unusable",
        title: "Values outside the model",
        input: "Every field of a pair with NaN, ∞ or a value outside its domain, such as 3 teeth, a helix angle of 75° or \
                a pressure angle in degrees; grids of 1 and 2 cells; flank class 12",
        instead: "Each is refused with the field, the value and the domain.",
        check: unusable,
        ..Entry::blank(Method::Gears)
    },
];

/// A refused pair: the code of the reason, the input, and whether the reason carries the right values.
type Refusal = (&'static str, PairInput, fn(&Infeasibility) -> bool);

fn all_refused(outcome: &mut Outcome, refusals: impl IntoIterator<Item = Refusal>) {
    for (expected, input, carries_values) in refusals {
        refused_with(outcome, pair(&input), expected, carries_values);
    }
}

// No input is known for the reason `compliance-unresolved`: the tests of the quadrature in `gear` have it.
fn no_tooth(outcome: &mut Outcome) -> Result<(), EntryError> {
    let refusals: [Refusal; 6] = [
        (
            "no-involute-solution",
            PairInput {
                profile_shift: [-1.0, -1.0],
                ..plain()
            },
            |reason| {
                let tan_n = 20_f64.to_radians().tan();
                let tan_t = tan_n / 15_f64.to_radians().cos();
                let expected = tan_t - tan_t.atan() - 4.0 * tan_n / 60.0;
                matches!(reason, Infeasibility::NoInvoluteSolution { inv_alpha_wt }
                    if (inv_alpha_wt - expected).abs() < 1e-12 && *inv_alpha_wt < 0.0)
            },
        ),
        (
            "root-circle-vanishes",
            PairInput {
                teeth: [6, 37],
                tool_addendum: [5.0, 1.25],
                ..plain()
            },
            |reason| {
                matches!(reason, Infeasibility::RootCircleVanishes { member: Member::Pinion, root_radius }
                    if *root_radius <= 0.0)
            },
        ),
        (
            "tooth-without-thickness",
            PairInput {
                profile_shift: [-3.0, 3.0],
                tool_addendum: [1.0; 2],
                ..plain()
            },
            |reason| matches!(reason, Infeasibility::ToothWithoutThickness { half_angle, .. } if *half_angle <= 0.0),
        ),
        // The flanks meet between the base and the reference circle: the pinion can be cut, but a beam with its
        // thickness at the reference circle does not exist.
        (
            "beam-without-thickness",
            PairInput {
                teeth: [80, 80],
                profile_shift: [-2.3, 2.3],
                tool_addendum: [1.0; 2],
                tool_dedendum: [3.0, 1.0],
                tooth_model: ToothModel::PrismaticBeam,
                ..plain()
            },
            |reason| matches!(reason, Infeasibility::BeamWithoutThickness { thickness, .. } if *thickness <= 0.0),
        ),
        (
            "tip-below-base",
            PairInput {
                tip_diameter: [Some(40.0), None],
                ..plain()
            },
            |reason| {
                matches!(
                    reason,
                    Infeasibility::TipBelowBase {
                        tip_radius: 20.0,
                        ..
                    }
                )
            },
        ),
        // With many teeth the root circle lies outside the base circle.
        (
            "tip-below-root",
            PairInput {
                teeth: [120, 37],
                tip_diameter: [Some(245.6), None],
                tool_addendum: [0.5, 1.25],
                ..plain()
            },
            |reason| {
                matches!(reason, Infeasibility::TipBelowRoot { tip_radius, root_radius, .. }
                    if tip_radius <= root_radius)
            },
        ),
    ];
    all_refused(outcome, refusals);
    Ok(())
}

fn no_flank(outcome: &mut Outcome) -> Result<(), EntryError> {
    let refusals: [Refusal; 5] = [
        (
            "tip-rounding-too-large",
            PairInput {
                tip_radius: [9.0, 0.1],
                ..plain()
            },
            |reason| {
                matches!(
                    reason,
                    Infeasibility::TipRoundingTooLarge {
                        tip_rounding: 9.0,
                        ..
                    }
                )
            },
        ),
        (
            "rack-corner-does-not-fit",
            PairInput {
                root_radius: [0.6, 2.0],
                ..plain()
            },
            |reason| {
                matches!(
                    reason,
                    Infeasibility::RackCornerDoesNotFit {
                        member: Member::Gear,
                        ..
                    }
                )
            },
        ),
        // A cusp needs a corner wider than four times r sin²α/cos α, with its centre just above the rolling line: few
        // teeth and a very small pressure angle.
        (
            "fillet-cusp",
            PairInput {
                teeth: [6, 80],
                pressure_angle: 3_f64.to_radians(),
                helix_angle: 10_f64.to_radians(),
                face_width: [100.0; 2],
                profile_shift: [0.5, 0.0],
                tool_addendum: [1.2304, 1.25],
                tool_dedendum: [0.8, 0.2],
                tip_radius: [0.0; 2],
                root_radius: [1.5, 0.2],
                ..plain()
            },
            |reason| matches!(reason, Infeasibility::FilletCusp { height, .. } if *height > 0.0),
        ),
        // A short tool with a large shift: its corner forms the flank up to the tip.
        (
            "no-involute-flank",
            PairInput {
                teeth: [25, 32],
                profile_shift: [2.8, 0.1],
                tool_addendum: [0.65, 1.25],
                tool_dedendum: [1.95, 1.0],
                root_radius: [0.25, 0.6],
                helix_angle: 0.0,
                ..plain()
            },
            |reason| matches!(reason, Infeasibility::NoInvoluteFlank { start, end, .. } if start >= end),
        ),
        (
            "tooth-severed",
            PairInput {
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
            |reason| matches!(reason, Infeasibility::ToothSevered { half_thickness, .. } if *half_thickness < 3e-6),
        ),
    ];
    all_refused(outcome, refusals);
    Ok(())
}

fn below_form_circle(outcome: &mut Outcome) -> Result<(), EntryError> {
    let mut input = paper::design(FIGURE_7);
    input.tool_addendum[0] = 0.9;
    let pair = pair(&input)?;
    let interference = pair.interference();
    let margin = interference
        .flank_margin
        .into_iter()
        .fold(f64::MAX, f64::min);
    outcome.at_most("flank margin", margin, "mm", 0.0);
    outcome.holds("the interference is not clear", !interference.is_clear());
    broken(outcome, &pair, "pinion flank margin")?;
    let delta = pair.unworn().delta_ste_um;
    outcome.at_least("ΔSTE all the same", delta, "µm", 0.0);
    Ok(())
}

fn corrections(outcome: &mut Outcome) -> Result<(), EntryError> {
    let none = Corrections::default();
    let corrected = |input: &PairInput, corrections: &Corrections| {
        Pair::with_corrections(input, corrections, &Discretisation::default())
    };
    let crowned = none.with_crowning(0.005);
    let whole = PairInput {
        tooth_model: ToothModel::WholeFaceBeam,
        ..plain()
    };
    refused(outcome, corrected(&whole, &crowned), "crowning");
    let wide = PairInput {
        face_width: [5000.0; 2],
        ..plain()
    };
    refused(outcome, corrected(&wide, &crowned), "crowning");
    outcome.holds(
        "a plain pair takes crowning",
        corrected(&plain(), &crowned).is_ok(),
    );
    for amount in [-1e-3, f64::NAN] {
        refused(
            outcome,
            corrected(&plain(), &none.with_crowning(amount)),
            "crowning",
        );
    }
    for (member, amount, length, expected) in [
        (Member::Gear, 1e-3, 0.0, "tip_relief[1].length"),
        (Member::Pinion, -1.0, 1.0, "tip_relief[0].amount"),
    ] {
        let relief = TipRelief {
            amount,
            length,
            shape: ReliefShape::Linear,
        };
        refused(
            outcome,
            corrected(&plain(), &none.with_tip_relief(member, relief)),
            expected,
        );
    }
    Ok(())
}

fn unusable(outcome: &mut Outcome) -> Result<(), EntryError> {
    type Change = fn(&mut PairInput);
    let changes: [(&str, Change); 19] = [
        ("teeth[0]", |pair| pair.teeth = [3, 37]),
        ("teeth[1]", |pair| pair.teeth = [20, 0]),
        ("centre_distance", |pair| {
            pair.size = Size::CentreDistance(f64::NAN)
        }),
        ("normal_module", |pair| {
            pair.size = Size::NormalModule(f64::NAN)
        }),
        ("normal_module", |pair| pair.size = Size::NormalModule(-1.0)),
        ("pressure_angle", |pair| pair.pressure_angle = 20.0),
        ("pressure_angle", |pair| pair.pressure_angle = 0.0),
        ("helix_angle", |pair| pair.helix_angle = 75_f64.to_radians()),
        ("helix_angle", |pair| pair.helix_angle = f64::INFINITY),
        ("face_width", |pair| pair.face_width[0] = 0.0),
        ("profile_shift[0]", |pair| pair.profile_shift[0] = f64::NAN),
        ("tool_addendum[1]", |pair| pair.tool_addendum[1] = -0.1),
        ("tool_dedendum[0]", |pair| pair.tool_dedendum[0] = 1e9),
        ("tip_radius[1]", |pair| pair.tip_radius[1] = -1e-9),
        ("root_radius[0]", |pair| pair.root_radius[0] = 0.0),
        ("tip_diameter[1]", |pair| {
            pair.tip_diameter[1] = Some(f64::NAN)
        }),
        ("pinion_torque", |pair| pair.pinion_torque = -1.0),
        ("material[0].poisson_ratio", |pair| {
            pair.material[0].poisson_ratio = 0.5
        }),
        ("material[1].youngs_modulus_mpa", |pair| {
            pair.material[1].youngs_modulus_mpa = f64::NAN
        }),
    ];
    for (expected, change) in changes {
        let mut input = plain();
        change(&mut input);
        refused(outcome, pair(&input), expected);
    }
    for cells in [1, 2] {
        let coarse = Discretisation { cells, phases: 32 };
        refused(outcome, Pair::new(&plain(), &coarse), "cells");
    }
    outcome.holds("there is no flank class 12", FlankClass::new(12).is_none());
    Ok(())
}
