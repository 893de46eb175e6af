//! Problems stated in the campaign file.

use problem::formulation::{Approach, Criteria, Problem};
use problem::{Campaign, Design};

const FILE: &str = include_str!("../../../../campaigns/ishigami/campaign.toml");

fn parse(text: &str) -> Result<Campaign, String> {
    Campaign::parse("c.toml", text).map_err(|error| error.to_string())
}

fn with(from: &str, to: &str) -> Result<Campaign, String> {
    assert!(FILE.contains(from), "{from}");
    parse(&FILE.replacen(from, to, 1))
}

const STRESS: &str =
    "[[constraints]]\nname = \"stress\"\nunit = \"MPa\"\nmin = 0.0\nmax = 200.0\n\n[[responses]]";

#[test]
fn the_shipped_example_is_a_problem_without_gears() {
    let campaign = parse(FILE).unwrap();
    assert!(campaign.is_external() && campaign.gears().is_none());
    assert_eq!(Campaign::from_json(&campaign.to_json()).unwrap(), campaign);
    let problem = Problem::new(campaign);
    assert_eq!(problem.free_names().collect::<Vec<_>>(), ["x1", "x2", "x3"]);
    assert_eq!(problem.sampled()[0].name, "y");
    let approaches: Vec<Approach> = problem.approaches().collect();
    assert_eq!(
        approaches,
        [Approach::Baseline, Approach::Kriging, Approach::BestOfDoe]
    );
    assert_eq!(problem.approach_name(Approach::Baseline), "baseline");
    let none = Problem::new(with("baseline = true", "baseline = false").unwrap());
    assert_eq!(none.approaches().count(), 2);
}

#[test]
fn as_many_variables_are_accepted_as_a_design_of_experiments_has() {
    let of = |count: usize| {
        let more = (4..=count)
            .map(|i| format!("[[variables]]\nname = \"x{i}\"\nlow = 0.0\nhigh = 1.0\n\n"));
        let more: String = more.collect();
        with("[[responses]]", &format!("{more}[[responses]]"))
    };
    assert_eq!(of(20).unwrap().name, "ishigami");
    let error = of(21).unwrap_err();
    assert!(
        error.contains("variables is 21, but must be 1 to 20"),
        "{error}"
    );
}

#[test]
fn limits_of_either_side_are_constraints_and_their_values_the_criteria() {
    let problem = Problem::new(with("[[responses]]", STRESS).unwrap());
    let broken = problem.constraints(&Criteria::new(vec![250.0]));
    assert_eq!(broken.len(), 2);
    assert!(broken[0].holds() && !broken[1].holds());
    // The violation is relative to the limit, or to 1 if the limit is 0.
    assert_eq!(problem.violation(&Criteria::new(vec![250.0])), 0.25);
    assert_eq!(problem.violation(&Criteria::new(vec![-3.0])), 3.0);
    assert!(problem.is_feasible(&Criteria::new(vec![200.0])));
    let design = Design::new(vec![0.0; 3]);
    let told = problem.told(&design).unwrap();
    assert_eq!(told[0], ("x1", 0.0));
    assert!(problem.check_responses(&[1.0, f64::NAN]).is_err());
}

#[test]
fn a_response_to_be_maximised_keeps_its_name_and_sign_and_its_level_counts_from_above() {
    let campaign = with("aim = \"minimise\"", "aim = \"maximise\"").unwrap();
    let problem = Problem::new(campaign.clone());
    assert_eq!(problem.sampled()[0].name, "y");
    assert_eq!(problem.cost(2.0), -2.0);
    let sampling = &problem.campaign().sampling;
    assert_eq!(
        (sampling.objective.level(), &*problem.measured().name),
        (Some(0.1), "P10")
    );
    // Workers and the store read the campaign back from JSON.
    let read = problem::Campaign::from_json(&campaign.to_json()).unwrap();
    assert_eq!(read, campaign);
    let samples: Vec<f64> = (0..101).map(f64::from).collect();
    let verified = read.sampling.verified(&samples).unwrap();
    assert!((verified.value - 10.0).abs() < 1.0, "{verified:?}");
    let estimate = read.sampling.estimate(&samples).unwrap().chosen.value;
    assert!(estimate < 20.0, "{estimate}");
}

