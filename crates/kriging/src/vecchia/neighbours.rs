//! The order of the points and their nearest neighbours. Ties go to the smaller index.

use rayon::prelude::*;

use crate::likelihood::point;

/// Number of points that are put in max–min order. The others stay in random order, which is nearly as
/// good (Guinness 2018) and does not cost n² steps.
const ORDERED: usize = 3000;
/// The fewest points whose neighbours one thread looks for.
const CHUNK: usize = 64;

/// The first `count` points of the max–min order that starts at `random[0]`.
pub(super) fn max_min_order(columns: &[Vec<f64>], random: Vec<usize>, count: usize) -> Vec<usize> {
    let n = random.len();
    let leading = count.min(n).min(ORDERED);
    let mut nearest = vec![f64::INFINITY; n];
    let mut order = Vec::with_capacity(n);
    let mut next = random[0];
    let mut distances = vec![0.0; n];
    for _ in 0..leading {
        order.push(next);
        squared_distances(columns, |column| column[next], 0..n, &mut distances);
        let (mut farthest, mut best) = (f64::NEG_INFINITY, 0);
        for (i, (near, distance)) in nearest.iter_mut().zip(&distances).enumerate() {
            // Taken points keep a distance below all others.
            *near = near.min(*distance);
            if *near > farthest {
                (farthest, best) = (*near, i);
            }
        }
        nearest[order[order.len() - 1]] = f64::NEG_INFINITY;
        if best == order[order.len() - 1] {
            // All free points lie on top of taken ones: take the first of them.
            best = nearest
                .iter()
                .position(|d| *d > f64::NEG_INFINITY)
                .unwrap_or(best);
        }
        next = best;
    }
    let mut taken = vec![false; n];
    order.iter().for_each(|&i| taken[i] = true);
    order.extend(random.into_iter().filter(|&i| !taken[i]));
    order.truncate(count);
    order
}

/// For each point in the order of the columns, its `m` nearest among the earlier ones.
pub(super) fn nearest_earlier(columns: &[Vec<f64>], m: usize) -> Vec<Vec<u32>> {
    let n = columns.first().map_or(0, Vec::len);
    (0..n)
        .into_par_iter()
        .with_min_len(CHUNK)
        .map(|i| nearest(columns, &point(columns, i), i, m))
        .collect()
}

/// The `m` points nearest to `at` among the first `count`, by increasing index.
pub(super) fn nearest(columns: &[Vec<f64>], at: &[f64], count: usize, m: usize) -> Vec<u32> {
    const BLOCK: usize = 512;
    let mut distances = [0.0; BLOCK];
    let mut found: Vec<(f64, u32)> = Vec::with_capacity(8 * m + BLOCK);
    let mut limit = f64::INFINITY;
    let shrink = |found: &mut Vec<(f64, u32)>| -> f64 {
        let by_distance = |a: &(f64, u32), b: &(f64, u32)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
        found.select_nth_unstable_by(m - 1, by_distance);
        found.truncate(m);
        found[m - 1].0
    };
    for start in (0..count).step_by(BLOCK) {
        let end = (start + BLOCK).min(count);
        let block = &mut distances[..end - start];
        let mut next = at.iter();
        squared_distances(
            columns,
            |_| next.next().copied().unwrap_or(0.0),
            start..end,
            block,
        );
        for (i, distance) in (start as u32..).zip(&*block) {
            if *distance < limit {
                found.push((*distance, i));
            }
        }
        if found.len() > 4 * m {
            limit = shrink(&mut found);
        }
    }
    if found.len() > m {
        shrink(&mut found);
    }
    let mut near: Vec<u32> = found.into_iter().map(|(_, i)| i).collect();
    near.sort_unstable();
    near
}

/// The squared distances of the points in `run` from the point whose coordinates `at` gives, column by
/// column.
fn squared_distances(
    columns: &[Vec<f64>],
    mut at: impl FnMut(&[f64]) -> f64,
    run: std::ops::Range<usize>,
    out: &mut [f64],
) {
    out.fill(0.0);
    for column in columns {
        let at = at(column);
        for (o, c) in out.iter_mut().zip(&column[run.clone()]) {
            *o += (c - at) * (c - at);
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::RngExt as _;
    use stats::streams::{Purpose, stream};

    use super::*;

    fn columns(n: usize) -> Vec<Vec<f64>> {
        let mut rng = stream(1, Purpose::Test, n as u64, 1);
        (0..3)
            .map(|_| (0..n).map(|_| rng.random()).collect())
            .collect()
    }

    fn squared(columns: &[Vec<f64>], i: usize, j: usize) -> f64 {
        columns.iter().map(|c| (c[i] - c[j]).powi(2)).sum()
    }

    #[test]
    fn neighbours_are_those_of_a_full_sort() {
        let columns = columns(1500);
        let found = nearest_earlier(&columns, 7);
        for i in [0, 1, 6, 7, 8, 700, 1499] {
            let mut all: Vec<u32> = (0..i as u32).collect();
            all.sort_by(|&a, &b| {
                let [a, b] = [a, b].map(|j| squared(&columns, i, j as usize));
                a.total_cmp(&b)
            });
            all.truncate(7);
            all.sort_unstable();
            assert_eq!(found[i], all, "{i}");
        }
    }

    #[test]
    fn each_point_of_the_order_is_the_farthest_left() {
        let columns = columns(60);
        let order = max_min_order(&columns, (0..60).rev().collect(), 60);
        assert_eq!(order[0], 59);
        let gap = |i: usize, before: &[usize]| {
            let distances = before.iter().map(|&j| squared(&columns, i, j));
            distances.fold(f64::INFINITY, f64::min)
        };
        for k in 1..60 {
            let here = gap(order[k], &order[..k]);
            assert!(order[k + 1..].iter().all(|&i| gap(i, &order[..k]) <= here));
        }
        let mut sorted = order;
        sorted.sort_unstable();
        assert!(sorted.into_iter().eq(0..60));
        // Points on top of each other are all listed.
        let same = vec![vec![0.5; 9]];
        let mut order = max_min_order(&same, (0..9).collect(), 9);
        order.sort_unstable();
        assert!(order.into_iter().eq(0..9));
    }
}
