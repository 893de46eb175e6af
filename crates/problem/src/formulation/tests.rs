use super::*;
use crate::simulator::Simulator as _;

fn problem() -> Problem {
    Problem::new(Campaign::parse("paper.toml", Campaign::PAPER).unwrap())
}

fn of(criteria: GearCriteria) -> Criteria {
    criteria.into()
}

fn good() -> GearCriteria {
    GearCriteria {
        contact_ratio: 1.5,
        specific_sliding: 1.5,
        hertz_pressure_mpa: 1200.0,
        root_stress_mpa: 600.0,
        clearance_mm: [0.5, 0.0],
        flank_margin_mm: [0.1, 0.1],
        normal_module_mm: 4.0,
        details: None,
    }
}

#[test]
fn the_violation_is_the_bracket_of_equation_5_plus_interference_in_modules() {
    let problem = problem();
    assert_eq!(problem.violation(&of(good())), 0.0);
    let bad = GearCriteria {
        contact_ratio: 1.0,
        specific_sliding: 3.0,
        root_stress_mpa: 1078.0,
        hertz_pressure_mpa: 3100.0,
        clearance_mm: [-1.0, 0.5],
        ..good()
    };
    // (1 − 1/1.25) + (3/2 − 1) + (1078/980 − 1) + (3100/1550 − 1) + 1/4
    let expected = 0.2 + 0.5 + 0.1 + 1.0 + 0.25;
    assert!((problem.violation(&of(bad)) - expected).abs() < 1e-12);
    assert!(
        (problem.penalty().unwrap().objective(2.0, 0.3) - (2.0 / 0.5 + 10.0 * 0.3)).abs() < 1e-12
    );
}

#[test]
fn limits_themselves_are_not_allowed_but_touching_teeth_are() {
    let problem = problem();
    assert!(problem.is_feasible(&of(good())));
    assert!(!problem.is_feasible(&of(GearCriteria {
        specific_sliding: 2.0,
        ..good()
    })));
    assert!(!problem.is_feasible(&of(GearCriteria {
        contact_ratio: 1.25,
        ..good()
    })));
    assert!(!problem.is_feasible(&of(GearCriteria {
        root_stress_mpa: f64::NAN,
        ..good()
    })));
    assert!(!problem.is_feasible(&of(GearCriteria {
        flank_margin_mm: [0.1, -1e-12],
        ..good()
    })));
}

#[test]
fn the_unit_cube_covers_the_bounds_and_radii_follow_the_module() {
    let problem = problem();
    assert_eq!(
        problem.free_point(&[0.0; 6]),
        [-1.0, -1.0, 0.8, 0.8, 0.8, 0.8]
    );
    assert_eq!(
        problem.free_point(&[1.0; 6]),
        [2.0, 2.0, 1.7, 1.7, 1.7, 1.7]
    );
    let unit = [0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.0, 1.0, 0.0, 1.0, 1.0];
    let design = problem
        .point(Approach::Nominal, &unit, problem.base())
        .unwrap();
    let variables = design.gears();
    let module = problem.gears().unwrap().pair(&design).map_or_else(
        |_| variables.tip_radius_mm[1],
        |pair| pair.geometry().normal_module,
    );
    assert!((variables.tip_radius_mm[1] / module - 1.0).abs() < 1e-12);
    assert!((variables.root_radius_mm[0] / module - 0.05).abs() < 1e-12);
    assert_eq!(variables.helix_angle_deg, 30.0);
}

/// The paper's campaign with these lines in `[bounds]` and `[frozen]`, and with this size in
/// `[pair]`.
fn bounded(size: &str, bounds: &str, constraints: &str) -> Result<Problem, String> {
    let (head, rest) = Campaign::WEAR.split_once("[bounds]").unwrap();
    let (_, rest) = rest.split_once("[doe]").unwrap();
    let text = format!("{head}[bounds]\n{bounds}\n[doe]{rest}");
    let text = text.replacen("centre_distance_mm = 110.0", size, 1);
    let text = text.replacen(
        "[constraints]\n",
        &format!("[constraints]\n{constraints}\n"),
        1,
    );
    let campaign = Campaign::parse("c.toml", &text).map_err(|error| error.to_string())?;
    let again = Campaign::from_json(&campaign.to_json()).unwrap();
    assert_eq!(again, campaign);
    Ok(Problem::new(campaign))
}

