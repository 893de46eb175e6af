//! Numbers as text: the same on every machine, with a true minus sign and no false digits.

/// Shown in place of a number that is not known.
pub(crate) const MISSING: &str = "–";

/// `value` to `digits` significant digits.
///
/// Integers are never cut (11683 stays 11 683 with three digits); very large and very small numbers
/// become powers of ten.
pub(crate) fn significant(value: f64, digits: usize) -> String {
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
        let power: String = exponent.to_string().chars().map(superscript).collect();
        return format!("{} × 10{power}", mantissa.replace('-', "−"));
    }
    let decimals = (digits as i32 - 1 - exponent).max(0) as usize;
    fixed(value, decimals)
}

/// `value` with a fixed number of decimals.
pub(crate) fn fixed(value: f64, decimals: usize) -> String {
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

/// A count.
pub(crate) fn count(value: u64) -> String {
    group(&value.to_string())
}

/// A CPU time in seconds, to three digits from one second on and to the millisecond below.
pub(crate) fn seconds(value: f64) -> String {
    if !value.is_finite() {
        return MISSING.to_owned();
    }
    if value.abs() < 1.0 {
        fixed(value, 3)
    } else {
        significant(value, 3)
    }
}

/// A share of one as a percentage with one decimal.
pub(crate) fn percent(share: f64) -> String {
    if share.is_finite() {
        format!("{} %", fixed(100.0 * share, 1))
    } else {
        MISSING.to_owned()
    }
}

/// How far `model` lies from `reference`, as a share of the reference; not finite where that has
/// no meaning.
pub(crate) fn relative_gap(model: f64, reference: f64) -> f64 {
    if reference == 0.0 {
        f64::NAN
    } else {
        (model - reference) / reference.abs()
    }
}

/// A relative gap as a signed percentage.
pub(crate) fn signed_percent(share: f64) -> String {
    let text = percent(share);
    if share.is_finite() && !text.starts_with('−') && text != "0.0 %" {
        format!("+{text}")
    } else {
        text
    }
}

/// The text with its first letter in upper case.
pub(crate) fn capitalised(text: &str) -> String {
    let mut chars = text.chars();
    chars.next().map_or_else(String::new, |first| {
        first.to_uppercase().chain(chars).collect()
    })
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
        assert_eq!(signed_percent(-0.0001), "0.0 %");
    }

    #[test]
    fn counts_and_times_are_grouped() {
        assert_eq!(count(999), "999");
        assert_eq!(count(3000), "3000");
        assert_eq!(count(90_000), "90\u{202f}000");
        assert_eq!(count(1_234_567), "1\u{202f}234\u{202f}567");
        assert_eq!(seconds(0.0214), "0.021");
        assert_eq!(seconds(1234.5), "1234");
    }

    #[test]
    fn gaps_are_relative_to_the_reference() {
        assert_eq!(signed_percent(relative_gap(1113.0, 938.0)), "+18.7 %");
        assert_eq!(signed_percent(relative_gap(0.36, 0.38)), "−5.3 %");
        assert_eq!(signed_percent(relative_gap(1.0, 0.0)), MISSING);
    }
}
