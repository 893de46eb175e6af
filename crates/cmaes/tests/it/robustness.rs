//! Bounds, failures and plateaus: what the search does when it cannot learn.

use super::{cube, options, rng, run};
use cmaes::{Bounds, CmaEs, Error, Evaluation, Options, Stop};
use proptest::prelude::*;
use rand::TryRng;
use stats::streams::StreamRng;
use std::convert::Infallible;

/// All of 11 seeds reach an optimum in the corner of a box with unequal ranges from its middle.
/// (Redraws alone stall there.)
#[test]
fn an_optimum_in_a_corner_is_reached() {
    for (dimension, limit) in [(1, 2000), (2, 3000), (6, 5000), (11, 9000)] {
        for seed in 0..11 {
            let intervals: Vec<(f64, f64)> =
                (0..dimension).map(|i| (-1.0, 2.0 + i as f64)).collect();
            let bounds = Bounds::new(intervals).unwrap();
            let start: Vec<f64> = bounds
                .intervals()
                .iter()
                .map(|(l, u)| (l + u) / 2.0)
                .collect();
            let mut search = CmaEs::new(&start, options(bounds.clone())).unwrap();
            let corner = |x: &[f64]| x.iter().map(|v| v + 1.0).sum::<f64>();
            run(&mut search, limit, &mut rng(seed), corner);
            let (x, best) = search.best().unwrap();
            assert!(
                best.value < 1e-9,
                "{dimension} variables, seed {seed}: {best:?} at {x:?}"
            );
            assert!(bounds.contains(x) && bounds.contains(&search.mean()));
        }
    }
}

/// One variable at its bound, as the helix angle of the gear problem, the others inside.
#[test]
fn an_optimum_on_a_face_is_reached() {
    for seed in 0..5 {
        let mut search = CmaEs::new(&[0.5; 11], options(cube(0.0, 1.0, 11))).unwrap();
        let face = |x: &[f64]| 1.0 - x[10] + x[..10].iter().map(|v| (v - 0.4).powi(2)).sum::<f64>();
        run(&mut search, 8000, &mut rng(seed), face);
        let (x, best) = search.best().unwrap();
        assert!(
            best.value < 1e-9,
            "seed {seed}: {best:?} at {x:?}, {:?}",
            search.stop()
        );
    }
}

/// Counts the numbers drawn.
struct Counting(StreamRng, usize);

impl TryRng for Counting {
    type Error = Infallible;

    fn try_next_u32(&mut self) -> Result<u32, Infallible> {
        self.1 += 1;
        self.0.try_next_u32()
    }

    fn try_next_u64(&mut self) -> Result<u64, Infallible> {
        self.1 += 1;
        self.0.try_next_u64()
    }

    fn try_fill_bytes(&mut self, bytes: &mut [u8]) -> Result<(), Infallible> {
        self.1 += 1;
        self.0.try_fill_bytes(bytes)
    }
}

/// From a corner of 20 variables, one draw in a million is inside: redraws must be limited.
#[test]
fn redrawing_is_capped() {
    let start = [1.0; 20];
    for resamples in [0, 7] {
        let settings = Options {
            resamples,
            ..options(cube(0.0, 1.0, 20))
        };
        let mut search = CmaEs::new(&start, settings).unwrap();
        let mut counting = Counting(rng(4), 0);
        let candidates = search.ask(&mut counting);
        assert!(candidates.iter().flatten().all(|v| (0.0..=1.0).contains(v)));
        assert!(
            candidates.iter().all(|x| x.contains(&1.0)),
            "coordinates are set onto the bound"
        );
        // A normal number takes one draw of the generator, and one in a hundred a few more.
        let normals = 10 * 20 * (resamples + 1);
        assert!(
            (normals..normals + normals / 10).contains(&counting.1),
            "{}",
            counting.1
        );
    }
}

