//! Gear pairs near the limits of existence: sweeps that end where no pair exists.

use gear::{Error, Infeasibility, PairInput};
use results::report::Scale;

use super::gear_scene::{all_finite, broken, largest_jump, pair, plain, refused_with, tip_land};
use crate::stability::outcome::{EntryError, Outcome};
use crate::stability::{Entry, Method};

pub(super) const ENTRIES: [Entry; 4] = [
    Entry {
        id: "gear-apex",
        title: "A tip that becomes an apex",
        input: "A pinion of 14 teeth and a full addendum whose profile shift grows from 0.2 to 1.2",
        instead: "The tooth ends at the apex where its flanks meet, and the pair is simulated with that tip. \
                  “tip_land_min_modules”, here 0.2, keeps designs away from it.",
        check: apex,
        ..Entry::blank(Method::Gears)
    },
    Entry {
        id: "gear-contact-ratio-one",
        title: "A transverse contact ratio that falls to 1",
        input: "A spur pair whose tips are turned down until one pair of teeth parts before the next one meets",
        instead: "Two pairs of teeth share the load for a shorter and shorter time. ΔSTE hardly changes, since it is the \
                  step from one pair to two. At exactly 1 one pair hands over to the next at a point, and the step \
                  vanishes. Below 1 the pair is refused.",
        check: contact_ratio_one,
        ..Entry::blank(Method::Gears)
    },
    Entry {
        id: "gear-spur-limit",
        title: "A helix angle that falls to 0",
        input: "β from 30° to 10⁻⁹ degrees, and 0",
        instead: "The window of contact shrinks to a line. Below a limit the pair counts as a spur pair, so that nothing is \
                  divided by sin β = 0.",
        check: spur_limit,
        ..Entry::blank(Method::Gears)
    },
    Entry {
        id: "gear-base-tangent",
        title: "A path of contact up to the base tangent point",
        input: "A spur pair of 17 and 80 teeth whose larger gear gets a longer and longer tip",
        instead: "Specific sliding and pressure grow without limit but stay finite. The pair is refused when the tip would \
                  touch below the base circle.",
        check: base_tangent,
        ..Entry::blank(Method::Gears)
    },
];

fn apex(outcome: &mut Outcome) -> Result<(), EntryError> {
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
            broken(outcome, &pair, "pinion tip land")?;
        }
        ste.push([shift, pair.unworn().delta_ste_um]);
        land.push([shift, tip_land(&pair)]);
    }
    outcome.at_least(
        "profile shift at which the tip is an apex",
        pointed_from,
        "",
        0.3,
    );
    outcome.holds("ΔSTE is finite throughout", all_finite(&ste));
    outcome.at_most(
        "largest jump of ΔSTE over its span",
        largest_jump(&ste),
        "",
        0.2,
    );
    let least = land.iter().map(|p| p[1]).fold(f64::MAX, f64::min);
    outcome.at_least("least tip land", least, "modules", -1e-9);
    outcome.chart(
        "ΔSTE on the way to the apex",
        ("profile shift of the pinion", Scale::Linear),
        ("ΔSTE (µm), tip land (modules)", Scale::Linear),
        vec![("ΔSTE", ste), ("tip land", land)],
    );
    Ok(())
}

fn contact_ratio_one(outcome: &mut Outcome) -> Result<(), EntryError> {
    let input = |cut: f64| PairInput {
        helix_angle: 0.0,
        tip_radius: [0.0; 2],
        tip_diameter: [Some(50.8 - cut), Some(78.4 - cut)],
        hub_radius: [None; 2],
        ..plain()
    };
    let ratio = |cut: f64| match pair(&input(cut)) {
        Ok(pair) => pair.geometry().eps_alpha,
        Err(_) => 0.0,
    };
    // The largest cut with a contact ratio of at least 1.
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
    outcome.at_most(
        "least contact ratio simulated, less 1",
        ratio(low) - 1.0,
        "",
        1e-9,
    );
    outcome.holds("ΔSTE is finite throughout", all_finite(&curve));
    let above = &curve[..40];
    outcome.at_most(
        "largest jump of ΔSTE over its span, above 1",
        largest_jump(above),
        "",
        0.2,
    );
    outcome.figure("ΔSTE just above 1", curve[39][1], "µm");
    outcome.figure("ΔSTE at 1", curve[40][1], "µm");
    refused_with(
        outcome,
        pair(&input(high + 1e-9)),
        "contact-gap",
        |reason| matches!(reason, Infeasibility::ContactGap { eps_alpha, eps_beta: 0.0 } if *eps_alpha < 1.0),
    );
    outcome.chart(
        "ΔSTE of a spur pair as its tips are turned down",
        ("transverse contact ratio", Scale::Linear),
        ("ΔSTE (µm)", Scale::Linear),
        vec![("ΔSTE", curve)],
    );
    Ok(())
}

