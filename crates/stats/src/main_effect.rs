//! First-order Sobol' indices from given samples, without further evaluations.
//!
//! The samples are sorted by one input and cut into classes of equal size. The index is the share of the output's
//! variance between the classes, less the share expected by chance (Kelley's ε²).
//!
//! Reference: E. Plischke, E. Borgonovo, C. L. Smith, "Global sensitivity measures from given data", Eur. J. Oper. Res.
//! 226 (2013) 536–550.

/// The fewest samples of [`main_effect`].
pub const MAIN_EFFECT_MIN_SAMPLES: usize = 100;

/// Samples in a class, for up to 1200 samples; more samples are cut into a hundred larger classes.
const CLASS: usize = 12;

/// The share of the variance of `output` that `input` explains by itself, from 0 to 1: the first-order Sobol' index,
/// also of inputs that are correlated. The standard error is about 2 √(S (1 − S)/n) for an index S from n samples.
/// `None` for lists of different lengths, fewer than [`MAIN_EFFECT_MIN_SAMPLES`], or an output that is constant or not
/// finite.
#[must_use]
pub fn main_effect(input: &[f64], output: &[f64]) -> Option<f64> {
    let n = output.len();
    if n < MAIN_EFFECT_MIN_SAMPLES || input.len() != n {
        return None;
    }
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&a, &b| input[a].total_cmp(&input[b]));
    let (mean, sd) = crate::mean_sd(output).ok()?;
    let total = (n - 1) as f64 * sd * sd;
    if total == 0.0 {
        return None;
    }
    // Small classes follow the conditional mean closely; a hundred of them leave little to chance.
    let classes = (n / CLASS).clamp(2, 100);
    let between: f64 = (0..classes)
        .map(|class| {
            let members = &order[class * n / classes..(class + 1) * n / classes];
            let sum: f64 = members.iter().map(|&i| output[i] - mean).sum();
            sum * sum / members.len() as f64
        })
        .sum();
    let within = (total - between) / (n - classes) as f64;
    Some(((between - (classes - 1) as f64 * within) / total).clamp(0.0, 1.0))
}