#[test]
fn a_plateau_is_called_one() {
    for dimension in [1, 6] {
        let mut search =
            CmaEs::new(&vec![0.3; dimension], options(cube(0.0, 1.0, dimension))).unwrap();
        let stop = run(&mut search, 10_000, &mut rng(1), |_| 4.2);
        assert!(matches!(stop, Some(Stop::Plateau { .. })), "{stop:?}");
        // The window of 10 + 30 d/λ generations, and no more.
        assert_eq!(search.evaluations(), 10 * (10 + 3 * dimension));
    }
}

#[test]
fn a_level_violation_is_a_plateau_too() {
    let mut search = CmaEs::new(&[0.3; 6], options(cube(0.0, 1.0, 6))).unwrap();
    let flat = |x: &[f64]| Evaluation {
        value: x[0],
        violation: 1.0,
    };
    let stop = run(&mut search, 10_000, &mut rng(1), flat);
    assert!(matches!(stop, Some(Stop::Plateau { .. })), "{stop:?}");
    assert!(!search.best().unwrap().1.is_feasible());
}

#[test]
fn failures_everywhere_are_called_so_and_leave_the_search_as_it_was() {
    for failure in [f64::NAN, f64::INFINITY] {
        let mut search = CmaEs::new(&[0.3; 6], options(cube(0.0, 1.0, 6))).unwrap();
        let stop = run(&mut search, 10_000, &mut rng(1), |_| failure);
        assert_eq!(stop, Some(Stop::AllFailed { generations: 28 }));
        assert_eq!(search.best(), None);
        assert_eq!((search.mean(), search.step()), (vec![0.3; 6], 0.3));
    }
}

/// A third of the box cannot be evaluated, next to the optimum.
#[test]
fn failures_rank_last() {
    for failure in [f64::NAN, f64::INFINITY] {
        let mut search = CmaEs::new(&[0.9; 6], options(cube(0.0, 1.0, 6))).unwrap();
        run(&mut search, 6000, &mut rng(1), |x| {
            if x[0] < 1.0 / 3.0 {
                failure
            } else {
                x.iter().map(|v| v * v).sum()
            }
        });
        let (x, best) = search.best().unwrap();
        assert!((best.value - 1.0 / 9.0).abs() < 1e-6, "{best:?} at {x:?}");
    }
}

#[test]
fn convergence_has_a_name() {
    let sphere = |x: &[f64]| x.iter().map(|v| (v - 0.5).powi(2)).sum::<f64>();
    let settings = options(cube(0.0, 1.0, 3));
    let mut search = CmaEs::new(&[0.3; 3], settings.clone()).unwrap();
    let stop = run(&mut search, 10_000, &mut rng(1), sphere);
    assert!(
        matches!(stop, Some(Stop::ValueTolerance { spread }) if spread < 1e-12),
        "{stop:?}"
    );

    let settings = Options {
        value_tolerance: 0.0,
        ..settings
    };
    let mut search = CmaEs::new(&[0.3; 3], settings).unwrap();
    // The square root keeps values apart whose squares no longer are.
    let stop = run(&mut search, 10_000, &mut rng(1), |x| sphere(x).sqrt());
    assert!(
        matches!(stop, Some(Stop::StepTooSmall { step }) if step < 3e-13),
        "{stop:?}"
    );
}

/// Axes that differ by 10⁸ ask for a covariance with a condition number of 10¹⁶.
#[test]
fn an_ill_conditioned_covariance_is_called_so() {
    let ridge = |x: &[f64]| 1e16 * (x[0] - 0.5).powi(2) + (x[1] - 0.5).powi(2);
    let settings = Options {
        value_tolerance: 0.0,
        step_tolerance: 0.0,
        ..options(cube(0.0, 1.0, 2))
    };
    let mut search = CmaEs::new(&[0.3; 2], settings).unwrap();
    let stop = run(&mut search, 50_000, &mut rng(1), ridge);
    assert!(
        matches!(stop, Some(Stop::IllConditioned { condition }) if condition > 1e14),
        "{stop:?}"
    );
}

