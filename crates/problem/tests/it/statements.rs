//! Objectives, random inputs, discrete variables and approaches, as a campaign file states them.

use problem::formulation::{Approach, Problem};
use problem::{Campaign, Design};
use stats::Measure;

const FILE: &str = include_str!("../../../../campaigns/ishigami/campaign.toml");

/// The campaign with changes of its file, which is read back from JSON as workers read it.
fn with(changes: &[(&str, &str)]) -> Result<Problem, String> {
    let mut text = FILE.to_owned();
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replacen(from, to, 1);
    }
    let campaign = Campaign::parse("c.toml", &text).map_err(|error| error.to_string())?;
    assert_eq!(Campaign::from_json(&campaign.to_json()).unwrap(), campaign);
    Ok(Problem::new(campaign))
}

fn refused(changes: &[(&str, &str)]) -> String {
    let error = with(changes).map(|_| ()).unwrap_err();
    assert!(error.contains("c.toml, line "), "{error}");
    error
}

const MEASURE: &str = "measure = \"percentile\"";
const LEVEL: &str = "level = 0.9 ";
const AIM: &str = "aim = \"minimise\"";

#[test]
fn every_measure_has_its_keys_its_name_and_its_columns() {
    let maximised = (AIM, "aim = \"maximise\"");
    for (lines, both) in [
        (
            "measure = \"percentile\"\nlevel = 0.995",
            [("P99.5", "p99_5"), ("P0.5", "p0_5")],
        ),
        ("measure = \"mean\"", [("mean", "expected"); 2]),
        (
            "measure = \"mean-plus-sd\"\nk = 3",
            [
                ("mean + 3 sd", "mean_plus_sd"),
                ("mean − 3 sd", "mean_minus_sd"),
            ],
        ),
        (
            "measure = \"superquantile\"",
            [("CVaR90", "cvar90"), ("CVaR10", "cvar10")],
        ),
        (
            "measure = \"exceedance\"\nlimit = -2.5",
            [("P(y > −2.5)", "exceedance"); 2],
        ),
    ] {
        let stated = [(MEASURE, lines), (LEVEL, "")];
        for (aim, (name, column)) in [None, Some(maximised)].into_iter().zip(both) {
            let changes: Vec<_> = stated.into_iter().chain(aim).collect();
            let problem = with(&changes).unwrap();
            assert_eq!(problem.measured().name, name);
            let sampling = &problem.campaign().sampling;
            assert_eq!(sampling.measure_column(), column);
            // The verified measure and the estimate of samples from −5 to 4.99 agree.
            let samples: Vec<f64> = (0..1000).map(|i| 0.01 * f64::from(i) - 5.0).collect();
            let verified = sampling.verified(&samples).unwrap();
            let estimate = sampling.estimate(&samples).unwrap().chosen.value;
            assert!((verified.value - estimate).abs() < 0.05, "{lines}");
            assert!(verified.interval.is_some(), "{lines}");
            let worse: Vec<f64> = samples
                .iter()
                .map(|y| problem.cost(problem.cost(*y) + 0.5))
                .collect();
            let difference = sampling.difference(&worse, &samples).unwrap().value;
            assert!(problem.cost(difference) > 0.01, "{lines}: {difference}");
        }
    }
    let tail = Measure::TailMean {
        level: 0.1,
        is_lower: true,
    };
    let lower = [(MEASURE, "measure = \"superquantile\""), maximised];
    assert_eq!(with(&lower).unwrap().campaign().sampling.measure(), tail);
}