const HOB: &str = "rack = \"iso-53-a\"\ntip_radius_modules = 0.02\nhelix_angle_deg = 15.0\n";

#[test]
fn a_kept_hob_a_module_and_a_centre_distance_leave_one_profile_shift() {
    let bounds = format!("{HOB}profile_shift = {{ pinion = [0.0, 0.5], mate = \"follows\" }}");
    let sizes = "normal_module_mm = 5.0\ncentre_distance_mm = 110.0";
    let problem = bounded(sizes, &bounds, "").unwrap();
    assert_eq!(problem.free_names().collect::<Vec<_>>(), ["x_p"]);
    assert_eq!(problem.dimension_of(Approach::Nominal), 1);
    assert_eq!(problem.base_from(), None);
    for x in [0.0, 0.1, 0.5] {
        let design = problem.design(&[x], problem.base());
        assert_eq!(problem.free_values(&design), [x]);
        let variables = design.gears();
        assert_eq!(
            (variables.tool_addendum, variables.tool_dedendum),
            ([1.25; 2], [1.0; 2])
        );
        assert_eq!(variables.root_radius_mm, [0.38 * 5.0; 2]);
        assert_eq!(variables.tip_radius_mm, [0.02 * 5.0; 2]);
        let pair = problem.gears().unwrap().pair(&design).unwrap();
        let geometry = pair.geometry();
        assert!(
            (geometry.centre_distance - 110.0).abs() < 1e-9,
            "{}",
            geometry.centre_distance
        );
        assert_eq!(geometry.normal_module, 5.0);
    }
    // The base circles overlap: no sum of profile shifts gives this centre distance.
    let problem = bounded(
        "normal_module_mm = 5.0\ncentre_distance_mm = 90.0",
        &bounds,
        "",
    )
    .unwrap();
    let design = problem.design(&[0.1], problem.base());
    let refused = problem.gears().unwrap().pair(&design).unwrap_err();
    assert!(
        refused
            .to_string()
            .contains("the involute equation has no solution"),
        "{refused}"
    );
}

#[test]
fn each_gear_has_bounds_of_its_own_and_a_mate_may_be_tied() {
    let bounds = "profile_shift = { pinion = [0.1, 0.4], mate = -0.2 }\n\
                  tool_addendum = { pinion = [1.0, 1.4], mate = \"tied\" }\n\
                  tool_dedendum = 1.0\n\
                  tip_radius_modules = { pinion = [0.0, 0.1], mate = \"tied\" }\n\
                  root_radius_modules = { pinion = 0.25, mate = [0.1, 0.3] }\n\
                  helix_angle_deg = [10.0, 20.0]\n";
    let problem = bounded("centre_distance_mm = 110.0", bounds, "").unwrap();
    let names: Vec<&str> = problem.free_names().collect();
    let expected = [
        "x_p",
        "ha0_p",
        "rho_a_p_modules",
        "rho_f_r_modules",
        "beta_deg",
    ];
    assert_eq!(names, expected);
    let x = problem.free_point(&[0.5; 5]);
    assert_eq!(x, [0.25, 1.2, 0.05, 0.2, 15.0]);
    let design = problem.design(&x, problem.base());
    let variables = design.gears();
    let module = problem.gears().unwrap().normal_module(&design).unwrap();
    assert_eq!(variables.profile_shift, [0.25, -0.2]);
    assert_eq!(variables.tool_addendum, [1.2; 2]);
    assert_eq!(variables.tip_radius_mm, [0.05 * module; 2]);
    assert_eq!(variables.root_radius_mm, [0.25 * module, 0.2 * module]);
    let back = problem.free_values(&design);
    let near = back.iter().zip(&x).all(|(a, b)| (a - b).abs() < 1e-14);
    assert!(near, "{back:?}");
    // The DoE does not vary frozen variables, but the optimisation without wear does.
    let frozen = format!("{bounds}[frozen]\nfrom = \"deterministic\"\nhelix_angle_deg = 18.0");
    let problem = bounded("centre_distance_mm = 110.0", &frozen, "").unwrap();
    assert_eq!(
        (problem.dimension(), problem.dimension_of(Approach::Nominal)),
        (4, 5)
    );
    assert_eq!(problem.base_from(), Some(Approach::Nominal));
    let design = problem.design(&x[..4], problem.base());
    assert_eq!(design.gears().helix_angle_deg, 18.0);
}

