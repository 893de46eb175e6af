//! Redraws, stopping by tolerances, many variables, and the protocol of asking and telling. The stability atlas of
//! the crate `lab` has the searches that cannot learn.

use super::{cube, options, rng, run};
use cmaes::{CmaEs, Error, Options, Stop};
use proptest::prelude::*;
use rand::TryRng;
use stats::streams::StreamRng;
use std::convert::Infallible;

/// Counts the numbers drawn.
struct CountingRng(StreamRng, usize);

impl TryRng for CountingRng {
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
        let mut counting = CountingRng(rng(4), 0);
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
