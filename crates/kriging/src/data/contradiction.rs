//! Pairs of observations at nearly the same point that no smooth function can explain.

use crate::Error;
use crate::data::scaled::ScaledData;
use crate::data::{Points, near};

/// Distance in each coordinate, relative to its extent, up to which points are nearly the same. A
/// process whose shortest range is 1e-6 of the extent changes by a thousandth of its deviation over
/// this distance.
const NEARLY: f64 = 1e-9;
/// Permitted difference, in standard deviations of its noise. A normal difference is larger with a
/// probability of 2e-9.
const DEVIATIONS: f64 = 6.0;
/// Permitted difference beyond the noise, relative to the standard deviation of all observations: the
/// largest jitter still explains such a difference.
const SMALL: f64 = 1e-2;

/// [`Error::Contradiction`] for the pair of observations that contradict each other most, if there is
/// one.
pub(crate) fn check(points: &Points, scaled: &ScaledData) -> Result<(), Error> {
    let mut worst: Option<(f64, [usize; 2])> = None;
    let nearly = vec![NEARLY; scaled.columns.len()];
    for group in near::groups(&scaled.columns, &nearly, scaled.len()) {
        for (k, &a) in group.iter().enumerate() {
            for &b in &group[k + 1..] {
                let [a, b] = [a.min(b), a.max(b)];
                let Some(excess) = excess(scaled, a, b) else {
                    continue;
                };
                // The pairs come in no particular order; ties go to the smaller numbers.
                let is_worse = worst.is_none_or(|(most, pair)| {
                    excess.total_cmp(&most).then(pair.cmp(&[a, b])).is_gt()
                });
                if is_worse {
                    worst = Some((excess, [a, b]));
                }
            }
        }
    }
    let Some((_, [a, b])) = worst else {
        return Ok(());
    };
    let [first, second] = [a, b].map(|i| points.first[i]);
    Err(Error::Contradiction {
        first: first.min(second),
        second: first.max(second),
        difference: (scaled.y[a] - scaled.y[b]).abs() * scaled.y_scale,
        permitted: permitted(scaled, a, b) * scaled.y_scale,
    })
}

/// The largest permitted difference of two observations at nearly the same point, in scaled units.
fn permitted(scaled: &ScaledData, a: usize, b: usize) -> f64 {
    let noise = scaled.noise[a] + scaled.noise[b];
    DEVIATIONS * noise.sqrt() + SMALL
}

/// The difference of two observations as a multiple of the permitted one, if they contradict each
/// other.
fn excess(scaled: &ScaledData, a: usize, b: usize) -> Option<f64> {
    let mut gaps = scaled.columns.iter().map(|c| (c[a] - c[b]).abs());
    if gaps.any(|gap| gap > NEARLY) {
        return None;
    }
    let excess = (scaled.y[a] - scaled.y[b]).abs() / permitted(scaled, a, b);
    (excess > 1.0).then_some(excess)
}