#[test]
fn what_bounds_cannot_be_is_refused_with_its_key() {
    let free = "profile_shift = [0.0, 0.5]";
    let both = "normal_module_mm = 5.0\ncentre_distance_mm = 110.0";
    let one = "centre_distance_mm = 110.0";
    let rackless = "tip_radius_modules = 0.0\nhelix_angle_deg = 0.0\ntool_dedendum = 1.0\n";
    for (size, bounds, says) in [
        (
            both,
            format!("{HOB}{free}"),
            "bounds.profile_shift is [0.0, 0.5], but must be { pinion = …, mate = \"follows\" }",
        ),
        (
            one,
            format!("{HOB}profile_shift = {{ pinion = 0.1, mate = \"follows\" }}"),
            "pair.normal_module_mm is missing, but must be given where the mate of bounds.profile_shift \"follows\"",
        ),
        (
            one,
            format!("{HOB}profile_shift = \"tied\""),
            "bounds.profile_shift is \"tied\", but must be [low, high] or a number",
        ),
        (
            one,
            format!("{HOB}profile_shift = [0.5, 0.0]"),
            "bounds.profile_shift is [0.5, 0.0]",
        ),
        (
            one,
            format!("{HOB}profile_shift = [0.5]"),
            "profile_shift: expected [low, high], [low, high, step], a number, or { pinion",
        ),
        (
            one,
            format!("{HOB}profile_shift = 0.2"),
            "at least one variable with [low, high]",
        ),
        (
            one,
            format!("{HOB}{free}\ntool_addendum = 1.2"),
            "bounds.tool_addendum is 1.2, but must be absent beside bounds.rack",
        ),
        (
            one,
            format!("{HOB}{free}").replace("53-a", "53-e"),
            "iso-53-d",
        ),
        (
            one,
            format!("{rackless}{free}"),
            "bounds.tool_addendum is missing",
        ),
        (
            one,
            format!("{HOB}{free}\n[frozen]\nfrom = \"printed\"\nhelix_angle_deg = 1.0"),
            "frozen.helix_angle_deg is 1.0, but must be absent",
        ),
        (
            one,
            format!("{HOB}profile_shift = {{ pinion = \"tied\", mate = 0.1 }}"),
            "only the mate",
        ),
        (
            one,
            format!("{HOB}profile_shift = {{ pinion = [0.0, 0.1], mate = 11.0 }}"),
            "profile_shift is 11.0",
        ),
    ] {
        let error = bounded(size, &bounds, "").map(|_| ()).unwrap_err();
        assert!(
            error.starts_with("c.toml, line ") && error.contains(says),
            "{says}: {error}"
        );
    }
}