/// 200 variables, the most that the search is meant for.
#[test]
fn two_hundred_variables_are_not_too_many() {
    let mut search = CmaEs::new(
        &vec![0.8; 200],
        Options {
            step: 0.1,
            ..Options::new(cube(0.0, 1.0, 200))
        },
    )
    .unwrap();
    let sphere = |x: &[f64]| x.iter().map(|v| (v - 0.5).powi(2)).sum::<f64>();
    let stop = run(&mut search, 12_000, &mut rng(1), sphere);
    // The start value is 18; a sphere takes some 60 evaluations per variable for a factor of about
    // 10⁴.
    let (_, best) = search.best().unwrap();
    assert!(best.value < 0.05 && stop.is_none(), "{best:?}, {stop:?}");
}

#[test]
fn asking_and_telling_must_match() {
    let mut search = CmaEs::new(&[0.3; 2], options(cube(0.0, 1.0, 2))).unwrap();
    assert_eq!(search.tell(&[1.0; 10]), Err(Error::NothingAsked));
    search.ask(&mut rng(1));
    assert_eq!(
        search.tell(&[1.0; 9]),
        Err(Error::Count {
            expected: 10,
            got: 9
        })
    );
    assert_eq!(search.tell(&[1.0; 10]), Ok(()));
    assert_eq!(search.tell(&[1.0; 10]), Err(Error::NothingAsked));
    assert_eq!(search.evaluations(), 10);
}

#[test]
fn settings_that_make_no_search_are_refused() {
    let base = options(cube(0.0, 1.0, 2));
    let error = |settings: Options| CmaEs::new(&[0.5; 2], settings).unwrap_err();
    let population = Options {
        population: 1,
        parents: 1,
        ..base.clone()
    };
    assert_eq!(error(population), Error::Population { population: 1 });
    for parents in [0, 11] {
        let settings = Options {
            parents,
            ..base.clone()
        };
        assert_eq!(
            error(settings),
            Error::Parents {
                parents,
                population: 10
            }
        );
    }
    for step in [0.0, -1.0, f64::INFINITY] {
        assert_eq!(
            error(Options {
                step,
                ..base.clone()
            }),
            Error::Step { step }
        );
    }
    let settings = Options {
        value_tolerance: f64::NAN,
        ..base.clone()
    };
    assert!(matches!(
        error(settings),
        Error::Tolerance {
            name: "value tolerance",
            ..
        }
    ));
    assert!(matches!(
        CmaEs::new(&[0.5, 1.5], base.clone()),
        Err(Error::StartOutside { index: 1, .. })
    ));
    let error = CmaEs::new(&[0.5; 3], base).unwrap_err();
    assert_eq!(
        error,
        Error::Dimension {
            expected: 2,
            got: 3
        }
    );
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    /// Whatever the objective answers, candidates stay finite and in the box.
    #[test]
    fn candidates_never_leave_the_box(
        seed in 0_u64..1_000_000,
        dimension in 1_usize..8,
        population in 2_usize..14,
        active: bool,
        at_a_corner: bool,
        answers in prop::collection::vec(
            prop_oneof![
                Just(f64::NAN), Just(f64::INFINITY), Just(f64::NEG_INFINITY), Just(0.0),
                -1e300..1e300, -1.0..1.0,
            ],
            1..40,
        ),
    ) {
        let bounds = cube(-3.0, 0.1, dimension);
        let settings = Options {
            population,
            parents: population.div_ceil(2),
            active,
            resamples: 3,
            ..Options::new(bounds.clone())
        };
        let start = vec![if at_a_corner { 0.1 } else { -2.0 }; dimension];
        let mut search = CmaEs::new(&start, settings).unwrap();
        let mut rng = rng(seed);
        let mut answers = answers.iter().copied().cycle();
        for _ in 0..60 {
            let candidates = search.ask(&mut rng);
            prop_assert!(candidates.iter().all(|x| bounds.contains(x)));
            let told: Vec<f64> = answers.by_ref().take(candidates.len()).collect();
            search.tell(&told).unwrap();
            prop_assert!(bounds.contains(&search.mean()));
            prop_assert!(search.step() > 0.0 && search.step().is_finite());
        }
    }
}
