//! Samples with several responses: their measures, and constraints on measures.

use problem::formulation::Problem;
use problem::{Campaign, Criteria};
use rand::RngExt as _;
use stats::streams::{Purpose, stream};
use stats::{Measure, Samples};

const FILE: &str = "kind = \"external\"\nformat = 1\nname = \"c\"\nseed = 1\n\
    [[variables]]\nname = \"x\"\nlow = 0.0\nhigh = 1.0\n\
    [[responses]]\nname = \"stress\"\nunit = \"MPa\"\n\
    [[responses]]\nname = \"other_stress\"\nunit = \"MPa\"\n\
    [[responses]]\nname = \"temperature\"\nunit = \"°C\"\nmax = 500.0\n\
    [doe]\ndesigns = 20\n[sampling]\nsamples_per_design = 30\n";

fn parse(more: &str) -> Result<Problem, String> {
    let text = format!("{FILE}{more}");
    let campaign = Campaign::parse("c.toml", &text).map_err(|error| error.to_string())?;
    assert_eq!(Campaign::from_json(&campaign.to_json()).unwrap(), campaign);
    Ok(Problem::new(campaign))
}

fn constraint(lines: &str) -> String {
    format!("[[constraints]]\nname = \"hot\"\n{lines}\n")
}

const HOT: &str = "response = \"temperature\"\nmeasure = \"exceedance\"\nlimit = 90.0\nmax = 0.01";

fn samples(rows: &[[f64; 3]]) -> Samples {
    Samples::new(3, rows.concat()).unwrap()
}

#[test]
fn an_objective_names_a_response_or_combines_several_in_each_sample() {
    let drawn = samples(&[[1.0, 3.0, 20.0], [5.0, 2.0, 30.0]]);
    for (response, name, unit, values) in [
        ("", "stress", "MPa", [1.0, 5.0]),
        (
            "response = \"temperature\"",
            "temperature",
            "°C",
            [20.0, 30.0],
        ),
        (
            "response = { greatest = [\"stress\", \"other_stress\"] }",
            "greatest of stress, other_stress",
            "MPa",
            [3.0, 5.0],
        ),
        (
            "response = { least = [\"stress\", \"other_stress\"] }",
            "least of stress, other_stress",
            "MPa",
            [1.0, 2.0],
        ),
        (
            "response = { sum = { stress = 0.5, temperature = 2.0 } }",
            "0.5 stress + 2 temperature",
            "",
            [40.5, 62.5],
        ),
    ] {
        let problem = parse(&format!("[objective]\n{response}\n")).unwrap();
        let objective = problem.objective();
        assert_eq!(objective.values(&drawn), values, "{response}");
        let of = (&*objective.response.name, &*objective.response.unit);
        assert_eq!(of, (name, unit));
        assert_eq!(objective.title(), format!("P90 of {name}"));
    }
    let failed = samples(&[[1.0, f64::INFINITY, 20.0]]);
    let of = |aim: &str| {
        let problem = parse(&format!("[objective]\naim = \"{aim}\"\n")).unwrap();
        problem.objective().values(&failed)
    };
    assert_eq!(of("minimise"), [f64::INFINITY]);
    assert_eq!(of("maximise"), [f64::NEG_INFINITY]);
}