#[test]
fn keys_that_a_measure_does_not_take_are_refused() {
    for (lines, says) in [
        ("measure = \"median\"", "objective.measure"),
        ("measure = \"mean-plus-sd\"", "objective.k is missing"),
        ("measure = \"exceedance\"", "objective.limit is missing"),
        (
            "measure = \"mean\"\nlevel = 0.9",
            "absent beside measure = \"mean\": it belongs to measure = \"percentile\" or \"superquantile\"",
        ),
        (
            "measure = \"mean\"\nk = 2",
            "objective.k is 2.0, but must be absent beside measure = \"mean\": it belongs to measure = \"mean-plus-sd\"",
        ),
        (
            "measure = \"superquantile\"\nlevel = 1.0",
            "objective.level is 1.0",
        ),
        ("measure = \"mean-plus-sd\"\nk = -1", "objective.k is -1.0"),
    ] {
        let error = refused(&[(MEASURE, lines), (LEVEL, "")]);
        assert!(error.contains(says), "{error}");
    }
    let estimator = (
        "[sampling]\n",
        "[sampling]\nestimator = \"chosen-bootstrap\"\n",
    );
    let error = refused(&[(MEASURE, "measure = \"mean\""), (LEVEL, ""), estimator]);
    assert!(error.contains("sampling.estimator"), "{error}");
    let even = "[sampling]\nestimator = \"normal\"\ncoefficients = \"antithetic\"\n";
    let exceedance = (MEASURE, "measure = \"exceedance\"\nlimit = 1");
    let error = refused(&[exceedance, (LEVEL, ""), ("[sampling]\n", even)]);
    assert!(
        error.contains("objective.measure is \"exceedance\""),
        "{error}"
    );
}

/// A failed sample is the worst for percentile and probability; other measures do not exist with it.
#[test]
fn failed_samples_count_in_every_measure() {
    let mut samples: Vec<f64> = (0..100).map(f64::from).collect();
    samples[7] = f64::INFINITY;
    let estimate = |lines: &str| {
        let sampling = with(&[(MEASURE, lines), (LEVEL, "")])
            .unwrap()
            .campaign()
            .sampling
            .clone();
        sampling.estimate(&samples).unwrap().chosen.value
    };
    let percentile = estimate("measure = \"percentile\"");
    assert!((88.0..93.0).contains(&percentile), "{percentile}");
    let probability = estimate("measure = \"exceedance\"\nlimit = 49.5");
    assert!((0.5..0.53).contains(&probability), "{probability}");
    assert_eq!(estimate("measure = \"mean\""), f64::INFINITY);
}

const X2: &str = "name = \"x2\"\nlow = -3.141592653589793\nhigh = 3.141592653589793";
const X3: &str = "name = \"x3\"\nlow = -3.141592653589793\nhigh = 3.141592653589793";

#[test]
fn discrete_variables_have_equal_cells_and_fixed_ones_are_no_coordinates() {
    let problem = with(&[
        (
            "name = \"x1\"\nlow = -3.141592653589793\nhigh = 3.141592653589793",
            "name = \"x1\"\nlow = 2.0\nhigh = 2.0",
        ),
        (X2, "name = \"x2\"\nlow = 17\nhigh = 20\ninteger = true"),
        (X3, "name = \"x3\"\nvalues = [1.0, 1.25, 2.5]"),
    ])
    .unwrap();
    assert_eq!(problem.free_names().collect::<Vec<_>>(), ["x2", "x3"]);
    assert_eq!(problem.cells(Approach::Kriging), [4, 3]);
    for (unit, x) in [
        ([0.0, 0.0], [17.0, 1.0]),
        ([0.24, 0.34], [17.0, 1.25]),
        ([0.26, 0.66], [18.0, 1.25]),
        ([1.0, 1.0], [20.0, 2.5]),
    ] {
        assert_eq!(problem.free_point(&unit), x);
        let middle = problem.unit_point(&x);
        assert_eq!(problem.free_point(&middle), x);
        let design = problem
            .point(Approach::Kriging, &unit, problem.base())
            .unwrap();
        assert_eq!(design, Design::new(vec![2.0, x[0], x[1]]));
        assert_eq!(problem.free_values(&design), x);
    }
    for (to, says) in [
        ("name = \"x3\"\nvalues = [2.0, 1.0]", "increasing order"),
        ("name = \"x3\"\nvalues = []", "finite numbers"),
        (
            "name = \"x3\"\nlow = 1\nvalues = [2.0, 3.0]",
            "without low, high and integer",
        ),
        (
            "name = \"x3\"\nlow = 1.5\nhigh = 3\ninteger = true",
            "variables[3].low is 1.5",
        ),
        (
            "name = \"x3\"\nlow = 1\nhigh = 1e9\ninteger = true",
            "as good as continuous",
        ),
        (
            "name = \"x3\"\nlow = 1\nhigh = inf",
            "give the widest range that makes sense",
        ),
        ("name = \"x3\"\nlow = 1", "variables[3].high is missing"),
        ("name = \"x3\"", "variables[3].low is missing"),
        (
            "name = \"x3\"\nlow = 3\nhigh = 1",
            "equal to it, it fixes the variable",
        ),
    ] {
        let error = refused(&[(X3, to)]);
        assert!(error.contains(says), "{error}");
    }
}

