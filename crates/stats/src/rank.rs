//! Rank correlation.

use crate::Error;

/// Spearman's rank correlation of two equally long lists; ties get their mean rank.
///
/// # Errors
///
/// [`Error::TooFewSamples`] for fewer than two pairs (surplus values of the longer list are
/// ignored), [`Error::NonFinite`] with the index, and [`Error::Constant`] for a list whose values
/// are all equal, because all its ranks are then equal too.
pub fn spearman(a: &[f64], b: &[f64]) -> Result<f64, Error> {
    let n = a.len().min(b.len());
    if n < 2 {
        return Err(Error::TooFewSamples {
            statistic: "rank correlation",
            needed: 2,
            got: n,
        });
    }
    let (ranks_a, ranks_b) = (ranks(&a[..n])?, ranks(&b[..n])?);
    let mean = (n as f64 + 1.0) / 2.0;
    let moment = |x: &[f64], y: &[f64]| -> f64 {
        x.iter().zip(y).map(|(x, y)| (x - mean) * (y - mean)).sum()
    };
    Ok(moment(&ranks_a, &ranks_b)
        / (moment(&ranks_a, &ranks_a) * moment(&ranks_b, &ranks_b)).sqrt())
}

fn ranks(values: &[f64]) -> Result<Vec<f64>, Error> {
    if let Some(index) = values.iter().position(|value| !value.is_finite()) {
        return Err(Error::NonFinite {
            index,
            value: values[index],
        });
    }
    if values.iter().all(|value| *value == values[0]) {
        return Err(Error::Constant {
            n: values.len(),
            value: values[0],
        });
    }
    Ok(values
        .iter()
        .map(|value| {
            let below = values.iter().filter(|other| *other < value).count();
            let equal = values.iter().filter(|other| *other == value).count();
            below as f64 + (equal as f64 + 1.0) / 2.0
        })
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn monotone_lists_correlate_perfectly() {
        let a = [1.0, 2.0, 5.0, 9.0];
        assert_eq!(spearman(&a, &[1.0, 8.0, 9.0, 100.0]).unwrap(), 1.0);
        assert_eq!(spearman(&a, &[4.0, 3.0, 2.0, -9.0]).unwrap(), -1.0);
    }

    /// Kendall and Gibbons' formula 1 − 6 Σd²/(n(n² − 1)) for lists without ties.
    #[test]
    fn it_is_the_textbook_formula_without_ties() {
        let a = [
            106.0, 100.0, 86.0, 101.0, 99.0, 103.0, 97.0, 113.0, 112.0, 110.0,
        ];
        let b = [7.0, 27.0, 2.0, 50.0, 28.0, 29.0, 20.0, 12.0, 6.0, 17.0];
        // Σd² = 194, n = 10
        let expected = 1.0 - 6.0 * 194.0 / (10.0 * 99.0);
        assert!((spearman(&a, &b).unwrap() - expected).abs() < 1e-12);
    }

    #[test]
    fn lists_that_say_nothing_are_refused() {
        assert!(matches!(
            spearman(&[1.0], &[2.0]),
            Err(Error::TooFewSamples { .. })
        ));
        assert!(matches!(
            spearman(&[1.0, 1.0], &[2.0, 3.0]),
            Err(Error::Constant { .. })
        ));
        assert!(matches!(
            spearman(&[1.0, f64::NAN], &[2.0, 3.0]),
            Err(Error::NonFinite { .. })
        ));
    }
}