#[test]
fn a_limit_on_the_tip_land_is_a_constraint_of_campaign_and_store() {
    let bounds = format!("{HOB}profile_shift = [-0.2, 0.9]");
    let limits =
        "tip_clearance_min_modules = 0.15\ntip_land_min_modules = 0.4\nflank_safety_min = 0.1";
    let limited = bounded("normal_module_mm = 5.0", &bounds, limits).unwrap();
    let plain = bounded("normal_module_mm = 5.0", &bounds, "").unwrap();
    assert_eq!(plain.criteria().len() + 9, limited.criteria().len());
    assert_eq!(plain.responses().len() + 9, limited.responses().len());
    let design = limited.design(&[0.9, 0.0], limited.base());
    let analyses = [State::Nominal, State::Baseline].map(|state| {
        use crate::simulator::Simulator as _;
        limited.prepare(&design).unwrap().analyse(state).unwrap()
    });
    let criteria = &analyses[0].criteria;
    assert_eq!(criteria.values().len(), limited.criteria().len());
    let details = criteria.gears().details.unwrap();
    let land = details.tip_land_mm[0] / 5.0;
    assert!(land > 0.2 && land < 0.4, "{land}");
    let broken: Vec<String> = limited
        .constraints(criteria)
        .iter()
        .filter(|constraint| !constraint.holds())
        .map(ToString::to_string)
        .collect();
    let says = "pinion tip land = ";
    assert!(
        broken
            .iter()
            .any(|b| b.starts_with(says) && b.ends_with("limit of 2 mm")),
        "{broken:?}"
    );
    // The responses include the details, so that constraints can be evaluated again without the
    // simulator.
    let responses = limited.responses_of(&analyses[0], &analyses[1]);
    assert_eq!(responses.len(), limited.responses().len());
    limited.check_responses(&responses).unwrap();
    for (state, analysis) in [State::Nominal, State::Baseline].into_iter().zip(&analyses) {
        let again = limited.analysis(&design, &responses, state).unwrap();
        assert_eq!(&again, analysis);
    }
}

/// The problem of the paper's campaign with this `[corrections]`, with a tooth model that knows the face.
fn corrected(section: &str) -> Problem {
    let text = Campaign::PAPER.replacen("\"whole-face-beam\"", "\"hertz-beam\"", 1);
    let text = format!("{text}\n[corrections]\n{section}");
    Problem::new(Campaign::parse("c.toml", &text).unwrap())
}

#[test]
fn corrections_are_variables_that_are_free_fixed_or_tied() {
    let free = "tip_relief_um = [0.0, 20.0]\ntip_relief_length_mm = [0.5, 2.5]\n\
                tip_relief_shape = \"parabolic\"\ncrowning_um = [0.0, 8.0]\nhelix_slope_um = [-4.0, 4.0]";
    let all = corrected(free);
    assert_eq!(all.dimension(), 12);
    let corner = [&[0.5; 6][..], &[0.5, 1.0, 0.0, 1.0, 0.25, 0.75]].concat();
    let design = all.design(&all.free_point(&corner), all.base());
    let corrections = all.gears().unwrap().corrections(&design);
    let [pinion, mate] = corrections.tip_relief.map(|relief| relief.unwrap());
    assert!((pinion.amount - 0.010).abs() < 1e-15 && pinion.length == 0.5);
    assert!((mate.amount - 0.020).abs() < 1e-15 && mate.length == 2.5);
    assert_eq!(mate.shape, gear::ReliefShape::Parabolic);
    assert!((corrections.crowning - 0.002).abs() < 1e-15);
    assert!((corrections.helix_slope - 0.002).abs() < 1e-15);

    // The mate's relief is the pinion's, and a correction without a key is zero.
    let tied = corrected(
        "tip_relief_um = { pinion = [0.0, 20.0], mate = \"tied\" }\ntip_relief_length_mm = 1.5",
    );
    assert_eq!(tied.dimension(), 7);
    let design = tied.design(&tied.free_point(&corner[..7]), tied.base());
    let corrections = tied.gears().unwrap().corrections(&design);
    assert_eq!(corrections.tip_relief[0], corrections.tip_relief[1]);
    assert_eq!(corrections.tip_relief[1].unwrap().length, 1.5);
    assert_eq!(corrections.crowning, 0.0);
    // A pair file holds the corrections.
    let sections = tied.campaign().gears().unwrap();
    let file = crate::PairFile::of_design(sections, &design);
    assert_eq!(file.corrections(), corrections);

    // An amount of zero is no relief, and the analysis knows the corrections.
    let value = |amount: f64| {
        let unit = [0.3, 0.4, 0.5, 0.5, 0.5, 0.5, amount];
        let design = tied.design(&tied.free_point(&unit), tied.base());
        tied.prepare(&design)
            .unwrap()
            .analyse(State::Baseline)
            .unwrap()
    };
    let none = corrected("crowning_um = 0.0");
    let unit = [0.3, 0.4, 0.5, 0.5, 0.5, 0.5];
    let design = none.design(&none.free_point(&unit), none.base());
    let plain = none
        .prepare(&design)
        .unwrap()
        .analyse(State::Baseline)
        .unwrap();
    assert_eq!(value(0.0).value, plain.value);
    assert_ne!(value(0.5).value, plain.value);
}