const OFFSET: &str = "name = \"offset\"\ndistribution = \"normal\"";

#[test]
fn random_inputs_follow_their_formulas_and_correlations() {
    let more = "[[random]]\nname = \"load\"\ndistribution = \"uniform\"\nlow = \"x1\"\nhigh = \"x1 + 2 * x2 ^ 2\"\n\n\
                [[correlations]]\nbetween = [\"load\", \"offset\"]\nvalue = 0.6\n\n[[responses]]";
    let problem = with(&[("[[responses]]", more)]).unwrap();
    let inputs = problem.random().unwrap();
    let design = Design::new(vec![1.0, 2.0, 0.0]);
    assert_eq!(inputs.means(&design).unwrap(), [0.0, 5.0]);
    // The score of the load is 0.6 z₁ + 0.8 z₂.
    let values = inputs.values(&design, &[1.0, -0.75]).unwrap();
    assert!(
        (values[0] - 0.5).abs() < 1e-12 && (values[1] - 5.0).abs() < 1e-9,
        "{values:?}"
    );
    let flat = Design::new(vec![1.0, 0.0, 0.0]);
    let why = inputs.values(&flat, &[0.0; 2]).unwrap_err();
    assert_eq!(
        why,
        "random-input: load has no distribution with low = 1, high = 1: it needs low < high"
    );
    // Quasi-random samples need known inputs.
    let even = "[sampling]\nestimator = \"normal\"\ncoefficients = \"antithetic\"\n";
    with(&[("[sampling]\n", even)]).unwrap();
}

#[test]
fn random_inputs_without_a_distribution_are_refused_by_line_and_key() {
    for (to, says) in [
        (
            "name = \"x1\"\ndistribution = \"normal\"",
            "no other variable, constraint, random input or response",
        ),
        ("name = \"offset\"\ndistribution = \"cauchy\"", "random"),
        (
            "name = \"offset\"\ndistribution = \"uniform\"",
            "random[1].mean is 0.0, but must be absent: \"uniform\" takes low, high",
        ),
        (
            "name = \"offset\"\ndistribution = \"weibull\"",
            "random[1].mean",
        ),
        (
            "name = \"offset\"\ndistribution = \"lognormal\"",
            "mean > 0, sd ≥ 0",
        ),
        (
            "name = \"offset\"\ndistribution = \"table\"",
            "random[1].mean",
        ),
        (
            "name = \"offset\"\ndistribution = \"table\"\nvalues = [1.0]\n\n[[random]]\nname = \"other\"\ndistribution = \"normal\"",
            "random[1].values is [1.0], but must be two or more finite numbers",
        ),
        (
            "name = \"offset\"\ndistribution = \"truncated-normal\"",
            "random[1].low is missing",
        ),
    ] {
        let error = refused(&[(OFFSET, to)]);
        assert!(error.contains(says), "{error}");
    }
    for (to, says) in [
        (
            "sd = \"0.1 * y9\" ",
            "a formula of the variables x1, x2, x3; it has y9",
        ),
        ("sd = \"0.1 * \" ", "a formula of the variables x1, x2, x3"),
        ("sd = -1.0 ", "sd ≥ 0"),
        (
            "sd = -1.0 ",
            "random[1].distribution is \"normal with mean = 0.0, sd = -1.0\"",
        ),
        ("sd = inf ", "a finite number"),
    ] {
        let error = refused(&[("sd = 0.5 ", to)]);
        assert!(error.contains(says), "{error}");
    }
    let lognormal = (OFFSET, "name = \"offset\"\ndistribution = \"lognormal\"");
    let error = refused(&[lognormal, ("sd = 0.5 ", "sd = 0.0 ")]);
    let says = "random[1].distribution is \"lognormal with mean = 0.0, sd = 0.0\", but must be one that exists: mean > 0, sd ≥ 0";
    assert!(error.contains(says), "{error}");
    let pair = |lines: &str| format!("[[correlations]]\n{lines}\n\n[[responses]]");
    for (lines, says) in [
        (
            "between = [\"offset\", \"x1\"]\nvalue = 0.5",
            "two random inputs: offset",
        ),
        (
            "between = [\"offset\", \"offset\"]\nvalue = 0.5",
            "two random inputs",
        ),
    ] {
        let error = refused(&[("[[responses]]", &pair(lines))]);
        assert!(error.contains(says), "{error}");
    }
}

