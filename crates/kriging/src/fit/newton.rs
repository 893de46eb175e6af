//! A projected quasi-Newton search in a box, for a handful of variables.
//!
//! The method is BFGS with Powell's damping on the variables that are free to move (Nocedal and
//! Wright, "Numerical Optimization" (2006), sections 16.7, 18.3); the curvature comes from the problem
//! at the start and, if asked for, after the first few iterations. Each step is cut back until it lies
//! in the box, the function can be evaluated and the value has fallen far enough. If the quasi-Newton
//! direction fails, one gradient step is tried before the search ends. The value never rises.

use crate::likelihood::Evaluation;
use crate::linalg::{LowerTriangle, Spd, dot};

/// The most one step may change any variable; the variables are logarithms.
const LONGEST_STEP: f64 = 2.0;

/// Armijo's constant: the least decrease of an accepted step, relative to that of the tangent.
const SUFFICIENT: f64 = 1e-4;

/// Predicted decrease that is insignificant in a log likelihood: the step that promises it changes the parameters by
/// √(2·10⁻³), a twentieth of their standard errors. A search that no step improves counts as converged below it, because
/// rounding of value and gradient may promise as much.
pub(super) const INSIGNIFICANT: f64 = 1e-3;

/// Number of rounding errors below which a decrease may not show in values.
const SEVERAL: f64 = 10.0;
/// The most lengths tried for a step: an evaluation can take seconds.
const LENGTHS: usize = 20;
/// The most lengths tried when no more than [`INSIGNIFICANT`] is to be gained.
const FEW_LENGTHS: usize = 4;

/// The end of a search.
#[derive(Debug, Clone)]
pub(crate) struct Outcome {
    /// The variables of the least value.
    pub(crate) at: Vec<f64>,
    pub(crate) value: f64,
    pub(crate) iterations: usize,
    pub(crate) converged: bool,
    /// Whether the last step ran into a point where the function could not be evaluated.
    pub(crate) met_failure: bool,
}

/// The box of a search and its stopping rules.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Limits<'a> {
    pub(crate) lower: &'a [f64],
    pub(crate) upper: &'a [f64],
    pub(crate) max_iterations: usize,
    /// Number of first iterations in which the curvature is taken from the problem. It brings a
    /// search close to the optimum in fewer steps than updates do; updates converge faster in the
    /// end.
    pub(crate) renewed: usize,
    /// The search ends when the quadratic model predicts a smaller decrease than this.
    pub(crate) tolerance: f64,
}

/// Minimises `function` from `start`; `None` if it cannot be evaluated there. The second argument
/// of `function` asks for the curvature, too.
pub(crate) fn minimise(
    mut function: impl FnMut(&[f64], bool) -> Option<Evaluation>,
    start: &[f64],
    limits: &Limits<'_>,
) -> Option<Outcome> {
    let n = start.len();
    let mut at = clamp(start, limits);
    let first = function(&at, true)?;
    let (mut value, mut gradient) = (first.value, first.gradient);
    let mut curvature = first.curvature;
    let mut rounding = first.rounding;
    let mut met_failure = false;
    let mut fresh = true;
    let (mut iterations, mut converged) = (0, false);

    while iterations < limits.max_iterations {
        let step = newton_direction(&curvature, &gradient, &at, limits);
        let promised = -0.5 * dot(&step, &gradient);
        if promised < limits.tolerance.max(rounding) {
            converged = true;
            break;
        }
        met_failure = false;
        let is_hidden = promised < INSIGNIFICANT.max(SEVERAL * rounding);

        let renews = iterations < limits.renewed;
        let mut t = first_length(&step);
        let mut accepted = None;
        let lengths = if is_hidden { FEW_LENGTHS } else { LENGTHS };
        for _ in 0..lengths {
            let trial: Vec<f64> = at.iter().zip(&step).map(|(a, s)| a + t * s).collect();
            let trial = clamp(&trial, limits);
            let moved: Vec<f64> = trial.iter().zip(&at).map(|(t, a)| t - a).collect();
            let slope = dot(&moved, &gradient);
            let Some(evaluation) = function(&trial, renews) else {
                met_failure = true;
                t *= 0.25;
                continue;
            };
            // Cutting the step at the box can make it lead uphill; a shorter one is not cut.
            if slope < 0.0 && evaluation.value <= value + SUFFICIENT * slope {
                accepted = Some((trial, moved, evaluation));
                break;
            }
            // The minimum of the parabola through both values and the slope here.
            let excess = evaluation.value - value - slope;
            let shrink = if excess > 0.0 && slope < 0.0 {
                -0.5 * slope / excess
            } else {
                0.5
            };
            t *= shrink.clamp(0.1, 0.5);
        }

        let Some((trial, moved, evaluation)) = accepted else {
            if fresh || promised < SEVERAL * rounding {
                converged = is_hidden;
                break;
            }
            // No step along this curvature was accepted: only its diagonal is kept, doubled.
            for i in 0..n {
                for j in 0..n {
                    if i != j {
                        curvature[i * n + j] = 0.0;
                    }
                }
                curvature[i * n + i] *= 2.0;
            }
            fresh = true;
            iterations += 1;
            continue;
        };
        if renews {
            curvature = evaluation.curvature;
        } else {
            let pairs = evaluation.gradient.iter().zip(&gradient);
            let change: Vec<f64> = pairs.map(|(new, old)| new - old).collect();
            update(&mut curvature, &moved, &change);
        }
        (at, value, gradient) = (trial, evaluation.value, evaluation.gradient);
        rounding = evaluation.rounding;
        fresh = false;
        iterations += 1;
    }
    Some(Outcome {
        at,
        value,
        iterations,
        converged,
        met_failure,
    })
}