#[test]
fn reliefs_longer_than_the_path_of_contact_are_no_feasible_design() {
    let problem = corrected("tip_relief_um = 5.0\ntip_relief_length_mm = [0.5, 20.0]");
    let of = |unit: f64| {
        let x = problem.free_point(&[0.3, 0.4, 0.5, 0.5, 0.5, 0.5, unit, unit]);
        let design = problem.design(&x, problem.base());
        let analysis = problem.prepare(&design).unwrap().analyse(State::Baseline);
        let constraints = problem.constraints(&analysis.unwrap().criteria);
        let found = constraints
            .into_iter()
            .find(|one| one.name == "pure involute");
        found.expect("campaigns with relief limit it")
    };
    assert!(of(0.0).holds());
    let long = of(1.0);
    assert!(!long.holds() && long.value < 0.0 && long.limit == 0.0);
}

/// [`HOB`]'s campaign with three cases: the whole wear, new flanks, and a quarter of the torque.
fn with_cases(more: [&str; 3]) -> Result<Problem, String> {
    let cases: String = ["", "wear = 0.0", "name = \"idle\"\npinion_torque_nm = 50.0"]
        .iter()
        .zip(more)
        .map(|(case, more)| format!("[[load.cases]]\n{case}\n{more}\n"))
        .collect();
    let text = Campaign::WEAR.replacen("[material]", &format!("{cases}[material]"), 1);
    let campaign = Campaign::parse("c.toml", &text).map_err(|error| error.to_string())?;
    Ok(Problem::new(campaign))
}

#[test]
fn a_sample_is_the_transmission_error_in_every_case() {
    use crate::simulator::Simulator as _;
    let plain = Problem::new(Campaign::parse("c.toml", Campaign::WEAR).unwrap());
    let problem = with_cases([""; 3]).unwrap();
    let names: Vec<&str> = problem.sampled().iter().map(|one| &*one.name).collect();
    let expected = [
        "delta_ste_case_1_um",
        "delta_ste_case_2_um",
        "delta_ste_idle_um",
    ];
    assert_eq!(names, expected);
    let unit = [0.3, 0.4, 0.5, 0.5, 0.5, 0.5];
    let design = problem.design(&problem.free_point(&unit), problem.base());
    let mut prepared = problem.prepare(&design).unwrap();
    let none = vec![0.0; prepared.modes()];
    let sample = prepared.sample_at(&none).unwrap();
    // Without cases the sample is that of the first case.
    let mut alone = plain.prepare(&design).unwrap();
    assert_eq!(alone.sample_at(&none).unwrap(), sample[..1]);
    let [unworn, worn] = [State::Nominal, State::Baseline].map(|state| {
        [&mut alone, &mut prepared].map(|design| design.analyse(state).unwrap().value)
    });
    assert!((sample[1] - unworn[0]).abs() < 1e-9);
    // The greatest counts, in the baseline and in every sample.
    let greatest = sample.iter().copied().fold(0.0, f64::max);
    assert!((worn[1] - greatest).abs() < 1e-9);
    assert!(unworn[1] >= unworn[0]);
    let mut samples = stats::Samples::none(3);
    samples.push(&sample);
    assert_eq!(problem.objective().values(&samples), [greatest]);
    // The same random numbers give the same first case.
    let key = || stats::streams::stream(1, stats::streams::Purpose::Wear, 2, 3);
    let drawn = [&mut alone, &mut prepared].map(|design| design.sample(&mut key()).unwrap()[0]);
    assert_eq!(drawn[0], drawn[1]);

    let weighted = with_cases(["weight = 1", "weight = 2", "weight = 5"]).unwrap();
    let mean = (sample[0] + 2.0 * sample[1] + 5.0 * sample[2]) / 8.0;
    assert!((weighted.objective().values(&samples)[0] - mean).abs() < 1e-12);
    let value = weighted.prepare(&design).unwrap().analyse(State::Baseline);
    assert!((value.unwrap().value - mean).abs() < 1e-9);
}

