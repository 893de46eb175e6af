//! Gear pairs that do not exist, and pairs that are simulated although they should not be built.

use gear::{
    Corrections, Discretisation, FlankClass, Pair, PairInput, Size, ToothModel,
    paper::{self, FIGURE_7},
};

use super::gear_scene::{broken, pair, plain, refused};
use crate::stability::outcome::{Failed, Outcome};
use crate::stability::{Entry, Method};

pub(super) const ENTRIES: [Entry; 5] = [
    Entry {
        id: "gear-no-tooth",
        title: "Teeth that do not exist",
        input: "No working pressure angle, no root circle, no thickness at the base circle or at the reference circle, \
                a tip below base or root circle",
        instead: "Each is refused with the numbers that decided it, before anything costly is computed.",
        check: no_tooth,
        ..Entry::blank(Method::Gears)
    },
    Entry {
        id: "gear-no-flank",
        title: "Tools that leave no flank",
        input: "A tip rounding wider than the flank, a rack corner wider than its tooth, a corner that sweeps a cusp, a \
                fillet over the whole flank, an undercut that severs the tooth",
        instead: "Each is refused with the numbers that decided it.",
        check: no_flank,
        ..Entry::blank(Method::Gears)
    },
    Entry {
        id: "gear-below-form-circle",
        title: "A mate’s tip below the form circle",
        input: "The paper’s Figure 7 with the pinion’s corner grown until the fillet reaches into the active flank",
        instead: "The pair is simulated along an involute that is not there, as in the paper, and its flank margin is \
                  negative: simulable, not feasible, and never an optimum.",
        check: below_form_circle,
        ..Entry::blank(Method::Gears)
    },
    Entry {
        id: "gear-crowning",
        title: "Crowning where the model has no place for it",
        input: "Crowning with “whole-face-beam”, and with a contact ratio above 100",
        instead: "Both are refused: the first has one gap for the whole face, the second would take too long.",
        check: crowning,
        ..Entry::blank(Method::Gears)
    },
    Entry {
        id: "gear-unusable",
        title: "Numbers outside the model",
        input: "3 teeth, a module of NaN, a helix angle of 75°, a pressure angle in degrees, a grid of 2 cells, flank \
                class 12",
        instead: "Each is refused with the field, the value and the domain.",
        check: unusable,
        ..Entry::blank(Method::Gears)
    },
];

fn no_tooth(found: &mut Outcome) -> Result<(), Failed> {
    let cases = [
        (
            "no-involute-solution",
            PairInput {
                profile_shift: [-1.0, -1.0],
                ..plain()
            },
        ),
        (
            "root-circle-vanishes",
            PairInput {
                teeth: [6, 37],
                tool_addendum: [5.0, 1.25],
                ..plain()
            },
        ),
        (
            "tooth-without-thickness",
            PairInput {
                profile_shift: [-3.0, 3.0],
                tool_addendum: [1.0; 2],
                ..plain()
            },
        ),
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
        ),
        (
            "tip-below-base",
            PairInput {
                tip_diameter: [Some(40.0), None],
                ..plain()
            },
        ),
        (
            "tip-below-root",
            PairInput {
                teeth: [120, 37],
                tip_diameter: [Some(245.6), None],
                tool_addendum: [0.5, 1.25],
                ..plain()
            },
        ),
    ];
    for (expected, input) in cases {
        refused(found, pair(&input), expected);
    }
    Ok(())
}

fn no_flank(found: &mut Outcome) -> Result<(), Failed> {
    let cases = [
        (
            "tip-rounding-too-large",
            PairInput {
                tip_radius: [9.0, 0.1],
                ..plain()
            },
        ),
        (
            "rack-corner-does-not-fit",
            PairInput {
                root_radius: [0.6, 2.0],
                ..plain()
            },
        ),
        (
            "fillet-cusp",
            PairInput {
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
        ),
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
        ),
    ];
    for (expected, input) in cases {
        refused(found, pair(&input), expected);
    }
    Ok(())
}

fn below_form_circle(found: &mut Outcome) -> Result<(), Failed> {
    let mut input = paper::design(FIGURE_7);
    input.tool_addendum[0] = 0.9;
    let pair = pair(&input)?;
    let interference = pair.interference();
    let margin = interference
        .flank_margin
        .into_iter()
        .fold(f64::MAX, f64::min);
    found.at_most("flank margin", margin, "mm", 0.0);
    found.holds("the interference is not clear", !interference.is_clear());
    broken(found, &pair, "pinion flank margin")?;
    let delta = pair.unworn().delta_ste_um;
    found.at_least("ΔSTE all the same", delta, "µm", 0.0);
    Ok(())
}

fn crowning(found: &mut Outcome) -> Result<(), Failed> {
    let crowned = Corrections::default().with_crowning(0.005);
    let with_crowning =
        |input: &PairInput| Pair::with_corrections(input, &crowned, &Discretisation::default());
    let whole = PairInput {
        tooth_model: ToothModel::WholeFaceBeam,
        ..plain()
    };
    refused(found, with_crowning(&whole), "crowning");
    let wide = PairInput {
        face_width: 5000.0,
        ..plain()
    };
    refused(found, with_crowning(&wide), "crowning");
    found.holds(
        "a plain pair takes crowning",
        with_crowning(&plain()).is_ok(),
    );
    Ok(())
}

fn unusable(found: &mut Outcome) -> Result<(), Failed> {
    let cases = [
        (
            "teeth[0]",
            PairInput {
                teeth: [3, 37],
                ..plain()
            },
        ),
        (
            "normal_module",
            PairInput {
                size: Size::NormalModule(f64::NAN),
                ..plain()
            },
        ),
        (
            "helix_angle",
            PairInput {
                helix_angle: 75_f64.to_radians(),
                ..plain()
            },
        ),
        (
            "pressure_angle",
            PairInput {
                pressure_angle: 20.0,
                ..plain()
            },
        ),
    ];
    for (expected, input) in cases {
        refused(found, pair(&input), expected);
    }
    let coarse = Discretisation {
        cells: 2,
        phases: 32,
    };
    refused(found, Pair::new(&plain(), &coarse), "cells");
    found.holds("there is no flank class 12", FlankClass::new(12).is_none());
    Ok(())
}
