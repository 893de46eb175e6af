//! Doubts about a simulated pair. [`PairFile::warnings`](problem::PairFile::warnings) has the doubts that the file
//! alone shows.

use gear::inspection::{Limits, Sheet};
use gear::{Analysis, Pair, Range, ToothModel};
use problem::file::{Allowances, outside};
use problem::formulation::{Design, Problem};

use crate::number::significant;

/// Distance of the overlap ratio from a whole number within which ΔSTE is least and changes fast.
const WHOLE: f64 = 0.03;
/// Share of the path of contact above which a tip relief leaves too little unmodified.
const MOST_RELIEF: f64 = 0.5;
/// Line load F_t/b in N/mm above which the torque was probably given in another unit. The warnings of the file cover
/// small ones.
const MOST_LINE_LOAD: f64 = 3000.0;
/// Contact pressure in MPa above which the torque was probably given in another unit.
const MOST_PRESSURE_MPA: f64 = 3000.0;
/// The range of ΔSTE of gears, µm.
const DELTA_STE_UM: [f64; 2] = [1e-3, 100.0];

/// Results of a pair under load.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Loaded {
    /// ΔSTE with new flanks, µm.
    pub delta_ste_um: f64,
    /// ΔSTE with the mean wear, µm; absent if it was not computed.
    pub worn_um: Option<f64>,
    /// Highest contact pressure, MPa.
    pub pressure_mpa: f64,
}

impl Loaded {
    /// The results of these analyses of a pair, new and with the mean wear.
    #[must_use]
    pub fn new(new: &Analysis, worn: Option<&Analysis>) -> Self {
        Self {
            delta_ste_um: new.delta_ste_um,
            worn_um: worn.map(|worn| worn.delta_ste_um),
            pressure_mpa: new.hertz_pressure_mpa,
        }
    }
}

/// The doubts about a design of a gear campaign; none if an external program simulates it.
#[must_use]
pub fn of_design(problem: &Problem, design: &Design) -> Vec<String> {
    let built_in = !problem.campaign().is_external();
    let Some(gears) = problem.gears().filter(|_| built_in) else {
        return Vec::new();
    };
    // The comparison with new flanks is left out if a load case of the campaign has new flanks.
    let sections = problem.campaign().gears();
    let cases = sections.map_or(&[][..], |sections| &sections.load.cases);
    let compares_new = cases.iter().any(|case| case.wear == 0.0);
    gears.pair(design).map_or_else(
        |_| Vec::new(),
        |pair| {
            let worn = (!compares_new).then(|| pair.archard(gears.wear()).analysis);
            let loaded = Loaded::new(&pair.unworn(), worn.as_ref());
            let allowances = sections.and_then(|sections| sections.allowances.as_ref());
            of(&pair, &loaded, allowances)
        },
    )
}

/// The doubts about a pair, whose thicknesses and centre distance may have `allowances`.
#[must_use]
pub fn of(pair: &Pair, loaded: &Loaded, allowances: Option<&Allowances>) -> Vec<String> {
    let (g, input) = (pair.geometry(), pair.input());
    let mut doubts = Vec::new();
    if g.beta > 0.0 && g.eps_beta > 0.5 && (g.eps_beta - g.eps_beta.round()).abs() < WHOLE {
        doubts.push(format!(
            "the overlap ratio ε_β is {:.3}, next to a whole number, where ΔSTE of perfect flanks is least and changes fast: \
             vary the face width by a tenth to see how far the result depends on it",
            g.eps_beta
        ));
    }
    doubts.extend(allowances.and_then(|allowances| of_backlash(pair, allowances)));
    if input.tooth_model == ToothModel::Coupled {
        doubts.extend(beyond_comparison(pair));
    }
    // The warnings of the file cover the face width for the coupled model.
    let width = g.face_width / g.normal_module;
    if input.tooth_model != ToothModel::Coupled && !Range::FACE_WIDTH.contains(width) {
        let [low, high] = Range::FACE_WIDTH.limits;
        doubts.push(format!(
            "b/m_n is {width:.2}: tooth models were compared with finite elements for {low} to {high}; outside, take ΔSTE as \
             a tendency only"
        ));
    }
    let [start, end] = g.path_left();
    for (gear, relief) in ["pinion", "mate"].iter().zip(pair.corrections().tip_relief) {
        let relief = relief.filter(|relief| relief.amount > 0.0);
        let share = relief.map_or(0.0, |relief| relief.length / (end - start));
        if share > MOST_RELIEF {
            doubts.push(format!(
                "the tip relief of the {gear} covers {:.0} % of the path of contact, more than half, which costs contact ratio at \
                 light loads: shorten corrections.tip_relief_length_mm",
                100.0 * share
            ));
        }
    }
    doubts.extend(of_tips(pair));
    doubts.extend(of_load(pair, loaded.pressure_mpa));
    doubts.extend(of_transmission_error(loaded));
    doubts
}