#[test]
fn a_limited_probability_is_searched_as_the_percentile_that_says_the_same() {
    let problem = parse(&constraint(HOT)).unwrap();
    let [hot] = problem.limited() else {
        panic!("one constraint")
    };
    assert_eq!(hot.title(), "P(temperature > 90 °C)");
    assert_eq!((hot.limit(), hot.limit_unit()), (Some(0.01), ""));
    assert_eq!(
        hot.sampling().measure(),
        Measure::Percentile { level: 0.99 }
    );
    // A constraint on samples is judged by a bound that is 1.645 standard errors on the safe side.
    assert!((hot.bound(80.0, 4.0) - 83.29).abs() < 0.01);
    assert_eq!(hot.probability(90.0, 4.0), Some(0.5));
    let none = Criteria::new(Vec::new());
    for (value, is_feasible) in [(89.0, true), (91.0, false)] {
        let criteria = problem.with_limited(&none, &[value]);
        assert_eq!(problem.is_feasible(&criteria), is_feasible);
        let [found] = &problem.constraints(&criteria)[..] else {
            panic!("one constraint")
        };
        assert_eq!((&*found.name, found.limit), ("P99 of temperature", 90.0));
        let violation = problem.limited_violation(&[value]);
        assert_eq!(violation, problem.violation(&criteria));
    }
    // The simulator evaluates no criterion; those of samples come from the samples.
    assert_eq!(
        (problem.deterministic().len(), problem.criteria().len()),
        (0, 1)
    );

    // P(y > 5) ≥ 0.99 says that the 1st percentile is at least 5.
    let success = HOT.replace("max = 0.01", "min = 0.99");
    let problem = parse(&constraint(&success)).unwrap();
    let success = &problem.limited()[0];
    let measure = success.sampling().measure();
    assert!(matches!(measure, Measure::Percentile { level } if (level - 0.01).abs() < 1e-9));
    assert!(success.bound(95.0, 4.0) < 95.0);
    let failed = samples(&[[1.0, 1.0, f64::INFINITY]]);
    assert_eq!(
        success.values(&failed),
        [f64::NEG_INFINITY],
        "a failure is no success"
    );
}

#[test]
fn another_constraint_on_samples_keeps_the_samples() {
    let campaign = |more: &str| parse(more).unwrap().campaign().clone();
    let none = campaign("");
    let hot = campaign(&constraint(HOT));
    let cooler = campaign(&constraint(&HOT.replace("90.0", "80.0")));
    for (a, b) in [(&hot, &none), (&cooler, &hot), (&none, &hot)] {
        assert!(a.extends(b));
        assert_eq!(a.lineage(), b.lineage());
        assert_ne!(a.digest(), b.digest());
    }
    // A search on the samples themselves takes them where the constraints are kept.
    let direct = "[optimise]\ndirect = true\n";
    let of = |more: &str| campaign(&format!("{more}{direct}"));
    assert!(!of(&constraint(HOT)).extends(&of("")));
    // A constraint on a deterministic response is part of what the program computes.
    let exact = campaign(&constraint("max = 3.0"));
    assert!(!exact.extends(&none));
}

/// The confidence that a limit is kept is at least 95 % in no more than 5 % of the cases in which the measure lies just
/// beyond the limit.
#[test]
fn the_confidence_that_a_limit_is_kept_is_kept_itself() {
    let cases = 1500;
    for (lines, count, expected) in [
        (HOT.to_owned(), 800, 0.05),
        (
            "response = \"temperature\"\nmeasure = \"percentile\"\nlevel = 0.9\nmax = 81.8"
                .to_owned(),
            400,
            0.05,
        ),
        (
            "response = \"temperature\"\nmeasure = \"mean\"\nmin = 40.44999".to_owned(),
            200,
            0.05,
        ),
    ] {
        let problem = parse(&constraint(&lines)).unwrap();
        let hot = &problem.limited()[0];
        let mut shown = 0;
        for case in 0..cases {
            let mut rng = stream(3, Purpose::Test, case, 0);
            // Uniform up to 90.9: P(y > 90) is 0.0099, P90 81.81 and the mean 45.45.
            let mut rows = Samples::none(3);
            let scale = if lines.contains("mean") { 80.9 } else { 90.91 };
            for _ in 0..count {
                rows.push(&[0.0, 0.0, rng.random::<f64>() * scale]);
            }
            let confidence = hot.confidence(&rows).expect("enough samples");
            shown += u32::from(confidence >= 0.95);
        }
        let share = f64::from(shown) / cases as f64;
        // The standard error of the share is 0.6 %.
        assert!(share < expected + 0.02, "{lines}: {share}");
    }
    // Far from the limit the samples show it, and few samples show nothing.
    let problem = parse(&constraint(HOT)).unwrap();
    let hot = &problem.limited()[0];
    let cool = |count: usize| samples(&vec![[0.0, 0.0, 50.0]; count]);
    assert!(hot.confidence(&cool(299)).unwrap() > 0.95);
    assert!(hot.confidence(&cool(298)).unwrap() < 0.95);
    let broken = samples(&vec![[0.0, 0.0, 91.0]; 300]);
    assert_eq!(hot.confidence(&broken), Some(0.0));
    assert!(!hot.keeps_limit(hot.verified(&broken).unwrap().value));
}