#[test]
fn what_is_wrong_is_named_with_its_line() {
    let line_of = |part: &str| 1 + FILE.lines().position(|line| line == part).unwrap();
    let second = FILE.replacen("name = \"x2\"\nlow = -3.1", "name = \"x2\"\nlow = 4.1", 1);
    let error = parse(&second).unwrap_err();
    let high = format!("line {}: variables[2].high", line_of("name = \"x2\"") + 2);
    assert!(error.contains(&high), "{error}");
    for (from, to, part) in [
        (
            "kind = \"external\"",
            "kind = \"magic\"",
            "\"gear\" or \"external\"",
        ),
        ("name = \"x2\"", "name = \"x1\"", "no other variable"),
        ("name = \"y\"", "name = \"id\"", "another name"),
        ("name = \"x1\"", "name = \"x 1\"", "variables[1].name"),
        (
            "aim = \"minimise\"",
            "aim = \"least\"",
            "objective.aim is \"least\"",
        ),
        ("designs = 150", "designs = 1", "doe.designs is 1"),
        ("[doe]", "[pair]\nteeth = 3\n[doe]", "pair"),
        (
            "[[responses]]",
            "[[constraints]]\nname = \"s\"\n[[responses]]",
            "constraints[1].max is missing",
        ),
        (
            "[[responses]]",
            "[[constraints]]\nname = \"s\"\nmin = 2.0\nmax = 1.0\n[[responses]]",
            "a number above min, which is 2.0",
        ),
    ] {
        let error = with(from, to).unwrap_err();
        assert!(
            error.contains(part) && error.contains("c.toml, line "),
            "{error}"
        );
    }
}

#[test]
fn a_value_beyond_the_limits_of_the_response_is_none() {
    let limited = |lines: &str| {
        with(
            "[[responses]]\n",
            &format!("[[responses]]\n{lines}\nunit = \"mm\"\n"),
        )
    };
    let campaign = limited("min = -50.0\nmax = 100.0").unwrap();
    assert_eq!(Campaign::from_json(&campaign.to_json()).unwrap(), campaign);
    let problem = Problem::new(campaign.clone());
    for plausible in [-50.0, 0.0, 100.0] {
        problem.check_sample(&[plausible]).unwrap();
    }
    for (value, says) in [
        (
            1e50,
            "is 1e50 mm, above the largest plausible value 100.0 mm (max of the response)",
        ),
        (
            -50.5,
            "is -50.5 mm, below the smallest plausible value -50.0 mm (min of the response)",
        ),
        (1e160, "is 1e160, but numbers beyond ±1e100"),
        (f64::NAN, "is NaN, which is not a number"),
    ] {
        assert!(
            problem
                .check_sample(&[value])
                .unwrap_err()
                .1
                .starts_with(says)
        );
        // The response without random effects has the same limits.
        let error = problem.check_responses(&[value]).unwrap_err();
        assert!(error.starts_with(&format!("y {says}")), "{error}");
    }
    // A failed sample is infinite.
    problem.check_sample(&[f64::INFINITY]).unwrap();

    // Other limits change no number, so that the store keeps its samples.
    let free = limited("").unwrap();
    assert_eq!(free.values_digest(), campaign.values_digest());
    assert!(free.extends(&campaign) && campaign.extends(&free));
    assert_ne!(free.digest(), campaign.digest());

    for (lines, says) in [
        (
            "max = inf",
            "responses[1].max is inf, but must be a finite number",
        ),
        (
            "min = 2.0\nmax = 1.0",
            "responses[1].max is 1.0, but must be a number above min, which is 2.0",
        ),
    ] {
        let error = limited(lines).unwrap_err();
        assert!(error.contains(says), "{error}");
    }
}
