//! Ranges, ticks and tick labels.

use crate::number;

/// The scale of an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scale {
    /// In proportion.
    Linear,
    /// Linear, with ticks at whole numbers only.
    Whole,
    /// Decadic; only for positive values.
    Log,
}

/// A range with its ticks, mapped onto pixels.
#[derive(Debug, Clone)]
pub(crate) struct Ruler {
    scale: Scale,
    low: f64,
    high: f64,
    /// Tick positions and labels, ascending.
    pub(crate) ticks: Vec<(f64, String)>,
}

impl Ruler {
    /// A ruler over `low..=high`, widened to whole ticks, with about `wanted` of them.
    ///
    /// Invariant: the range is finite and not empty, whatever finite values come in.
    pub(crate) fn new(scale: Scale, low: f64, high: f64, wanted: usize) -> Self {
        let (low, high) = (low.min(high), low.max(high));
        match scale {
            Scale::Log if low > 0.0 => Self::log(low, high, wanted),
            _ => Self::linear(low, high, wanted, scale == Scale::Whole),
        }
    }

    pub(crate) fn range(&self) -> (f64, f64) {
        (self.low, self.high)
    }

    /// The position of a value, 0 at the low end and 1 at the high end.
    pub(crate) fn position(&self, value: f64) -> f64 {
        match self.scale {
            Scale::Linear | Scale::Whole => (value - self.low) / (self.high - self.low),
            Scale::Log => (value / self.low).ln() / (self.high / self.low).ln(),
        }
    }

    fn linear(low: f64, high: f64, wanted: usize, whole: bool) -> Self {
        let (mut low, mut high) = (low, high);
        let size = low.abs().max(high.abs());
        // Equal values, or values that differ by rounding only: show the value in the middle.
        if high - low <= 1e-9 * size || high - low < 1e-90 {
            let half = if size < 1e-80 { 1.0 } else { 0.1 * size };
            (low, high) = (low - half, high + half);
        }
        let raw = (high - low) / wanted.max(2) as f64;
        let power = 10f64.powf(raw.log10().floor());
        let power = if whole { power.max(1.0) } else { power };
        let step = [1.0, 2.0, 2.5, 5.0, 10.0]
            .into_iter()
            .map(|m| m * power)
            .find(|step| *step >= raw * (1.0 - 1e-9) && !(whole && step.fract() != 0.0))
            .unwrap_or(10.0 * power);
        // A hair of slack, so that 0.3 / 0.1 does not ask for one more tick.
        let first = (low / step + 1e-6).floor();
        let last = (high / step - 1e-6).ceil();
        let decimals = decimals_of(step);
        let count = (last - first).round() as usize;
        let ticks: Vec<(f64, String)> = (0..=count)
            .map(|i| (first + i as f64) * step)
            .map(|tick| (tick, label(tick, decimals)))
            .collect();
        Self {
            scale: Scale::Linear,
            low: first * step,
            high: last * step,
            ticks,
        }
    }

    fn log(low: f64, high: f64, wanted: usize) -> Self {
        // Candidates 1, 2, 5 in every decade from below `low` to above `high`.
        let bottom = low.log10().floor() as i32 - 1;
        let top = high.log10().ceil() as i32 + 1;
        let marks: Vec<(i32, f64, f64)> = (bottom..=top)
            .flat_map(|e| [1.0, 2.0, 5.0].map(|m| (e, m, m * 10f64.powi(e))))
            .collect();
        let below = |v: f64| v <= low * (1.0 + 1e-9);
        let above = |v: f64| v >= high * (1.0 - 1e-9);
        let from = marks.iter().rposition(|m| below(m.2)).unwrap_or(0);
        let to = marks
            .iter()
            .position(|m| above(m.2))
            .unwrap_or(marks.len() - 1);
        let to = if to > from {
            to
        } else {
            (from + 1).min(marks.len() - 1)
        };
        let span = &marks[from..=to];
        let decades = f64::log10(span[span.len() - 1].2 / span[0].2);
        let every = (decades / wanted.max(2) as f64).ceil().max(1.0) as i32;
        let ticks = span
            .iter()
            .filter(|(e, m, _)| span.len() <= wanted + 3 || (*m == 1.0 && e.rem_euclid(every) == 0))
            .map(|&(_, _, v)| (v, number::significant(v, 1)))
            .collect();
        Self {
            scale: Scale::Log,
            low: span[0].2,
            high: span[span.len() - 1].2,
            ticks,
        }
    }
}