#[test]
fn approaches_are_chosen_by_name() {
    let listed = |list: &str| format!("seed = 1\napproaches = {list}\n");
    let problem = with(&[("seed = 1 ", &listed("[\"kriging\", \"best-of-doe\"]"))]).unwrap();
    let approaches: Vec<Approach> = problem.approaches().collect();
    assert_eq!(approaches, [Approach::Kriging, Approach::BestOfDoe]);
    let of_name = with(&[("seed = 1 ", &listed("[\"baseline\"]"))]).unwrap();
    assert_eq!(
        of_name.approaches().collect::<Vec<_>>(),
        [Approach::Baseline]
    );
    for (list, says) in [
        ("[]", "one or more"),
        ("[\"kriging\", \"kriging\"]", "different"),
        ("[\"no-wear\"]", "for gears"),
        ("[\"direct\"]", "optimise.direct"),
        ("[\"enriched-kriging\"]", "[enrichment]"),
        ("[\"simplex\"]", "simplex"),
    ] {
        let error = refused(&[("seed = 1 ", &listed(list))]);
        assert!(error.contains(says), "{error}");
    }
}

/// Samples do not depend on the measure, unless a direct search takes them where it is good.
#[test]
fn another_measure_of_the_same_samples_extends_a_campaign() {
    let held = with(&[]).unwrap();
    let mean = (MEASURE, "measure = \"mean\"");
    let other = with(&[mean, (LEVEL, "")]).unwrap();
    let both = [&held, &other].map(Problem::campaign);
    assert!(both[1].extends(both[0]) && both[0].extends(both[1]));
    assert_eq!(both[0].values_digest(), both[1].values_digest());
    assert_ne!(both[0].digest(), both[1].digest());
    let up = with(&[(AIM, "aim = \"maximise\"")]).unwrap();
    assert!(
        !up.campaign().extends(both[0]),
        "a failed sample is −∞ there"
    );
    let direct = ("[sampling]\n", "[optimise]\ndirect = true\n\n[sampling]\n");
    let searched = [
        with(&[direct]).unwrap(),
        with(&[direct, mean, (LEVEL, "")]).unwrap(),
    ];
    assert!(!searched[1].campaign().extends(searched[0].campaign()));
    // A campaign with more approaches extends one with fewer, not the reverse.
    let few = with(&[("seed = 1 ", "seed = 1\napproaches = [\"kriging\"]\n")]).unwrap();
    assert!(both[0].extends(few.campaign()) && !few.campaign().extends(both[0]));
}
