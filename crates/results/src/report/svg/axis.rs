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

/// The value of a tick and its label.
pub(crate) type Tick = (f64, String);

/// Gap between the labels of evenly spaced ticks, px.
const WIDE: f64 = 22.0;
/// Gap between the labels 1, 2 and 5 of decades, px.
const NARROW: f64 = 6.0;

/// A range that is mapped onto 0 to 1.
#[derive(Debug, Clone)]
pub(crate) struct Ruler {
    scale: Scale,
    low: f64,
    high: f64,
}

impl Ruler {
    /// A ruler over `low..=high`, longer at both ends by the share `room`. The room does not cross zero.
    ///
    /// Invariant: the range is finite and not empty, whatever finite values come in.
    pub(crate) fn new(scale: Scale, low: f64, high: f64, room: f64) -> Self {
        let (low, high) = (low.min(high), low.max(high));
        let size = low.abs().max(high.abs());
        // Equal values, or values that differ by rounding only, are shown in the middle.
        let is_flat = high - low <= 1e-9 * size || high - low < 1e-90;
        if scale == Scale::Log && low > 0.0 {
            let ratio = if is_flat {
                1.1
            } else {
                (high / low).powf(room)
            };
            return Self {
                scale,
                low: low / ratio,
                high: high * ratio,
            };
        }
        let more = match is_flat {
            false => room * (high - low),
            true if size < 1e-80 => 1.0,
            true => 0.1 * size,
        };
        let moved = |end: f64, to: f64| if is_flat || end * to > 0.0 { to } else { 0.0 };
        Self {
            scale: match scale {
                Scale::Log => Scale::Linear,
                other => other,
            },
            low: moved(low, low - more),
            high: moved(high, high + more),
        }
    }

    /// The position of a value, 0 at the low end and 1 at the high end.
    pub(crate) fn position(&self, value: f64) -> f64 {
        match self.scale {
            Scale::Linear | Scale::Whole => (value - self.low) / (self.high - self.low),
            Scale::Log => (value / self.low).ln() / (self.high / self.low).ln(),
        }
    }

    /// The ticks of an axis of `length` px, ascending. `extent` is a label's length along the axis, px.
    ///
    /// They are the densest of the candidates whose labels do not touch; at least three, unless so many labels do not
    /// fit.
    pub(crate) fn ticks(&self, length: f64, extent: impl Fn(&str) -> f64) -> Vec<Tick> {
        let fits = |ticks: &[Tick], gap: f64| {
            ticks.windows(2).all(|two| {
                let [from, to] = [0, 1].map(|i| length * self.position(two[i].0));
                let extents = extent(&two[0].1) + extent(&two[1].1);
                to - from >= 0.5 * extents + gap
            })
        };
        let mut best = Vec::new();
        for (ticks, gap) in self.candidates() {
            if ticks.len() > best.len() && fits(&ticks, gap) {
                best = ticks;
            }
            if best.len() >= 3 {
                break;
            }
        }
        best
    }

    /// Candidate ticks, each list with the gap that its labels need: ticks of decades from dense to sparse, then even
    /// ticks.
    fn candidates(&self) -> impl Iterator<Item = (Vec<Tick>, f64)> {
        let is_log = self.scale == Scale::Log;
        let dense = (&[1.0, 2.0, 3.0, 5.0, 7.0][..], 1, WIDE);
        let usual = [&[1.0, 2.0, 5.0][..], &[1.0, 3.0]].map(|mantissas| (mantissas, 1, NARROW));
        let sparse = [1, 2, 3, 4, 5, 10, 20, 50, 100].map(|every| (&[1.0][..], every, NARROW));
        let decades = [dense].into_iter().chain(usual).chain(sparse);
        let decades = decades
            .filter(move |_| is_log)
            .map(|(mantissas, every, gap)| (self.decades(mantissas, every), gap));
        let span = self.high - self.low;
        let power = span.log10().floor() as i32 - 2;
        let steps = (power..power + 4).flat_map(|e| [1.0, 2.0, 2.5, 5.0].map(|m| (m, e)));
        let is_whole = self.scale == Scale::Whole;
        let steps = steps.filter(move |&(m, e)| {
            let step = m * 10f64.powi(e);
            !is_whole || (step >= 1.0 && step.fract() == 0.0)
        });
        let even = steps.map(|(mantissa, exponent)| (self.even(mantissa, exponent), WIDE));
        decades.chain(even)
    }