/// A doubt about allowances that leave no backlash. A nominal pair without backlash is refused before.
fn of_backlash(pair: &Pair, allowances: &Allowances) -> Option<String> {
    let limits = Limits::new(pair, &Sheet::new(pair), &allowances.to_gear());
    let [_, least] = limits.normal_backlash;
    // The backlash is zero up to rounding if it follows from the centre distance.
    (least < -1e-6).then(|| {
        format!(
            "the smallest normal backlash j_bn within [allowances] is {} mm, so the teeth can jam: thinner teeth or a larger \
             centre distance give them room",
            significant(least, 3)
        )
    })
}

/// Doubts about a pair for which the coupled tooth model was not compared with finite elements. The warnings of the file
/// cover what all designs of a campaign share.
fn beyond_comparison(pair: &Pair) -> Vec<String> {
    let each = ["pinion", "mate"]
        .into_iter()
        .zip(pair.input().profile_shift);
    let mut doubts: Vec<String> = each
        .filter_map(|(gear, shift)| {
            outside(
                Range::PROFILE_SHIFT,
                &format!("the profile shift of the {gear}"),
                &[shift],
            )
        })
        .collect();
    if pair.geometry().undercut.contains(&true) {
        doubts.push(
            "a tooth is undercut: the tooth model \"coupled\" was not compared with finite elements for that".to_owned(),
        );
    }
    doubts
}

/// Doubts about given tip diameters that the teeth do not reach, because they become pointed before.
fn of_tips(pair: &Pair) -> impl Iterator<Item = String> {
    let tips = ["pinion", "mate"]
        .into_iter()
        .zip(pair.input().tip_diameter);
    let reached = pair.geometry().r_a.map(|r| 2.0 * r);
    tips.zip(reached).filter_map(|((gear, given), reached)| {
        let given = given.filter(|given| reached < given - 1e-6)?;
        Some(format!(
            "pair.tip_diameter_mm of the {gear} is {given}, but its tooth becomes pointed at {reached:.3} mm and ends there"
        ))
    })
}

/// A doubt about the torque.
fn of_load(pair: &Pair, pressure_mpa: f64) -> Option<String> {
    let (g, torque) = (pair.geometry(), pair.input().pinion_torque);
    let line_load = torque / (g.r[0] * g.face_width);
    let implausible = if line_load > MOST_LINE_LOAD {
        format!("the line load F_t/b is {line_load:.0} N/mm, above {MOST_LINE_LOAD}")
    } else if pressure_mpa > MOST_PRESSURE_MPA {
        format!("the contact pressure is {pressure_mpa:.0} MPa, above {MOST_PRESSURE_MPA}")
    } else {
        return None;
    };
    Some(format!(
        "{implausible}: load.pinion_torque_nm is in N·m, here {}",
        torque * 1e-3
    ))
}

/// Doubts about an implausible ΔSTE, and about a ΔSTE that is larger with new flanks than with worn ones.
fn of_transmission_error(loaded: &Loaded) -> Vec<String> {
    let new = loaded.delta_ste_um;
    let [least, most] = DELTA_STE_UM;
    let mut doubts = Vec::new();
    if !(least..=most).contains(&new) {
        doubts.push(format!(
            "ΔSTE is {} µm, outside {least} to {most} µm, between which those of gears lie: look at torque, module and modulus, \
             and at a finer tooth model",
            significant(new, 3)
        ));
    }
    if let Some(worn) = loaded.worn_um.filter(|worn| *worn < new) {
        doubts.push(format!(
            "ΔSTE is greater on new flanks: {} µm, and {} µm with the mean wear; compare designs with new flanks, too",
            significant(new, 3),
            significant(worn, 3)
        ));
    }
    doubts
}

#[cfg(test)]
mod tests {
    use problem::PairFile;

    use super::*;

    const PAIR: &str = r#"[pair]
teeth = [23, 37]
normal_module_mm = 2.0
pressure_angle_deg = 20.0
helix_angle_deg = 20.0
face_width_mm = 25.0
profile_shift = [0.2, 0.1]
tool_addendum = [1.25, 1.25]
tool_dedendum = [1.0, 1.0]
tip_radius_mm = [0.1, 0.1]
root_radius_mm = [0.6, 0.6]
tooth_model = "weber-banaschek"
[load]
pinion_torque_nm = 100.0
[material]
youngs_modulus_gpa = 206.0
poisson_ratio = 0.3
contact_limit_mpa = 1500.0
"#;

    const LOADED: Loaded = Loaded {
        delta_ste_um: 1.0,
        worn_um: Some(1.5),
        pressure_mpa: 900.0,
    };

    fn found(text: &str, loaded: &Loaded) -> Vec<String> {
        let file = PairFile::parse("p.toml", text).unwrap();
        let grid = gear::Discretisation::of(file.pair.tooth_model);
        let pair = Pair::with_corrections(&file.to_gear(), &file.corrections(), &grid).unwrap();
        of(&pair, loaded, file.allowances.as_ref())
    }

