//! Designs as a caller sees them: Latin, reproducible, and spread out.

use std::collections::BTreeSet;

use doe::{Design, Error, Method, Options, check_enlarge, enlarge, maximin, random_lhs, sobol};
use proptest::prelude::*;

fn options(seed: u64, effort: f64) -> Options {
    Options { seed, effort }
}

/// The smallest squared distance in levels, by a plain loop over all pairs.
fn squared_levels(rows: &[Vec<i64>]) -> i64 {
    let pairs = (0..rows.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
    let squared = |(i, j): (usize, usize)| {
        rows[i]
            .iter()
            .zip(&rows[j])
            .map(|(a, b)| (a - b) * (a - b))
            .sum::<i64>()
    };
    pairs.map(squared).min().expect("two points make a pair")
}

fn levels(design: &Design) -> Vec<Vec<i64>> {
    let n = design.n as f64;
    let level = |x: &f64| (x * n - 0.5).round() as i64;
    (0..design.n)
        .map(|i| design.point(i).iter().map(level).collect())
        .collect()
}

fn permutations(n: i64) -> Vec<Vec<i64>> {
    if n == 0 {
        return vec![Vec::new()];
    }
    let mut all = Vec::new();
    for shorter in permutations(n - 1) {
        for at in 0..=shorter.len() {
            let mut longer = shorter.clone();
            longer.insert(at, n - 1);
            all.push(longer);
        }
    }
    all
}

/// The best squared distance of all Latin hypercubes of n points: variable 0 in order, and every
/// combination of permutations in the others.
fn exhaustive(n: i64, d: usize) -> i64 {
    fn extend(rows: Vec<Vec<i64>>, left: usize, columns: &[Vec<i64>], best: &mut i64) {
        if left == 0 {
            *best = squared_levels(&rows).max(*best);
            return;
        }
        for column in columns {
            let mut wider = rows.clone();
            for (row, level) in wider.iter_mut().zip(column) {
                row.push(*level);
            }
            extend(wider, left - 1, columns, best);
        }
    }
    let mut best = 0;
    extend(
        (0..n).map(|i| vec![i]).collect(),
        d - 1,
        &permutations(n),
        &mut best,
    );
    best
}

#[test]
fn designs_are_latin_to_the_last_bit() {
    for n in [2, 3, 4, 7, 16, 49, 130] {
        for d in [1, 2, 3, 6, 11, 20] {
            for seed in [0, u64::MAX] {
                let random = random_lhs(n, d, seed).unwrap();
                let best = maximin(n, d, &options(seed, 0.002)).unwrap();
                for design in [&random, &best] {
                    assert_eq!((design.n, design.d, design.points.len()), (n, d, n * d));
                    assert!(
                        design.is_latin(),
                        "{n} points in {d} variables, seed {seed}"
                    );
                    assert!(
                        design
                            .points
                            .iter()
                            .all(|x| (0.0..1.0).contains(x) && *x > 0.0)
                    );
                }
            }
        }
    }
}

#[test]
fn the_check_for_latin_sees_one_bit() {
    let mut design = random_lhs(20, 3, 1).unwrap();
    let bits = design.points[7].to_bits();
    design.points[7] = f64::from_bits(bits ^ 1);
    assert!(!design.is_latin());
    design.points[7] = f64::from_bits(bits);
    assert!(design.is_latin());
    design.points[7] = design.points[10]; // the same variable of the next point
    assert!(!design.is_latin());
    design.points.pop();
    assert!(!design.is_latin());
}

#[test]
fn a_seed_names_a_design() {
    let design = |seed| maximin(60, 5, &options(seed, 0.05)).unwrap();
    assert_eq!(design(4), design(4));
    assert_ne!(design(4), design(5));
    assert_eq!(random_lhs(60, 5, 4), random_lhs(60, 5, 4));
    assert_ne!(random_lhs(60, 5, 4), random_lhs(60, 5, 5));
}

/// Pins a design: a change of it changes every campaign's digest.
#[test]
fn the_first_point_is_pinned() {
    let design = maximin(25, 4, &options(2009, 0.01)).unwrap();
    assert_eq!(levels(&design)[0], [12, 11, 2, 21]);
}

/// The search finds the optimum of designs small enough to try all.
#[test]
fn tiny_designs_are_optimal() {
    for (n, d) in [
        (2, 2),
        (3, 2),
        (5, 2),
        (6, 2),
        (7, 2),
        (8, 2),
        (3, 3),
        (5, 3),
        (3, 5),
        (4, 4),
    ] {
        let design = maximin(n, d, &options(1, 0.1)).unwrap();
        let expected = exhaustive(n as i64, d);
        assert_eq!(
            squared_levels(&levels(&design)),
            expected,
            "{n} points in {d} variables"
        );
    }
}

/// The thresholds are the project's requirements. For comparison: the best of a thousand random designs has about 0.30
/// and 0.14.
#[test]
fn points_are_far_apart_in_six_variables() {
    for (n, effort, threshold) in [(100, 1.0, 0.60), (500, 1.0, 0.41)] {
        let design = maximin(n, 6, &options(1, effort)).unwrap();
        let distance = design.min_distance();
        assert!(
            distance >= threshold,
            "{n} points: {distance} is below {threshold}"
        );
        assert!(design.is_latin());
    }
}

#[test]
fn the_search_beats_a_thousand_random_designs() {
    for (n, d) in [(10, 2), (30, 4), (100, 6), (40, 11)] {
        let random = (0..1000).map(|seed| random_lhs(n, d, seed).unwrap().min_distance());
        let best_random = random.fold(0.0, f64::max);
        let found = maximin(n, d, &options(1, 0.05)).unwrap().min_distance();
        assert!(
            found > best_random,
            "{n} points, {d} variables: {found} against {best_random}"
        );
    }
}

/// A large design gets through the set-up and improves, even with next to no effort.
#[test]
fn large_designs_are_accepted() {
    let start = maximin(20_000, 3, &options(1, 0.0)).unwrap();
    let design = maximin(20_000, 3, &options(1, 0.01)).unwrap();
    assert!(design.is_latin() && start.is_latin());
    assert!(design.min_distance() > start.min_distance());
    assert!(random_lhs(100_000, 20, 1).unwrap().is_latin());
}

#[test]
fn the_nearest_pair_is_found() {
    for (n, d) in [(2, 1), (50, 1), (50, 2), (333, 6), (200, 20)] {
        let design = random_lhs(n, d, 8).unwrap();
        let expected = (squared_levels(&levels(&design)) as f64).sqrt() / n as f64;
        // Levels are exact, coordinates are rounded.
        assert!((design.min_distance() - expected).abs() < 1e-12);
    }
}

/// The example of `scipy.stats.qmc.update_discrepancy`, whose discrepancies are squared: a Latin
/// hypercube of 6 points in 2 variables has 0.008142039609053513, all figures of which are certain
/// but the last two.
#[test]
fn the_centred_discrepancy_is_scipys() {
    let levels = [[1, 3], [2, 6], [3, 2], [4, 5], [5, 1], [6, 4]];
    let points = levels
        .iter()
        .flatten()
        .map(|&v| (f64::from(v) - 0.5) / 6.0)
        .collect();
    let design = Design { n: 6, d: 2, points };
    assert!((design.centred_discrepancy().powi(2) - 0.008_142_039_609_053_5).abs() < 1e-15);
}

/// One centred point in d variables has CD² = (13/12)ᵈ − 1, from the formula.
#[test]
fn the_centred_discrepancy_of_one_point_is_known() {
    let design = Design {
        n: 1,
        d: 3,
        points: vec![0.5; 3],
    };
    let expected = ((13.0_f64 / 12.0).powi(3) - 1.0).sqrt();
    assert!((design.centred_discrepancy() - expected).abs() < 1e-15); // a few roundings
}

/// The first points of the optimised design are a fair sample, not a slice.
#[test]
fn points_come_in_random_order() {
    let design = maximin(200, 4, &options(3, 0.01)).unwrap();
    for k in 0..4 {
        let mean = (0..50).map(|i| design.point(i)[k]).sum::<f64>() / 50.0;
        // The mean of 50 of 200 levels has a standard deviation of 0.035.
        assert!((mean - 0.5).abs() < 0.15, "variable {k}: {mean}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    /// Whatever the size and the budget, the result is Latin and no worse than the start.
    #[test]
    fn the_search_never_makes_a_design_worse(
        n in 2_usize..200,
        d in 1_usize..=20,
        seed: u64,
        effort in 0.0..0.004,
    ) {
        let start = maximin(n, d, &options(seed, 0.0)).unwrap();
        let found = maximin(n, d, &options(seed, effort)).unwrap();
        prop_assert!(start.is_latin() && found.is_latin());
        // Compared in levels, where distances are exact.
        prop_assert!(squared_levels(&levels(&found)) >= squared_levels(&levels(&start)));
    }
}

#[test]
fn growth_keeps_every_point_and_every_stratum() {
    for (n, more, d) in [
        (10, 11, 2),
        (10, 30, 3),
        (50, 75, 6),
        (33, 200, 4),
        (2, 3, 1),
    ] {
        let start = maximin(n, d, &options(4, 0.1)).unwrap();
        let grown = enlarge(&start, more, &options(4, 1.0)).unwrap();
        assert_eq!(&grown.points[..n * d], start.points);
        assert_eq!(grown.n, more);
        assert!(grown.is_stratified(), "{n} to {more}");
        assert_eq!(grown, enlarge(&start, more, &options(4, 1.0)).unwrap());
        // A grown design can grow again.
        let again = enlarge(&grown, 2 * more, &options(4, 0.1)).unwrap();
        assert_eq!(&again.points[..more * d], grown.points);
        assert!(again.is_stratified());
    }
}

/// A hash that changes with any bit of a design (FNV-1a, 64 bits).
fn fingerprint(design: &Design) -> u64 {
    let bytes = design.points.iter().flat_map(|x| x.to_bits().to_le_bytes());
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

/// Pins growth: a change of it changes the results of every campaign that grows from now on.
#[test]
fn the_growth_of_a_latin_design_is_pinned() {
    for (n, more, d, expected) in [
        (10, 11, 2, 3_160_530_946_816_669_729_u64),
        (33, 200, 4, 15_933_249_743_201_641_605),
        (50, 75, 6, 14_631_146_805_092_958_545),
        (40, 41, 3, 16_893_524_010_767_676_560),
        (2, 3, 1, 6_653_659_897_080_788_592),
    ] {
        let start = maximin(n, d, &options(4, 0.1)).unwrap();
        let grown = enlarge(&start, more, &options(4, 1.0)).unwrap();
        assert_eq!(fingerprint(&grown), expected, "{n} to {more}");
    }
}

#[test]
fn new_points_keep_away_from_the_old_ones() {
    let start = maximin(100, 6, &options(1, 0.1)).unwrap();
    let random = enlarge(&start, 150, &options(1, 0.0)).unwrap();
    let spread = enlarge(&start, 150, &options(1, 1.0)).unwrap();
    let fresh = maximin(150, 6, &options(1, 0.1)).unwrap();
    let [random, spread, fresh] = [random, spread, fresh].map(|design| design.min_distance());
    // A random completion has points at 0.2; a new design reaches 0.55.
    assert!(
        spread > random + 0.1 && spread > 0.75 * fresh,
        "{random} {spread} {fresh}"
    );
}

/// The strata of `n` that hold at least one point, variable by variable.
fn strata_taken(design: &Design, points: usize, n: usize) -> Vec<BTreeSet<usize>> {
    let level = |x: f64| ((x * n as f64) as usize).min(n - 1);
    (0..design.d)
        .map(|k| (0..points).map(|i| level(design.point(i)[k])).collect())
        .collect()
}

/// From the second growth on, old points share strata of the finer grid; each new point has its
/// own.
#[test]
fn a_design_grows_again_and_again() {
    let mut design = maximin(150, 6, &options(2009, 0.1)).unwrap();
    let mut shared = false;
    for n in [170, 190, 400, 401] {
        assert_eq!(check_enlarge(&design, n), Ok(()));
        let grown = enlarge(&design, n, &options(2009, 0.5)).unwrap();
        assert_eq!(grown.points[..design.n * 6], design.points, "{n} points");
        let before = strata_taken(&grown, design.n, n);
        let after = strata_taken(&grown, n, n);
        for (before, after) in before.iter().zip(&after) {
            shared |= before.len() < design.n;
            assert_eq!(after.len(), before.len() + n - design.n, "{n} points");
        }
        // The search keeps the points further apart than a random completion.
        let random = enlarge(&design, n, &options(2009, 0.0)).unwrap();
        let (found, random) = (grown.min_distance(), random.min_distance());
        assert!(found > random, "{n} points: {found} against {random}");
        design = grown;
    }
    assert!(shared, "no growth was of the kind that this is about");
    // The result depends on the steps of growth: a campaign's store holds the design as it was
    // grown.
    let start = maximin(150, 6, &options(2009, 0.1)).unwrap();
    let at_once = enlarge(&start, 190, &options(2009, 0.5)).unwrap();
    assert_ne!(at_once.points, design.points[..190 * 6]);
}

/// Points may lie anywhere in the box, even all in one place or on its edge.
#[test]
fn any_points_can_be_added_to() {
    let d = 3;
    for x in [0.0, 0.3, 1.0] {
        let crowd = Design {
            n: 5,
            d,
            points: vec![x; 5 * d],
        };
        let grown = enlarge(&crowd, 20, &options(1, 0.5)).unwrap();
        assert_eq!(grown.points[..5 * d], crowd.points);
        for taken in strata_taken(&grown, 20, 20) {
            assert_eq!(taken.len(), 16);
        }
        // Strata are left over, and the search uses that freedom.
        let random = enlarge(&crowd, 20, &options(1, 0.0)).unwrap();
        let apart = |design: &Design| {
            let new = design.points[5 * d..].to_vec();
            Design {
                n: 15,
                d,
                points: new,
            }
            .min_distance()
        };
        assert!(apart(&grown) > apart(&random));
    }
}

#[test]
fn sobol_points_fill_every_stratum_evenly() {
    // 64 points of a scrambled Sobol sequence: one per stratum in every variable, and one per cell
    // of an 8 × 8 grid in the first two.
    let design = sobol(64, 6, 7).unwrap();
    assert!(design.is_stratified());
    let mut cells = [0; 64];
    for i in 0..64 {
        let x = design.point(i);
        assert!(x.iter().all(|x| (0.0..1.0).contains(x) && *x > 0.0));
        cells[(x[0] * 8.0) as usize * 8 + (x[1] * 8.0) as usize] += 1;
    }
    assert_eq!(cells, [1; 64]);
    // A longer design contains a shorter one, another seed gives another.
    assert_eq!(&sobol(100, 6, 7).unwrap().points[..64 * 6], design.points);
    assert_ne!(sobol(64, 6, 8).unwrap(), design);
    // The purpose of the sequence: a lower discrepancy than that of a random Latin hypercube.
    let discrepancy = |design: Design| design.centred_discrepancy();
    let random = discrepancy(random_lhs(256, 6, 7).unwrap());
    assert!(discrepancy(sobol(256, 6, 7).unwrap()) < random);
}

#[test]
fn every_method_grows_and_keeps_its_points() {
    for method in Method::ALL {
        let mut design = method.design(64, 3, &options(5, 0.1)).unwrap();
        for n in [70, 90, 128] {
            assert_eq!(method.check_enlarge(&design, n, 5), Ok(()));
            let grown = method.enlarge(&design, n, &options(5, 0.1)).unwrap();
            assert_eq!(grown.points[..design.n * 3], design.points, "{method}");
            assert_eq!(grown.n, n);
            design = grown;
        }
        let refused = Err(Error::Shrinking {
            n: 100,
            existing: 128,
        });
        assert_eq!(method.check_enlarge(&design, 100, 5), refused);
        if method == Method::Sobol {
            assert_eq!(design, sobol(128, 3, 5).unwrap(), "the sequence goes on");
        }
    }
    // A random design's random completion has one point per stratum, and no search.
    let start = random_lhs(64, 3, 5).unwrap();
    let random = Method::Random
        .enlarge(&start, 128, &options(5, 1.0))
        .unwrap();
    assert!(random.is_stratified());
    assert_eq!(random, enlarge(&start, 128, &options(5, 0.0)).unwrap());
}

/// Differences in the last digits, as conversions of units leave them, are accepted.
#[test]
fn a_rounded_sobol_sequence_is_continued() {
    let mut rounded = sobol(20, 2, 5).unwrap();
    rounded.points[7] += 1e-15;
    let grown = Method::Sobol
        .enlarge(&rounded, 40, &options(5, 1.0))
        .unwrap();
    assert_eq!(grown.points[..40], rounded.points);
}

#[test]
fn methods_have_names() {
    for method in Method::ALL {
        let name = serde_json::to_value(method).unwrap();
        assert_eq!(name, method.to_string());
        let design = method.design(16, 3, &options(5, 0.1)).unwrap();
        assert!(design.is_stratified());
    }
    assert!(serde_json::from_str::<Method>("\"lattice\"").is_err());
    assert_eq!(
        Method::default().design(9, 2, &options(5, 0.1)),
        maximin(9, 2, &options(5, 0.1))
    );
}
