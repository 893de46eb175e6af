//! Numbers as text for people: the same on every machine, with a true minus sign and no false digits.
//!
//! A number that is not finite is shown as [`MISSING`].

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

/// Shown in place of a number that is not known.
pub const MISSING: &str = "–";

/// `value` to `digits` significant digits.
///
/// Integers are never cut (11683 stays 11 683 with three digits); very large and very small numbers
/// become powers of ten.
#[must_use]
pub fn significant(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return MISSING.to_owned();
    }
    if value == 0.0 {
        return "0".to_owned();
    }
    let digits = digits.max(1);
    let scientific = format!("{:.*e}", digits - 1, value);
    // The exponent of the rounded number: 9.996 to three digits is 10.0, not 10.00.
    let (mantissa, exponent) = scientific.split_once('e').unwrap_or((&scientific, "0"));
    let exponent: i32 = exponent.parse().unwrap_or(0);
    if !(-4..=8).contains(&exponent) {
        let power = power_of_ten(exponent);
        return format!("{} × {power}", mantissa.replace('-', "−"));
    }
    let decimals = (digits as i32 - 1 - exponent).max(0) as usize;
    fixed(value, decimals)
}

/// A power of ten: `10⁻⁵`.
#[must_use]
pub fn power_of_ten(exponent: i32) -> String {
    let digits = exponent.to_string();
    format!("10{}", digits.chars().map(superscript).collect::<String>())
}

/// `value` with a fixed number of decimals.
#[must_use]
pub fn fixed(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return MISSING.to_owned();
    }
    let text = format!("{:.*}", decimals, value.abs());
    let (whole, fraction) = text.split_once('.').unwrap_or((&text, ""));
    // A number that rounds to zero has no sign.
    let negative = value < 0.0 && text.bytes().any(|b| (b'1'..=b'9').contains(&b));
    let mut out = String::with_capacity(text.len() + 8);
    if negative {
        out.push('−');
    }
    out.push_str(&group(whole));
    if !fraction.is_empty() {
        out.push('.');
        out.push_str(fraction);
    }
    out
}

/// `value` with as many of the `decimals` as it needs: zeros at the end are left out.
#[must_use]
pub fn shortest(value: f64, decimals: RangeInclusive<usize>) -> String {
    let mut text = fixed(value, *decimals.end());
    let Some(point) = text.find('.') else {
        return text;
    };
    while text.len() > point + 1 + decimals.start() && text.ends_with('0') {
        text.pop();
    }
    if text.ends_with('.') {
        text.pop();
    }
    text
}

/// A difference with its sign; `±` before one that rounds to zero.
#[must_use]
pub fn signed(value: f64, decimals: usize) -> String {
    let text = fixed(value, decimals);
    let is_zero = text.bytes().all(|byte| matches!(byte, b'0' | b'.'));
    match value {
        _ if !value.is_finite() => text,
        _ if is_zero => format!("±{text}"),
        value if value < 0.0 => text,
        _ => format!("+{text}"),
    }
}

/// `value` to `digits` significant digits with its unit, which may be empty.
#[must_use]
pub fn with_unit(value: f64, digits: usize, unit: &str) -> String {
    format!("{} {unit}", significant(value, digits))
        .trim_end()
        .to_owned()
}

/// Values with their units in a column: those of the same unit have the same decimals, so that the largest has `digits`
/// significant digits, less zeros at the end of all. A value that is zero within 10⁻⁹ of the largest is shown as 0, and
/// another one that would vanish has three significant digits.
#[must_use]
pub fn column(values: &[(f64, &str)], digits: usize) -> Vec<String> {
    let is_zero = |text: &str| !text.bytes().any(|b| (b'1'..=b'9').contains(&b));
    let aligned = |value: f64, largest: f64, decimals: usize| {
        let text = fixed(value, decimals);
        let negligible = value.abs() <= 1e-9 * largest;
        match is_zero(&text) && value.is_finite() {
            true if negligible => Some("0".to_owned()),
            true => None,
            false => Some(text),
        }
    };
    let mut of_units: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for &(value, unit) in values {
        of_units.entry(unit).or_default().push(value);
    }
    // The largest value and the decimals of a unit.
    let format = |of_unit: &Vec<f64>| {
        let sizes = of_unit.iter().map(|v| v.abs()).filter(|v| v.is_finite());
        let largest = sizes.fold(0.0, f64::max);
        // Powers of ten take the place of very large and very small numbers.
        let exponent = Some(largest.log10().floor()).filter(|e| (-4.0..=8.0).contains(e));
        let decimals = exponent.map(|exponent| {
            let decimals = (digits as f64 - 1.0 - exponent).max(0.0) as usize;
            let texts = of_unit.iter();
            let texts = texts.filter_map(|value| aligned(*value, largest, decimals));
            let used = texts.map(|text| {
                let fraction = text.split_once('.').map_or("", |(_, fraction)| fraction);
                fraction.trim_end_matches('0').len()
            });
            used.max().unwrap_or(0)
        });
        (largest, decimals)
    };
    let formats = of_units
        .iter()
        .map(|(unit, of_unit)| (*unit, format(of_unit)));
    let formats: BTreeMap<&str, (f64, Option<usize>)> = formats.collect();
    let text = |&(value, unit): &(f64, &str)| {
        let (largest, decimals) = formats[unit];
        let number = match decimals.map(|decimals| aligned(value, largest, decimals)) {
            Some(Some(text)) => text,
            Some(None) => significant(value, 3),
            None => significant(value, digits),
        };
        format!("{number} {unit}").trim_end().to_owned()
    };
    values.iter().map(text).collect()
}

