use problem::{Approach, Campaign};

use super::*;
use crate::samples;

const TOLERANCES: Tolerances = Tolerances {
    modules: 0.01,
    radius_mm: 0.02,
    helix_angle_deg: 0.02,
    tip_relief_um: 2.0,
    relief_length_mm: 0.2,
    crowning_um: 2.0,
    helix_slope_um: 4.0,
    scenario: 0.2,
    torque: 0.1,
};

/// The optimum of Figure 9 with the campaign's own random numbers.
fn figure_9() -> (Problem, FeasibleOptimum) {
    let mut campaign = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
    campaign.sampling.samples_per_design = 10;
    campaign.verify.samples = Some(200);
    let problem = Problem::new(campaign);
    let design = stages::references::design(gear::paper::printed::Place::Figure(9));
    let optimum = FeasibleOptimum {
        approach: Approach::Baseline,
        design: design.clone(),
        verified: samples::verification(&problem, &design).unwrap(),
    };
    (problem, optimum)
}

#[test]
fn the_scenario_as_designed_is_the_verification_and_more_wear_is_worse() {
    let (problem, optimum) = figure_9();
    let rows = scenarios(&problem, &optimum).unwrap();
    assert_eq!(rows.len(), 7);
    assert_eq!(
        rows[0].p90,
        problem
            .campaign()
            .sampling
            .verified(&optimum.verified)
            .unwrap()
    );
    let of = |parameter: &str, factor: f64| {
        let row = rows
            .iter()
            .find(|row| row.parameter == parameter && row.factor == factor);
        row.unwrap().p90.value
    };
    let nominal = rows[0].p90.value;
    // Half the depth may be worse, too, for a design that was optimised for the whole.
    assert!(nominal < of("wear depth", 2.0));
    // A wider scatter of the same mean moves the percentile up.
    assert!(of("wear variance", 0.5) < nominal && nominal < of("wear variance", 2.0));
}

#[test]
fn indices_are_reproducible_and_shares_of_one() {
    let (problem, optimum) = figure_9();
    let indices = |tolerances| indices(&problem, &optimum, tolerances, 128);
    let found = indices(&TOLERANCES).unwrap();
    // The number of threads does not matter.
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    assert_eq!(
        found,
        one.unwrap().install(|| indices(&TOLERANCES)).unwrap()
    );
    assert_eq!(
        found.iter().map(|one| one.inputs.len()).collect::<Vec<_>>(),
        [15, 16]
    );
    for one in &found {
        let sum: f64 = one.sensitivity.first.iter().map(|index| index.value).sum();
        // Estimates from 128 rows: a deviation beyond these limits is an error, not chance.
        assert!((0.6..1.3).contains(&sum), "{}: {sum}", one.output);
        assert_eq!(one.sensitivity.left_out, 0);
    }
    // The percentile is nearly proportional to the depth, which varies by 20 %.
    let of_p90 = &found[0];
    let depth = of_p90
        .inputs
        .iter()
        .position(|input| input.name == "wear depth")
        .unwrap();
    assert!(of_p90.sensitivity.total[depth].value > 0.3);
    let none = Tolerances {
        modules: 0.0,
        radius_mm: 0.0,
        helix_angle_deg: 0.0,
        scenario: 0.0,
        torque: 0.0,
        ..TOLERANCES
    };
    let error = indices(&none).unwrap_err();
    assert!(
        format!("{error:#}").contains("does not depend"),
        "{error:#}"
    );
}

/// Slope deviations change the sampled response, and are named together with the field that they are drawn with.
#[test]
fn slope_deviations_are_part_of_the_random_input() {
    let (perfect, optimum) = figure_9();
    let mut campaign = perfect.campaign().clone();
    let flank_class = gear::FlankClass::new(9).unwrap();
    let manufacture = problem::file::Manufacture {
        flank_class: Some(flank_class),
        ..Default::default()
    };
    campaign.gears_mut().unwrap().manufacture = Some(manufacture);
    let problem = Problem::new(campaign);
    let rows = scenarios(&problem, &optimum).unwrap();
    let sampling = &problem.campaign().sampling;
    let as_designed = sampling.verified(&optimum.verified).unwrap();
    assert!(rows[0].p90.value > as_designed.value);
    let total = |problem: &Problem, name: &str| {
        let found = indices(problem, &optimum, &TOLERANCES, 64).unwrap();
        let of_one = &found[1];
        let total = of_one.sensitivity.total.last().unwrap().value;
        assert_eq!(of_one.inputs.last().unwrap().name, name);
        total * of_one.sensitivity.variance
    };
    let with = total(&problem, "wear field and manufacture");
    assert!(with > 1.2 * total(&perfect, "wear field"), "{with}");
}

/// The shipped pair: its mate's profile shift follows, its reliefs are free, and flanks, reliefs and load cases
/// scatter.
#[test]
fn every_free_variable_scatter_and_torque_is_an_input() {
    let mut campaign = Campaign::parse("pair.toml", &Campaign::pair_named("pair")).unwrap();
    let load = &mut campaign.gears_mut().unwrap().load;
    // All cases count in the mean.
    load.cases
        .iter_mut()
        .for_each(|case| case.weight = Some(1.0));
    let torque = load.pinion_torque_nm;
    let problem = Problem::new(campaign);
    let unit = vec![0.4; problem.dimension()];
    let design = problem.design(&problem.free_point(&unit), problem.base());
    let nominal = Nominal::new(&problem, design, &TOLERANCES).unwrap();
    let names: Vec<String> = nominal.inputs().into_iter().map(|one| one.name).collect();
    assert_eq!(
        names,
        [
            "x_p",
            "ha0_p",
            "ha0_r",
            "hf0_p",
            "hf0_r",
            "tip_relief_p_um",
            "tip_relief_r_um",
            "tip_relief_length_p_mm",
            "tip_relief_length_r_mm",
            "wear depth",
            "wear variance",
            "wear range",
            "profile slope tolerance f_HαT",
            "helix slope tolerance f_HβT",
            "tip relief tolerance",
            "torque",
        ]
    );
    let drawn = |point: &[f64]| {
        let cases = nominal.deviated(point).unwrap();
        let pair = cases.pair().clone();
        let samples = draw(&problem, &cases, COMMON, 0..4).unwrap();
        (pair, samples)
    };
    let middle = vec![0.5; names.len()];
    let (designed, samples) = drawn(&middle);
    for (place, name) in names.iter().enumerate() {
        let mut point = middle.clone();
        point[place] = 1.0;
        let (pair, moved) = drawn(&point);
        assert_ne!(moved, samples, "{name}");
        let [geometry, before] = [&pair, &designed].map(|pair| pair.geometry());
        assert!((geometry.centre_distance - before.centre_distance).abs() < 1e-9);
        let [shift, designed_shift] = [&pair, &designed].map(|pair| pair.input().profile_shift[1]);
        assert!(name != "x_p" || (shift - designed_shift + 0.01).abs() < 1e-9);
        let factor = pair.input().pinion_torque / (1e3 * torque);
        let expected = if name == "torque" { 1.1 } else { 1.0 };
        assert!((factor - expected).abs() < 1e-12, "{name}: {factor}");
    }
}