    #[test]
    fn each_doubt_names_what_is_strange_and_a_sound_pair_has_none() {
        assert_eq!(found(PAIR, &LOADED), [""; 0]);
        let with = |from: &str, to: &str| {
            assert!(PAIR.contains(from), "{from}");
            found(&PAIR.replace(from, to), &LOADED)
        };
        // ε_β = b sin β/(π m) is 1 at 18.371 mm.
        let thick = "100.0\n[allowances]\ntooth_thickness_um = { pinion = [60.0, 30.0], mate = [0.0, -10.0] }";
        let long =
            "100.0\n[corrections]\ntip_relief_um = [5.0, 5.0]\ntip_relief_length_mm = [5.0, 2.0]";
        let tips = "0.6]\ntip_diameter_mm = [60.0, 82.0]\ntooth_model";
        for (found, part) in [
            (
                with("0.6]\ntooth_model", tips),
                "pair.tip_diameter_mm of the pinion is 60, but its tooth becomes pointed at 55.969 mm",
            ),
            (with("mm = 25.0", "mm = 18.4"), "overlap ratio ε_β is 1.002"),
            (with("mm = 25.0", "mm = 3.0"), "b/m_n is 1.50"),
            (
                with("nm = 100.0", &format!("nm = {long}")),
                "tip relief of the pinion covers",
            ),
            (
                with("nm = 100.0", &format!("nm = {thick}")),
                "smallest normal backlash j_bn within [allowances] is −0.056",
            ),
            (
                found(
                    &PAIR
                        .replace("weber-banaschek", "coupled")
                        .replace("[0.2, 0.1]", "[0.2, -0.15]"),
                    &LOADED,
                ),
                "the profile shift of the mate is -0.15: the tooth model",
            ),
            (
                with("nm = 100.0", "nm = 2000.0"),
                "F_t/b is 3268 N/mm, above 3000",
            ),
        ] {
            assert_eq!(found.len(), 1, "{part}: {found:?}");
            assert!(found[0].contains(part), "{part}: {found:?}");
        }
        for (loaded, part) in [
            (
                Loaded {
                    pressure_mpa: 4e3,
                    ..LOADED
                },
                "contact pressure is 4000 MPa",
            ),
            (
                Loaded {
                    delta_ste_um: 300.0,
                    worn_um: None,
                    ..LOADED
                },
                "ΔSTE is 300 µm",
            ),
            (
                Loaded {
                    delta_ste_um: 1e-9,
                    ..LOADED
                },
                "outside 0.001 to 100 µm",
            ),
            (
                Loaded {
                    delta_ste_um: 2.0,
                    ..LOADED
                },
                "ΔSTE is greater on new flanks: 2.00 µm, and 1.50 µm",
            ),
        ] {
            let found = found(PAIR, &loaded);
            assert_eq!(found.len(), 1, "{part}: {found:?}");
            assert!(found[0].contains(part), "{part}: {found:?}");
        }
    }

    /// The paper's start of an optimisation, at fifty times its torque.
    #[test]
    fn a_design_of_a_campaign_has_the_doubts_of_its_pair() {
        let design = Design::new(gear::paper::printed::PRINTED[1].variables.to_vec());
        let of_torque = |factor: f64| {
            let mut campaign =
                problem::Campaign::parse("c.toml", problem::Campaign::PAPER).unwrap();
            let problem::file::Kind::Gears(sections) = &mut campaign.kind else {
                panic!("the paper's campaign is of gears");
            };
            sections.load.pinion_torque_nm *= factor;
            of_design(&Problem::new(campaign), &design)
        };
        let has_torque =
            |doubts: &[String]| doubts.iter().any(|one| one.contains("pinion_torque_nm"));
        assert!(!has_torque(&of_torque(1.0)));
        assert!(has_torque(&of_torque(50.0)));
    }

    #[test]
    fn a_campaign_with_a_case_of_new_flanks_is_not_advised_to_compare_them() {
        // The optimum with the mean wear of the paper's campaign: 4.16 µm new, 1.08 µm worn.
        let design = Design::new(vec![
            0.328, 1.338, 1.7, 1.555, 1.306, 0.8, 0.0003, 0.19, 0.64, 0.23, 30.0,
        ]);
        let is_advised = |wear: f64| {
            let mut campaign =
                problem::Campaign::parse("c.toml", problem::Campaign::PAPER).unwrap();
            campaign.gears_mut().unwrap().load.cases = vec![problem::file::LoadCase {
                wear,
                ..problem::file::LoadCase::default()
            }];
            let doubts = of_design(&Problem::new(campaign), &design);
            doubts
                .iter()
                .any(|doubt| doubt.starts_with("ΔSTE is greater on new flanks"))
        };
        assert!(is_advised(1.0) && !is_advised(0.0));
    }
}