    /// Every multiple of the step `mantissa` · 10^`exponent`.
    fn even(&self, mantissa: f64, exponent: i32) -> Vec<Tick> {
        let step = mantissa * 10f64.powi(exponent);
        // A small tolerance, so that 3 · 0.1 is a tick of a range up to 0.3.
        let first = (self.low / step - 1e-6).ceil();
        let count = (self.high / step + 1e-6).floor() - first;
        // 0.25 needs one more decimal than 0.2.
        let decimals = (i32::from(mantissa == 2.5) - exponent).clamp(0, 17) as usize;
        let ticks = (0..=count.clamp(0.0, 1000.0) as usize).map(|i| (first + i as f64) * step);
        ticks.map(|tick| (tick, label(tick, decimals))).collect()
    }

    /// The mantissas in every `every`-th decade.
    fn decades(&self, mantissas: &[f64], every: i32) -> Vec<Tick> {
        let (bottom, top) = (self.low.log10().floor(), self.high.log10().ceil());
        let decades = (bottom as i32..=top as i32).filter(|e| e.rem_euclid(every) == 0);
        let ticks = decades.flat_map(|e| mantissas.iter().map(move |m| (m * 10f64.powi(e), e)));
        // All labels have the same form.
        let as_powers = mantissas.len() == 1 && (bottom < -4.0 || top > 8.0);
        let slack = 1.0 + 1e-9;
        ticks
            .filter(|(tick, _)| self.low <= tick * slack && *tick <= self.high * slack)
            .map(|(tick, exponent)| match as_powers {
                true => (tick, number::power_of_ten(exponent)),
                false => (tick, number::significant(tick, 1)),
            })
            .collect()
    }
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

    /// The labels of an axis of 250 px, with letters of 7 px.
    fn labels(scale: Scale, low: f64, high: f64) -> Vec<String> {
        let ruler = Ruler::new(scale, low, high, 0.04);
        let ticks = ruler.ticks(250.0, |label| 7.0 * label.chars().count() as f64);
        for (tick, _) in &ticks {
            let at = ruler.position(*tick);
            assert!((-1e-5..=1.0 + 1e-5).contains(&at), "{tick} lies at {at}");
        }
        ticks.into_iter().map(|(_, label)| label).collect()
    }

    #[test]
    fn ticks_are_round() {
        let of = labels;
        assert_eq!(of(Scale::Linear, 0.49, 42.7), ["0", "10", "20", "30", "40"]);
        assert_eq!(of(Scale::Linear, 0.1, 0.95), ["0.2", "0.4", "0.6", "0.8"]);
        assert_eq!(of(Scale::Whole, 19.0, 21.0), ["19", "20", "21"]);
        assert_eq!(of(Scale::Log, 1.4, 42.7), ["2", "5", "10", "20"]);
        let wide = ["1", "10", "100", "1000", "10\u{202f}000"];
        assert_eq!(of(Scale::Log, 0.9, 20_000.0), wide);
        assert_eq!(of(Scale::Log, 1e-9, 1e-6), ["10⁻⁹", "10⁻⁸", "10⁻⁷", "10⁻⁶"]);
    }

    #[test]
    fn an_axis_fits_its_data_and_has_three_labels() {
        for scale in [Scale::Linear, Scale::Log] {
            for low in [1.0, 1.02, 2.1, 4.99, 9.7] {
                for ratio in [1.001, 1.3, 2.0, 2.4, 7.0, 9.9, 30.0, 1e3, 1e6, 1e12] {
                    let ruler = Ruler::new(scale, low, ratio * low, 0.04);
                    let ends = [low, ratio * low].map(|end| ruler.position(end));
                    assert!((0.0..=0.04).contains(&ends[0]), "{low} × {ratio}: {ends:?}");
                    assert!((0.96..1.0).contains(&ends[1]), "{low} × {ratio}: {ends:?}");
                    let found = labels(scale, low, ratio * low);
                    assert!(found.len() >= 3, "{scale:?} {low} × {ratio}: {found:?}");
                }
            }
        }
    }

    #[test]
    fn room_does_not_cross_zero() {
        let ends = |low, high| {
            let ruler = Ruler::new(Scale::Linear, low, high, 0.1);
            (ruler.low, ruler.high)
        };
        assert_eq!(ends(0.0, 10.0), (0.0, 11.0));
        assert_eq!(ends(0.5, 10.5), (0.0, 11.5));
        assert_eq!(ends(-10.0, 0.0), (-11.0, 0.0));
        assert_eq!(ends(-10.0, 10.0), (-12.0, 12.0));
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
            for scale in [Scale::Linear, Scale::Whole, Scale::Log] {
                let ruler = Ruler::new(scale, low, high, 0.04);
                assert!(ruler.low.is_finite() && ruler.high.is_finite());
                assert!(ruler.low < ruler.high, "{low} {high}: {ruler:?}");
                for value in [low, high] {
                    assert!((0.0..=1.0).contains(&ruler.position(value)), "{ruler:?}");
                }
                let ticks = ruler.ticks(250.0, |_| 12.0);
                assert!(ticks.len() <= 12, "{low} {high}: {ticks:?}");
            }
        }
    }
}