#[test]
fn limits_of_cases_are_measures_with_a_limit() {
    use crate::simulator::Simulator as _;
    let problem = with_cases(["", "delta_ste_max_um = 3.5", ""]).unwrap();
    let [limited] = problem.limited() else {
        panic!("one case is limited")
    };
    assert_eq!(limited.limit(), Some(3.5));
    assert_eq!(&*limited.response.name, "delta_ste_case_2_um");
    let design = problem.design(&problem.free_point(&[0.5; 6]), problem.base());
    let analysis = problem.prepare(&design).unwrap().analyse(State::Baseline);
    let criteria = analysis.unwrap().criteria;
    assert_eq!(criteria.values().len(), problem.deterministic().len());
    let without = problem.constraints(&criteria);
    let constraints = problem.constraints(&problem.with_limited(&criteria, &[4.0]));
    assert_eq!(constraints.len(), without.len() + 1);
    assert!(!constraints.last().unwrap().holds());
    // The details are read in spite of the bounds behind them.
    let again = problem.with_limited(&criteria, &[4.0]).gears();
    assert_eq!(again, criteria.gears());
}

#[test]
fn invalid_cases_are_refused_by_key() {
    for (more, why) in [
        (["weight = 1", "", ""], "load.cases[2].weight is missing"),
        (["", "weight = 1", ""], "load.cases[1].weight is missing"),
        (["wear = -1", "", ""], "load.cases[1].wear"),
        (["name = \"a b\"", "", ""], "load.cases[1].name"),
        (["name = \"idle\"", "", ""], "load.cases[3].name"),
        (
            ["", "delta_ste_max_um = 0", ""],
            "load.cases[2].delta_ste_max_um",
        ),
    ] {
        let error = with_cases(more).unwrap_err();
        assert!(error.contains(why), "{more:?}: {error}");
    }
}

#[test]
fn a_variable_that_is_free_in_steps_takes_only_values_that_can_be_made() {
    let problem = corrected(
        "tip_relief_um = { pinion = [0.0, 20.0, 1.0], mate = \"tied\" }\n\
         tip_relief_length_mm = [0.5, 2.5, 0.1]",
    );
    let values = &problem.coordinates()[6].values;
    assert_eq!((values.len(), values[3]), (21, 3.0));
    let values = &problem.coordinates()[7].values;
    assert_eq!((values.len(), values[7], values[20]), (21, 1.2, 2.5));
    for place in [0.0, 0.123, 0.77, 1.0] {
        let unit = [&[0.3; 6][..], &[place; 3]].concat();
        let design = problem.design(&problem.free_point(&unit), problem.base());
        let corrections = problem.gears().unwrap().corrections(&design);
        let Some(relief) = corrections.tip_relief[0] else {
            assert_eq!(place, 0.0);
            continue;
        };
        let um = 1e3 * relief.amount;
        assert!((um - um.round()).abs() < 1e-9, "{um}");
        assert!((10.0 * relief.length - (10.0 * relief.length).round()).abs() < 1e-9);
    }
    for bad in ["[0.0, 20.0, 0.0]", "[0.0, 20.0, 30.0]", "[0.0, 20.0, 0.01]"] {
        let section = format!("tip_relief_um = {bad}\ntip_relief_length_mm = 1.0");
        let text = format!("{}\n[corrections]\n{section}", Campaign::WEAR);
        let error = Campaign::parse("c.toml", &text).unwrap_err().to_string();
        assert!(error.contains("corrections.tip_relief_um"), "{error}");
    }
}
