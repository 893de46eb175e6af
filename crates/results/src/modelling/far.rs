//! Cells far beyond the rest of their column: lost decimal points, marks of missing values such as 1e30.

use crate::number::rounded;

/// Ratio of a far cell to the largest other cell. Honest columns with heavy tails stay far below: the
/// largest of Cauchy-distributed numbers exceeds the second largest 10⁴ times in one table in ten thousand.
const FACTOR: f64 = 1e4;

/// At most one in `SHARE` of a column's cells may be far from the rest. More of them are a group of their own.
const SHARE: usize = 10;

/// A warning if up to a tenth of a column's `values`, one of them at least, are very much larger than all
/// others. `line` is the line of a row.
pub(crate) fn warning(name: &str, values: &[f64], line: impl Fn(usize) -> u64) -> Option<String> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[b].abs().total_cmp(&values[a].abs()).then(a.cmp(&b)));
    let far = (1..=values.len() / SHARE).rfind(|&count| {
        let (far, rest) = (values[order[count - 1]].abs(), values[order[count]].abs());
        rest > 0.0 && far > FACTOR * rest
    })?;
    let rest: Vec<f64> = order[far..].iter().map(|&row| values[row]).collect();
    let low = rest.iter().copied().fold(f64::INFINITY, f64::min);
    let high = rest.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let ratio = values[order[far - 1]].abs() / low.abs().max(high.abs());
    let magnitude = 10_f64.powf(ratio.log10().floor());
    let mut rows = order[..far].to_vec();
    rows.sort_unstable();
    let lines: Vec<String> = rows
        .iter()
        .take(10)
        .map(|&row| line(row).to_string())
        .collect();
    let more = match rows.len() - lines.len() {
        0 => String::new(),
        count => format!(" and {count} more"),
    };
    let (lines, lie) = match &lines[..] {
        [only] => (format!("line {only}"), "lies"),
        [some @ .., last] if more.is_empty() => {
            (format!("lines {} and {last}", some.join(", ")), "lie")
        }
        all => (format!("lines {}", all.join(", ")), "lie"),
    };
    let [low, high, example] = [low, high, values[rows[0]]].map(|value| rounded(value, 4));
    Some(format!(
        "{lines}{more} {lie} {magnitude:e} times beyond the rest of column {name:?}, {low} to {high}: \
         {example:e} may lack its decimal point or stand for a missing value"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(values: &[f64]) -> Option<String> {
        warning("k", values, |row| row as u64 + 2)
    }

    #[test]
    fn lost_decimal_points_are_named() {
        let mut values: Vec<f64> = (0..60).map(|i| 8.0 + f64::from(i % 12) * 0.5).collect();
        assert_eq!(found(&values), None);
        values[7] = 1.126e16;
        values[31] = -8.108e15;
        let text = found(&values).unwrap();
        for part in [
            "lines 9 and 33 lie 1e14 times",
            "column \"k\", 8 to 13.5",
            "1.126e16",
        ] {
            assert!(text.contains(part), "no {part:?} in {text}");
        }
        values[31] = 9.0;
        assert!(
            found(&values).unwrap().starts_with("line 9 lies"),
            "{:?}",
            found(&values)
        );
    }

    #[test]
    fn heavy_tails_are_honest() {
        // The quantiles of a Cauchy distribution, of a log-normal one with σ = 4, and 16 decades.
        let n = 1000;
        let levels = (0..n).map(|i| (f64::from(i) + 0.5) / f64::from(n));
        let cauchy: Vec<f64> = levels
            .clone()
            .map(|p| (std::f64::consts::PI * (p - 0.5)).tan())
            .collect();
        let decades: Vec<f64> = levels
            .clone()
            .map(|p| 10_f64.powf(16.0 * p - 8.0))
            .collect();
        let tail: Vec<f64> = levels.map(|p| (4.0 * (p / (1.0 - p)).ln()).exp()).collect();
        for values in [cauchy, decades, tail, vec![0.0; 50]] {
            assert_eq!(found(&values), None);
        }
        // A sixth of the cells is a group, not an accident.
        let groups: Vec<f64> = (0..60)
            .map(|i| if i % 6 == 0 { 1e9 } else { 1.0 })
            .collect();
        assert_eq!(found(&groups), None);
    }
}