/// Significant digits with which both ends of an interval differ from the estimate, at least three.
#[must_use]
pub fn digits_of(value: f64, interval: Option<(f64, f64)>) -> usize {
    let Some((low, high)) = interval else {
        return 3;
    };
    let differ = |digits: &usize| {
        let [low, value, high] = [low, value, high].map(|value| significant(value, *digits));
        low != value && value != high
    };
    (3..7).find(differ).unwrap_or(3)
}

/// An interval: `[1.49; 1.53]`.
#[must_use]
pub fn interval((low, high): (f64, f64), digits: usize) -> String {
    format!(
        "[{}; {}]",
        significant(low, digits),
        significant(high, digits)
    )
}

/// An estimate with its unit and its interval, to the digits that [tell them apart](digits_of):
/// `1.51 µm [1.49; 1.53]`.
#[must_use]
pub fn estimate(value: f64, ends: Option<(f64, f64)>, unit: &str) -> String {
    let digits = digits_of(value, ends);
    let value = with_unit(value, digits, unit);
    match ends {
        Some(ends) => format!("{value} {}", interval(ends, digits)),
        None => value,
    }
}

/// The number that is nearest to `value` among those with `digits` significant digits, for programs and logs.
#[must_use]
pub fn rounded(value: f64, digits: usize) -> f64 {
    let text = format!("{:.*e}", digits.saturating_sub(1), value);
    text.parse().unwrap_or(value)
}

/// A count, with its thousands grouped.
#[must_use]
pub fn count(value: u64) -> String {
    group(&value.to_string())
}

/// A time in seconds, for a column of seconds: to three digits from one second on and to the millisecond below.
#[must_use]
pub fn seconds(value: f64) -> String {
    if value.abs() < 1.0 {
        fixed(value, 3)
    } else {
        significant(value, 3)
    }
}

/// A time of at least a second in seconds, and a shorter one in ms or µs, to three digits.
#[must_use]
pub fn short_time(seconds: f64) -> String {
    match seconds.abs() {
        s if !(s < 1.0 && s > 0.0) => with_unit(seconds, 3, "s"),
        s if s >= 1e-3 => with_unit(1e3 * seconds, 3, "ms"),
        _ => with_unit(1e6 * seconds, 3, "µs"),
    }
}

/// A length of time in the unit that suits it, from seconds to days.
#[must_use]
pub fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 90.0 => format!("{s:.0} s"),
        s if s < 5400.0 => format!("{:.0} min", s / 60.0),
        s if s < 172_800.0 => format!("{:.1} h", s / 3600.0),
        s => format!("{:.1} d", s / 86_400.0),
    }
}

/// A rate of samples, per second or, when it is slow, per hour.
#[must_use]
pub fn rate(per_second: f64) -> String {
    match per_second {
        r if r >= 10.0 || r <= 0.0 => format!("{r:.0} samples per second"),
        r if r >= 0.1 => format!("{r:.2} samples per second"),
        r => format!("{:.1} samples per hour", 3600.0 * r),
    }
}

/// A share of one as a percentage with one decimal.
#[must_use]
pub fn percent(share: f64) -> String {
    percentage(fixed(100.0 * share, 1))
}

/// A relative difference as a percentage with its sign.
#[must_use]
pub fn signed_percent(share: f64) -> String {
    percentage(signed(100.0 * share, 1))
}

fn percentage(number: String) -> String {
    match number.as_str() {
        MISSING => number,
        _ => number + " %",
    }
}

/// Groups five and more digits by thousands, with narrow no-break spaces.
fn group(digits: &str) -> String {
    if digits.len() < 5 {
        return digits.to_owned();
    }
    let mut out = String::with_capacity(digits.len() * 2);
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push('\u{202f}');
        }
        out.push(digit);
    }
    out
}

