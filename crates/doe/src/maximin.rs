//! The optimiser of maximin designs: phases of the search and their budgets.

use rand::RngExt as _;
use stats::streams::{Purpose, stream};

use crate::design::{check, random_columns};
use crate::search::Search;
use crate::table::Table;
use crate::{Design, Error};

/// Budget per variable and point, in coordinates read. `docs/kriging.md`, section "Designs", has the measured times.
const STEPS: f64 = 8.5e5;
/// Points added to n in the budget, because small designs are hard although they have few swaps per point.
const EXTRA_POINTS: f64 = 320.0;
/// Share of the budget after which the first ratchet ends.
const RATCHET_UNTIL: f64 = 0.05;
/// Share of the budget after which the first annealing ends.
const ANNEAL_UNTIL: f64 = 0.8;
/// Excess of the first annealing's squared radius over the largest one reached, relative to the
/// latter.
const REACH: f64 = 0.3;
/// The largest increase of energy that the first annealing accepts, in units of the energy of two
/// coinciding points.
const HEAT: f64 = 0.03;
/// Swaps tried per point before a radius counts as out of reach.
const PATIENCE: u64 = 50;

/// Options of the search for a maximin design.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// The random seed: the same seed gives the same design, on any machine.
    pub seed: u64,
    /// The search's length relative to the default, 1. With 0 the random start is returned.
    pub effort: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            seed: 0,
            effort: 1.0,
        }
    }
}

/// A Latin hypercube of `n` points in `d` variables with a large smallest distance. The points are
/// in random order.
///
/// The usual surrogate Σ 1/δᵖ over all distances δ ranks designs by their smallest distance only if p is about 40 or
/// more, and then only the nearest pairs count. This search leaves the other pairs out: for a radius r, each pair
/// with δ < r has the potential energy (1 − δ²/r²)², and a design without energy has a minimum distance of at least
/// r. Levels and scaled energies are integers, so distances are exact and sums of energies have no rounding errors.
///
/// A step takes a point with energy, one variable, and the best of a few random levels. The point exchanges levels
/// with the point at that level if the total energy does not grow; otherwise a few other levels are tried. Three
/// phases spend the budget:
///
/// 1. ratchet: raise r a little whenever no energy is left, or half as far when some was left;
/// 2. annealing: at a radius slightly out of reach, accept swaps that add energy up to a random
///    threshold, which falls to zero;
/// 3. ratchet again, in ever smaller steps down to the last unit of δ².
///
/// When the last ratchet gets stuck before the budget is spent, as it does for small designs, the search repeats
/// phases 2 and 3, nearer to the radius reached and with a higher threshold, in turn with phase 1 from a new random
/// design.
///
/// The best design without energy is kept throughout, so the result is never worse than the random
/// start. No upper bound is tight enough to prove it best, except for tiny designs, where the mean
/// squared distance n(n + 1)d/6 in levels ends the search (van Dam et al.).
///
/// # Errors
///
/// [`Error::Points`] or [`Error::Variables`] for a size out of range, [`Error::Effort`] for an
/// effort that is negative or not finite.
pub fn maximin(n: usize, d: usize, options: &Options) -> Result<Design, Error> {
    check(n, d)?;
    let effort = options.effort;
    if !(effort >= 0.0 && effort.is_finite()) {
        return Err(Error::Effort { effort });
    }
    let mut rng = stream(options.seed, Purpose::Doe, 0, 0);
    let start = Table::new(n, &random_columns(n, d - 1, &mut rng));
    // The table is sorted by variable 0. In random order, the first few points are a fair sample.
    let mut order: Vec<u32> = (0..n as u32).collect();
    for i in (1..n).rev() {
        order.swap(i, rng.random_range(0..=i as u32) as usize);
    }

    let mut search = Search::new(start, rng);
    if d > 1 {
        let budget = effort * STEPS * d as f64 * (n as f64 + EXTRA_POINTS);
        ratchet(&mut search, (budget * RATCHET_UNTIL) as u64);
        anneal(&mut search, (budget * ANNEAL_UNTIL) as u64, REACH, HEAT);
        ratchet(&mut search, budget as u64);
        let (mut reach, mut heat) = (REACH, HEAT);
        while search.spent() < budget as u64 && !search.is_optimal() {
            reach /= 2.0;
            heat = (2.0 * heat).min(0.5);
            let until = search.spent().midpoint(budget as u64);
            anneal(&mut search, until, reach, heat);
            ratchet(&mut search, budget as u64);
            search.randomise();
            ratchet(&mut search, budget as u64);
        }
    }
    let best = search.best();
    let levels = order
        .iter()
        .flat_map(|&i| (0..d).map(move |k| best.level(i as usize, k) as u32));
    Ok(Design::from_levels(n, d, levels))
}

/// Raises the radius from the current design's smallest distance until the budget `until` is spent.
fn ratchet(search: &mut Search, until: u64) {
    let patience = PATIENCE * search.points() as u64;
    let mut floor = search.measure();
    let mut rise = 0.5;
    while search.spent() < until && !search.is_optimal() {
        let radius = ((floor as f64 * (1.0 + rise)) as i64).max(floor + 1);
        search.set_squared_radius(radius);
        let mut repairs = 0;
        while search.has_energy() && repairs < patience && search.spent() < until {
            search.repair(0);
            repairs += 1;
        }
        if search.has_energy() {
            if radius == floor + 1 && repairs == patience {
                return; // The smallest rise is out of reach from here.
            }
            rise *= 0.5;
        } else {
            search.keep();
            floor = radius;
            if repairs < 2 * search.points() as u64 {
                rise = (rise * 1.5_f64).min(1.0);
            }
        }
    }
}

/// Anneals the best design until the budget `until` is spent, at a squared radius that exceeds the
/// best one by the fraction `reach`. `heat` is the largest increase of energy accepted at the
/// start, in units of the energy of two coinciding points.
fn anneal(search: &mut Search, until: u64, reach: f64, heat: f64) {
    if search.spent() >= until || search.is_optimal() {
        return;
    }
    search.restore();
    let radius = (search.measure() as f64 * (1.0 + reach)) as i64 + 1;
    search.set_squared_radius(radius);
    let (start, hottest) = (search.spent(), search.slack(heat));
    while search.has_energy() && search.spent() < until {
        let left = (until - search.spent()) as f64 / until.saturating_sub(start).max(1) as f64;
        search.repair((hottest * left.min(1.0).powi(2)) as i64);
    }
    if !search.has_energy() {
        search.keep();
    }
}