/// The quasi-Newton step on the variables that neither the gradient nor the step pushes out of the box.
fn newton_direction(
    curvature: &[f64],
    gradient: &[f64],
    at: &[f64],
    limits: &Limits<'_>,
) -> Vec<f64> {
    let leaves = |i: usize, direction: f64| {
        (at[i] <= limits.lower[i] && direction < 0.0)
            || (at[i] >= limits.upper[i] && direction > 0.0)
    };
    let mut free: Vec<usize> = (0..at.len())
        .filter(|&i| !leaves(i, -gradient[i]))
        .collect();
    loop {
        let step = newton_step(curvature, gradient, &free);
        let before = free.len();
        free.retain(|&i| !leaves(i, step[i]));
        if free.len() == before {
            return step;
        }
    }
}

/// The share of a step that moves no variable farther than [`LONGEST_STEP`].
fn first_length(step: &[f64]) -> f64 {
    let longest = step.iter().fold(0.0_f64, |a, s| a.max(s.abs()));
    (LONGEST_STEP / longest).min(1.0)
}

fn clamp(at: &[f64], limits: &Limits<'_>) -> Vec<f64> {
    at.iter()
        .zip(limits.lower.iter().zip(limits.upper))
        .map(|(a, (low, high))| a.clamp(*low, *high))
        .collect()
}

/// Solves B s = −g on the free variables, with a multiple of the diagonal added to B until it is
/// positive definite. Other variables stay.
fn newton_step(curvature: &[f64], gradient: &[f64], free: &[usize]) -> Vec<f64> {
    let n = gradient.len();
    let mut step = vec![0.0; n];
    let floor = 1e-8
        * (0..n)
            .map(|i| curvature[i * n + i].abs())
            .fold(1e-8, f64::max);
    let mut ridge = 1e-10;
    // Each round makes the diagonal dominate more; ten suffice for any symmetric matrix of use here.
    for _ in 0..10 {
        let of = |i: usize, j: usize| {
            let value = curvature[i * n + j];
            if i == j {
                value.abs().max(floor) * (1.0 + ridge)
            } else {
                value
            }
        };
        let matrix = LowerTriangle::from_columns(free.len(), |k, column| {
            column
                .iter_mut()
                .zip(&free[k..])
                .for_each(|(v, &i)| *v = of(i, free[k]));
        });
        let factor = Spd::factor(matrix).ok().filter(|factor| {
            let mut pivots = factor.pivots().zip(free);
            pivots.all(|(pivot, &i)| pivot * pivot > 1e-12 * of(i, i))
        });
        if let Some(factor) = factor {
            let mut solution: Vec<f64> = free.iter().map(|&i| -gradient[i]).collect();
            factor.solve(&mut solution);
            for (&i, s) in free.iter().zip(solution) {
                step[i] = s;
            }
            return step;
        }
        ridge = (ridge * 100.0).max(1e-4);
    }
    for &i in free {
        step[i] = -gradient[i] / curvature[i * n + i].abs().max(floor);
    }
    step
}