fn superscript(c: char) -> char {
    match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        '0' | '4'..='9' => char::from_u32(0x2070 + (c as u32 - '0' as u32)).unwrap_or(c),
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn significant_digits_follow_the_rounded_number() {
        assert_eq!(significant(9.996, 3), "10.0");
        assert_eq!(significant(0.012_345, 3), "0.0123");
        assert_eq!(significant(-2.5, 3), "−2.50");
        assert_eq!(significant(11683.0, 3), "11\u{202f}683");
        assert_eq!(significant(0.0, 3), "0");
        assert_eq!(significant(1.234e-7, 3), "1.23 × 10⁻⁷");
        assert_eq!(significant(-4.56e12, 2), "−4.6 × 10¹²");
        assert_eq!(significant(f64::NAN, 3), MISSING);
        assert_eq!(significant(f64::INFINITY, 3), MISSING);
    }

    #[test]
    fn rounding_to_zero_drops_the_sign() {
        assert_eq!(fixed(-0.004, 2), "0.00");
        assert_eq!(fixed(-0.004, 3), "−0.004");
        assert_eq!(signed_percent(-0.0001), "±0.0 %");
    }

    #[test]
    fn zeros_at_the_end_are_left_out_down_to_the_least_decimals() {
        assert_eq!(shortest(1.2, 0..=4), "1.2");
        assert_eq!(shortest(30.0, 0..=4), "30");
        assert_eq!(shortest(30.0, 2..=3), "30.00");
        assert_eq!(shortest(-0.028, 2..=3), "−0.028");
        assert_eq!(shortest(f64::NAN, 2..=3), MISSING);
    }

    #[test]
    fn a_column_has_one_precision_for_each_unit() {
        let shown = |values: &[(f64, &str)]| column(values, 5);
        let design = [(0.000_464_46, ""), (0.52, ""), (1.25, ""), (0.06, "mm")];
        let expected = ["0.0005", "0.5200", "1.2500", "0.06 mm"];
        assert_eq!(shown(&design), expected);
        let margins = [
            (3.268e-13, "mm"),
            (0.45, "mm"),
            (-0.033, "mm"),
            (1306.4, "MPa"),
        ];
        let expected = ["0 mm", "0.450 mm", "−0.033 mm", "1306.4 MPa"];
        assert_eq!(shown(&margins), expected);
        // A value that is not zero is not shown as zero.
        assert_eq!(shown(&[(250.0, ""), (1.2e-4, "")]), ["250", "0.000120"]);
        assert_eq!(shown(&[(0.0, ""), (f64::NAN, "")]), ["0", MISSING]);
        assert_eq!(shown(&[(2e12, "Pa")]), ["2.0000 × 10¹² Pa"]);
    }

    #[test]
    fn rounding_keeps_significant_digits() {
        assert_eq!(rounded(123.456_78, 6), 123.457);
        assert_eq!(rounded(-0.000_123_456_78, 6), -0.000_123_457);
        assert_eq!(rounded(0.0, 6), 0.0);
        assert_eq!(rounded(1e-320, 6), 1e-320);
        assert_eq!(rounded(f64::INFINITY, 6), f64::INFINITY);
        assert!(rounded(f64::NAN, 6).is_nan());
    }

    #[test]
    fn counts_and_times_are_grouped() {
        assert_eq!(count(999), "999");
        assert_eq!(count(3000), "3000");
        assert_eq!(count(90_000), "90\u{202f}000");
        assert_eq!(count(1_234_567), "1\u{202f}234\u{202f}567");
        assert_eq!(seconds(0.0214), "0.021");
        assert_eq!(seconds(1234.5), "1234");
        assert_eq!(short_time(8.6e-6), "8.60 µs");
        assert_eq!(short_time(0.25), "250 ms");
        assert_eq!(short_time(f64::NAN), "– s");
    }

    #[test]
    fn differences_have_a_sign() {
        assert_eq!(signed(0.1234, 2), "+0.12");
        assert_eq!(signed(-0.1234, 2), "−0.12");
        assert_eq!(signed_percent(0.187), "+18.7 %");
        assert_eq!(signed_percent(-0.053), "−5.3 %");
        assert_eq!(signed_percent(f64::NAN), MISSING);
    }

    #[test]
    fn an_interval_never_vanishes_in_the_digits() {
        let of = |value: f64, half: f64| estimate(value, Some((value - half, value + half)), "µm");
        assert_eq!(of(1.49, 0.01), "1.49 µm [1.48; 1.50]");
        assert_eq!(of(1.49, 0.002), "1.490 µm [1.488; 1.492]");
        assert_eq!(of(f64::NAN, 0.1), "– µm [–; –]");
        assert_eq!(estimate(2.0, None, ""), "2.00");
    }
}