#[test]
fn a_sample_has_a_plausible_value_for_every_response() {
    let problem = parse("").unwrap();
    problem.check_sample(&[1.0, 2.0, 3.0]).unwrap();
    problem.check_sample(&problem.failed_sample()).unwrap();
    for (values, name, says) in [
        (
            &[1.0, 2.0][..],
            "stress",
            "is one of 3 sampled responses, and the sample has 2",
        ),
        (
            &[1.0, 2.0, 600.0],
            "temperature",
            "is 600.0 °C, above the largest plausible value",
        ),
        (&[1.0, f64::INFINITY, 3.0], "other_stress", "is inf"),
    ] {
        let (of, why) = problem.check_sample(values).unwrap_err();
        assert_eq!(of, name);
        assert!(why.contains(says), "{why}");
    }
    assert_eq!(
        problem.sample_of(vec![1.0, f64::NAN, 3.0]),
        problem.failed_sample()
    );
}

#[test]
fn what_cannot_be_measured_is_refused_in_words() {
    let objective = |lines: &str| format!("[objective]\n{lines}\n");
    for (more, says) in [
        (
            objective("response = \"strain\""),
            "one of [[responses]]: stress, other_stress, temperature",
        ),
        (
            objective("response = { greatest = [\"stress\", \"temperature\"] }"),
            "responses of one unit",
        ),
        (
            objective("response = { greatest = [\"stress\"] }"),
            "two or more different responses",
        ),
        (
            objective("response = { most = [\"stress\"] }"),
            "the name of a response, or { greatest",
        ),
        (
            objective("response = { sum = { stress = inf, temperature = 1.0 } }"),
            "a finite number",
        ),
        (
            constraint("response = \"stress\"\nmax = 3.0"),
            "measure is missing",
        ),
        (
            constraint("measure = \"mean\"\nmin = 1.0\nmax = 3.0"),
            "two constraints",
        ),
        (
            constraint("measure = \"mean\"\nunit = \"mm\"\nmax = 3.0"),
            "the unit of its response",
        ),
        (
            constraint("measure = \"exceedance\"\nlimit = 3.0\nmax = 3.0"),
            "a probability from 0.000001",
        ),
        (
            constraint("measure = \"exceedance\"\nmax = 0.1"),
            "constraints[1].limit is missing",
        ),
        (
            constraint("measure = \"mean\"\nlevel = 0.9\nmax = 3.0"),
            "constraints[1].level is 0.9",
        ),
        (
            constraint("measure = \"mean\""),
            "constraints[1].max is missing",
        ),
        (
            "[[responses]]\nname = \"y\"\nbaseline = true\n".to_owned(),
            "only if it alone is the objective",
        ),
    ] {
        let error = parse(&more).map(|_| ()).unwrap_err();
        assert!(error.contains(says), "{more}: {error}");
    }
    let warnings = parse(&constraint(HOT)).unwrap().campaign().warnings();
    let all = warnings.join("\n");
    assert!(
        all.contains("P99 of a design whose samples")
            || all.contains("P99, the constraint \"hot\","),
        "{all}"
    );
    let tight = HOT.replace("0.01", "0.001");
    let warnings = parse(&constraint(&tight)).unwrap().campaign().warnings();
    let all = warnings.join("\n");
    assert!(all.contains("takes at least 2995"), "{all}");
}