/// The BFGS update with Powell's damping: the matrix stays positive definite.
fn update(curvature: &mut [f64], moved: &[f64], change: &[f64]) {
    let n = moved.len();
    let expected: Vec<f64> = (0..n)
        .map(|i| dot(&curvature[i * n..(i + 1) * n], moved))
        .collect();
    let (along, before) = (dot(moved, change), dot(moved, &expected));
    if before.is_nan() || before <= 0.0 {
        return;
    }
    let keep = if along >= 0.2 * before {
        1.0
    } else {
        0.8 * before / (before - along)
    };
    let damped: Vec<f64> = change
        .iter()
        .zip(&expected)
        .map(|(c, e)| keep * c + (1.0 - keep) * e)
        .collect();
    let after = dot(moved, &damped);
    for i in 0..n {
        for j in 0..n {
            curvature[i * n + j] +=
                damped[i] * damped[j] / after - expected[i] * expected[j] / before;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rosenbrock's valley, undefined left of x = −1.5.
    fn rosenbrock(p: &[f64], _: bool) -> Option<Evaluation> {
        let (x, y) = (p[0], p[1]);
        if x < -1.5 {
            return None;
        }
        let bend = y - x * x;
        Some(Evaluation {
            value: (1.0 - x).powi(2) + 100.0 * bend * bend,
            gradient: vec![-2.0 * (1.0 - x) - 400.0 * x * bend, 200.0 * bend],
            curvature: vec![1.0, 0.0, 0.0, 1.0],
            ..Evaluation::default()
        })
    }

    fn limits<'a>(lower: &'a [f64], upper: &'a [f64]) -> Limits<'a> {
        Limits {
            lower,
            upper,
            max_iterations: 200,
            renewed: 0,
            tolerance: 1e-14,
        }
    }

    #[test]
    fn finds_a_free_minimum() {
        let outcome = minimise(rosenbrock, &[-1.2, 1.0], &limits(&[-5.0; 2], &[5.0; 2])).unwrap();
        assert!(outcome.converged && outcome.iterations < 100, "{outcome:?}");
        assert!((outcome.at[0] - 1.0).abs() < 1e-6 && (outcome.at[1] - 1.0).abs() < 1e-6);
    }

    #[test]
    fn finds_a_minimum_on_the_boundary() {
        // With x ≤ 0.5 the minimum is at (0.5, 0.25): the slope in x there is −1.
        let outcome = minimise(rosenbrock, &[-1.2, 1.0], &limits(&[-5.0; 2], &[0.5, 5.0])).unwrap();
        assert!(outcome.converged, "{outcome:?}");
        assert_eq!(outcome.at[0], 0.5);
        assert!((outcome.at[1] - 0.25).abs() < 1e-6);
    }

    #[test]
    fn a_start_that_cannot_be_evaluated_is_refused() {
        assert!(minimise(rosenbrock, &[-2.0, 0.0], &limits(&[-5.0; 2], &[5.0; 2])).is_none());
    }

    /// Rosenbrock's function with its Hessian, where that is positive definite.
    fn with_hessian(at: &[f64], _: bool) -> Option<Evaluation> {
        let [x, y] = at else { return None };
        let evaluation = rosenbrock(at, true)?;
        let corner = 2.0 - 400.0 * (y - 3.0 * x * x);
        let curvature = vec![
            corner.max(800.0 * x * x + 1.0),
            -400.0 * x,
            -400.0 * x,
            200.0,
        ];
        Some(Evaluation {
            curvature,
            ..evaluation
        })
    }

    /// When only the gradient's error is left, the search ends soon and counts as converged.
    #[test]
    fn a_wrong_slope_at_the_minimum_costs_few_evaluations() {
        let mut evaluations = 0;
        let bowl = |at: &[f64], _: bool| {
            evaluations += 1;
            Some(Evaluation {
                value: at[0] * at[0],
                gradient: vec![2.0 * at[0] + 0.02],
                curvature: vec![2.0],
                ..Evaluation::default()
            })
        };
        let limits = Limits {
            tolerance: 1e-6,
            ..limits(&[-5.0], &[5.0])
        };
        let outcome = minimise(bowl, &[0.0], &limits).unwrap();
        assert!(outcome.converged && outcome.at == [0.0], "{outcome:?}");
        assert_eq!(evaluations, 1 + FEW_LENGTHS);
    }

    /// Values that scatter by their rounding errors do not keep the search from ending.
    #[test]
    fn a_decrease_below_the_rounding_ends_the_search() {
        let scatter = 1e-2;
        for amplitude in [1.0, 10.0, 1000.0] {
            let mut evaluations = 0;
            let rough = |at: &[f64], _: bool| {
                evaluations += 1;
                // A chaotic function of the last digits of the place.
                let noise = (1e9 * at[0]).sin();
                Some(Evaluation {
                    value: amplitude * at[0] * at[0] + scatter * noise,
                    gradient: vec![2.0 * amplitude * at[0] + 0.1 * amplitude.sqrt() * noise],
                    curvature: vec![2.0 * amplitude],
                    rounding: scatter,
                    ..Evaluation::default()
                })
            };
            let limits = Limits {
                tolerance: 1e-6,
                ..limits(&[-5.0], &[5.0])
            };
            let outcome = minimise(rough, &[3.0], &limits).unwrap();
            assert!(outcome.converged, "{outcome:?}");
            assert!(outcome.value < 10.0 * scatter, "{outcome:?}");
            assert!(evaluations < 15, "{evaluations}");
        }
    }

    #[test]
    fn a_curvature_that_is_renewed_saves_iterations() {
        let (lower, upper) = ([-5.0; 2], [5.0; 2]);
        let iterations = |renewed| {
            let limits = Limits {
                renewed,
                ..limits(&lower, &upper)
            };
            let outcome = minimise(with_hessian, &[-1.2, 1.0], &limits).unwrap();
            assert!(outcome.converged && (outcome.at[0] - 1.0).abs() < 1e-6);
            outcome.iterations
        };
        let (never, always) = (iterations(0), iterations(200));
        assert!(3 * always < 2 * never, "{always} {never}");
    }
}
