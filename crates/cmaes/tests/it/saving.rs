//! Searches and runs that are written and read go on to the bit.

use super::{cube, options};
use cmaes::{CmaEs, Error, Evaluation, Options, Restarts, Run, RunOptions};
use stats::streams::{Purpose, StreamRng, stream};

/// A stream per generation: the caller's part of resuming.
fn of_generation(generation: usize) -> StreamRng {
    stream(7, Purpose::Test, 1, generation as u64)
}

fn rosenbrock(x: &[f64]) -> f64 {
    x.windows(2)
        .map(|p| 100.0 * (p[0] * p[0] - p[1]).powi(2) + (p[0] - 1.0).powi(2))
        .sum()
}

fn through_json<T: serde::Serialize + serde::de::DeserializeOwned>(state: &T) -> T {
    serde_json::from_str(&serde_json::to_string(state).unwrap()).unwrap()
}

#[test]
fn a_search_is_resumed_to_the_bit_between_any_two_calls() {
    let advance = |save: bool| -> Vec<u64> {
        let mut search = CmaEs::new(&[-2.0; 6], options(cube(-3.0, 3.0, 6))).unwrap();
        for generation in 0..120 {
            let candidates = search.ask(&mut of_generation(search.generation()));
            if save && generation % 7 == 0 {
                search = through_json(&search);
            }
            let values: Vec<f64> = candidates.iter().map(|x| rosenbrock(x)).collect();
            search.tell(&values).unwrap();
            if save && generation % 5 == 0 {
                search = through_json(&search);
            }
        }
        let (x, best) = search.best().unwrap();
        let numbers = x.iter().chain([&best.value]).copied();
        let state = search.mean().into_iter().chain([search.step()]);
        numbers.chain(state).map(f64::to_bits).collect()
    };
    assert_eq!(advance(false), advance(true));
}

#[test]
fn a_run_is_resumed_to_the_bit_across_restarts() {
    for restarts in [
        Restarts::FromBest { planned: 900 },
        Restarts::Ipop,
        Restarts::Bipop,
    ] {
        let advance = |save: bool| {
            let run_options = RunOptions {
                search: options(cube(-3.0, 3.0, 2)),
                evaluations: 6000,
                restarts,
            };
            let mut run = Run::new(&[-2.0; 2], run_options).unwrap();
            while !run.is_finished() {
                let mut rng = of_generation(run.generation());
                let values: Vec<f64> = run.ask(&mut rng).iter().map(|x| rosenbrock(x)).collect();
                run.tell(&values, &mut rng).unwrap();
                if save && run.generation().is_multiple_of(11) {
                    run = through_json(&run);
                }
            }
            run.outcome().unwrap()
        };
        let whole = advance(false);
        assert!(whole.restarts.len() > 1, "{restarts:?}");
        assert_eq!(whole, advance(true));
    }
}

/// JSON has no NaN or infinities, a search has them.
#[test]
fn failed_and_infinite_evaluations_survive() {
    let mut search = CmaEs::new(&[0.0; 2], options(cube(-3.0, 3.0, 2))).unwrap();
    search.ask(&mut of_generation(0));
    let mut values = [f64::NAN; 10];
    values[3] = f64::NEG_INFINITY;
    search.tell(&values).unwrap();
    let read = through_json(&search);
    assert_eq!(read.best(), search.best());
    assert_eq!(read.best().unwrap().1, Evaluation::from(f64::NEG_INFINITY));
}

#[test]
fn damaged_states_are_refused() {
    let mut search = CmaEs::new(&[0.0; 2], Options::new(cube(-3.0, 3.0, 2))).unwrap();
    search.ask(&mut of_generation(0));
    let good = serde_json::to_value(&search).unwrap();
    let damage = |key: &str, value: serde_json::Value| {
        let mut stored = good.clone();
        stored[key] = value;
        serde_json::from_value::<CmaEs>(stored)
            .unwrap_err()
            .to_string()
    };
    for (key, value, says) in [
        ("format", serde_json::json!(9), "version"),
        ("mean", serde_json::json!([0.5]), "size"),
        ("mean", serde_json::json!([0.5, 1.5]), "outside"),
        ("sigma", serde_json::json!(-1.0), "step size"),
        ("lengths", serde_json::json!([1.0, 0.0]), "length"),
        ("axes", serde_json::json!([1.0, 0.0, 0.0]), "size"),
    ] {
        let error = damage(key, value);
        assert!(error.contains(says), "{key}: {error}");
    }
    let expected = Error::State { what: "anything" };
    assert!(expected.to_string().contains("damaged"));
}