/// Decimals that tell ticks of this step apart.
fn decimals_of(step: f64) -> usize {
    let digits = -(step.log10().floor());
    // 0.25 needs one more decimal than 0.2.
    let extra = (step / 10f64.powf(-digits) - 2.5).abs() < 1e-6;
    (digits + if extra { 1.0 } else { 0.0 }).clamp(0.0, 17.0) as usize
}

fn label(tick: f64, decimals: usize) -> String {
    if tick != 0.0 && (decimals > 6 || tick.abs() >= 1e9) {
        number::significant(tick, 3)
    } else {
        number::fixed(tick, decimals)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(ruler: &Ruler) -> Vec<&str> {
        ruler
            .ticks
            .iter()
            .map(|(_, label)| label.as_str())
            .collect()
    }

    #[test]
    fn linear_ticks_are_round_and_hold_the_data() {
        let ruler = Ruler::new(Scale::Linear, 0.49, 42.7, 5);
        assert_eq!(labels(&ruler), ["0", "10", "20", "30", "40", "50"]);
        let ruler = Ruler::new(Scale::Linear, -5.0, 0.0, 5);
        assert_eq!(labels(&ruler), ["−5", "−4", "−3", "−2", "−1", "0"]);
        let ruler = Ruler::new(Scale::Linear, 0.1, 0.95, 4);
        assert_eq!(labels(&ruler), ["0.00", "0.25", "0.50", "0.75", "1.00"]);
        let ruler = Ruler::new(Scale::Whole, 19.0, 21.0, 12);
        assert_eq!(labels(&ruler), ["19", "20", "21"]);
        let ruler = Ruler::new(Scale::Whole, 17.0, 42.0, 12);
        assert_eq!(labels(&ruler).first(), Some(&"15"));
    }

    #[test]
    fn log_ticks_are_one_two_five_or_decades() {
        let ruler = Ruler::new(Scale::Log, 0.49, 42.7, 6);
        assert_eq!(
            labels(&ruler),
            ["0.2", "0.5", "1", "2", "5", "10", "20", "50"]
        );
        let ruler = Ruler::new(Scale::Log, 0.3, 90_000.0, 6);
        assert_eq!(
            labels(&ruler),
            ["1", "10", "100", "1000", "10\u{202f}000", "100\u{202f}000"]
        );
    }

    #[test]
    fn no_finite_range_breaks_a_ruler() {
        for (low, high) in [
            (0.0, 0.0),
            (3.0, 3.0),
            (1e99, 1e99),
            (-1e99, 1e99),
            (1e-99, 2e-99),
            (1.0, 1.0 + 1e-15),
        ] {
            for scale in [Scale::Linear, Scale::Log] {
                let ruler = Ruler::new(scale, low, high, 5);
                let (a, b) = ruler.range();
                assert!(
                    a.is_finite() && b.is_finite() && a < b,
                    "{low} {high}: {a} {b}"
                );
                let size = high.abs().max(1e-90);
                assert!(
                    a <= low + 1e-6 * size && b >= high - 1e-6 * size,
                    "{low} {high}: {a} {b}"
                );
                assert!(
                    (2..=20).contains(&ruler.ticks.len()),
                    "{low} {high}: {:?}",
                    ruler.ticks
                );
                assert!((0.0..=1.0).contains(&ruler.position(0.5 * (a + b))));
            }
        }
    }
}