fn spur_limit(outcome: &mut Outcome) -> Result<(), EntryError> {
    let delta = |degrees: f64| -> Result<f64, Error> {
        let helix_angle = degrees.to_radians();
        let pair = pair(&PairInput {
            helix_angle,
            ..plain()
        })?;
        Ok(pair.unworn().delta_ste_um)
    };
    let spur = delta(0.0)?;
    let mut curve = Vec::new();
    for i in 0..=42 {
        let degrees = 30.0 * 10_f64.powf(-f64::from(i) / 4.0);
        curve.push([degrees, delta(degrees)?]);
    }
    outcome.holds("ΔSTE is finite throughout", all_finite(&curve));
    let from_spur =
        |degrees: f64| -> Result<f64, Error> { Ok((delta(degrees)? / spur - 1.0).abs()) };
    outcome.at_most(
        "relative distance from the spur pair at 10⁻³ degrees",
        from_spur(1e-3)?,
        "",
        1e-3,
    );
    outcome.at_most(
        "relative distance from the spur pair at 10⁻⁹ degrees",
        from_spur(1e-9)?,
        "",
        1e-6,
    );
    outcome.figure("ΔSTE of the spur pair", spur, "µm");
    outcome.chart(
        "ΔSTE as the helix angle falls",
        ("helix angle (degrees)", Scale::Log),
        ("ΔSTE (µm)", Scale::Linear),
        vec![("ΔSTE", curve)],
    );
    Ok(())
}

fn base_tangent(outcome: &mut Outcome) -> Result<(), EntryError> {
    // The shift avoids undercut, which would cut the path off before the base tangent point.
    let input = |dedendum: f64| PairInput {
        teeth: [17, 80],
        helix_angle: 0.0,
        profile_shift: [0.2, -0.2],
        tool_addendum: [1.25, 1.25],
        tool_dedendum: [1.0, dedendum],
        tip_radius: [0.0; 2],
        root_radius: [0.3; 2],
        ..plain()
    };
    let least = 0.6;
    let (mut low, mut high) = (least, 2.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        match pair(&input(middle)) {
            Ok(_) => low = middle,
            Err(_) => high = middle,
        }
    }
    refused_with(
        outcome,
        pair(&input(high)),
        "contact-beyond-base",
        |reason| matches!(reason, Infeasibility::ContactBeyondBase { reach, available, .. } if reach >= available),
    );
    broken(outcome, &pair(&input(low))?, "specific sliding")?;
    let (mut sliding, mut pressure, mut ste) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..=40 {
        let dedendum = low - (low - least) * 10_f64.powf(-f64::from(i) / 4.0);
        let pair = pair(&input(dedendum))?;
        let distance = pair.geometry().s_in;
        sliding.push([distance, pair.sliding().max]);
        pressure.push([distance, pair.unworn().hertz_pressure_mpa]);
        ste.push([distance, pair.unworn().delta_ste_um]);
    }
    for (name, curve) in [
        ("specific sliding", &sliding),
        ("pressure", &pressure),
        ("ΔSTE", &ste),
    ] {
        outcome.holds(&format!("{name} is finite throughout"), all_finite(curve));
    }
    let last = sliding.len() - 1;
    outcome.at_most(
        "least distance simulated from the base tangent point",
        sliding[last][0],
        "mm",
        1e-6,
    );
    outcome.at_least("specific sliding there", sliding[last][1], "", 1e4);
    outcome.figure("pressure there", pressure[last][1], "MPa");
    outcome.figure("ΔSTE there", ste[last][1], "µm");
    outcome.chart(
        "Sliding and pressure towards the base tangent point",
        (
            "start of contact from the base tangent point (mm)",
            Scale::Log,
        ),
        ("specific sliding; pressure (MPa)", Scale::Log),
        vec![("specific sliding", sliding), ("pressure", pressure)],
    );
    Ok(())
}
