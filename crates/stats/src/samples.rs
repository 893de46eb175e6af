//! Samples of several responses at once.

/// Samples of the responses of a simulator: a row for each sample, with one value for each response.
///
/// An infinite value stands for a sample that failed.
#[derive(Debug, Clone, PartialEq)]
pub struct Samples {
    /// Number of values in a row, at least one.
    width: usize,
    /// The rows, one after the other.
    values: Vec<f64>,
}

impl Samples {
    /// No samples, of `width` responses.
    ///
    /// # Panics
    ///
    /// For a `width` of 0.
    #[must_use]
    pub const fn none(width: usize) -> Self {
        assert!(width > 0, "a sample has at least one value");
        let values = Vec::new();
        Self { width, values }
    }

    /// The samples with these values, row after row; `None` if they are not whole rows of `width` values.
    #[must_use]
    pub fn new(width: usize, values: Vec<f64>) -> Option<Self> {
        let is_whole = width > 0 && values.len().is_multiple_of(width);
        is_whole.then_some(Self { width, values })
    }

    /// Number of responses.
    #[must_use]
    pub const fn width(&self) -> usize {
        self.width
    }

    /// Number of samples.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.values.len() / self.width
    }

    /// Whether there are no samples.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// All values, row after row.
    #[must_use]
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// All values, row after row, as an owned list.
    #[must_use]
    pub fn into_values(self) -> Vec<f64> {
        self.values
    }

    /// The rows.
    pub fn rows(&self) -> impl ExactSizeIterator<Item = &[f64]> {
        self.values.chunks_exact(self.width)
    }

    /// One row.
    #[must_use]
    pub fn get(&self, sample: usize) -> Option<&[f64]> {
        self.rows().nth(sample)
    }

    /// Adds a sample.
    ///
    /// # Panics
    ///
    /// If the row has another number of values.
    pub fn push(&mut self, row: &[f64]) {
        assert_eq!(
            row.len(),
            self.width,
            "a sample has a value for each response"
        );
        self.values.extend_from_slice(row);
    }

    /// Adds samples of the same responses.
    ///
    /// # Panics
    ///
    /// If they have another number of responses.
    pub fn extend(&mut self, other: &Self) {
        assert_eq!(other.width, self.width, "samples of the same responses");
        self.values.extend_from_slice(&other.values);
    }

    /// The first samples, at most `most` of them.
    #[must_use]
    pub fn first(&self, most: usize) -> Self {
        let count = most.min(self.len());
        Self {
            width: self.width,
            values: self.values[..count * self.width].to_vec(),
        }
    }

    /// Number of samples that failed.
    #[must_use]
    pub fn failed(&self) -> usize {
        self.rows().filter(|row| Self::is_failed(row)).count()
    }

    /// Whether a row stands for a sample that failed.
    #[must_use]
    pub fn is_failed(row: &[f64]) -> bool {
        row.iter().any(|value| value.is_infinite())
    }
}

/// Samples of one response.
impl From<Vec<f64>> for Samples {
    fn from(values: Vec<f64>) -> Self {
        Self { width: 1, values }
    }
}

/// Samples of one response.
impl FromIterator<f64> for Samples {
    fn from_iter<I: IntoIterator<Item = f64>>(values: I) -> Self {
        values.into_iter().collect::<Vec<f64>>().into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_have_a_value_for_each_response() {
        let mut samples = Samples::new(2, vec![1.0, 2.0, f64::INFINITY, 4.0]).unwrap();
        assert_eq!((samples.len(), samples.failed()), (2, 1));
        samples.push(&[5.0, 6.0]);
        assert_eq!(samples.get(2), Some(&[5.0, 6.0][..]));
        assert_eq!(samples.get(3), None);
        let mut twice = samples.first(1);
        assert_eq!(twice.values(), [1.0, 2.0]);
        twice.extend(&samples.first(1));
        assert_eq!(twice.values(), [1.0, 2.0, 1.0, 2.0]);
        assert_eq!(samples.first(4), samples);
        assert_eq!(Samples::new(2, vec![1.0]), None);
        assert_eq!(Samples::new(0, Vec::new()), None);
        assert_eq!(Samples::from(vec![7.0, 8.0]).len(), 2);
    }
}
