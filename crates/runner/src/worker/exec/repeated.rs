//! Equal errors in a row, so that the log has the text of each only once.

/// The latest error, and how often it occurred in a row.
#[derive(Debug, Default)]
pub(super) struct Repeated {
    text: String,
    count: u32,
}

impl Repeated {
    /// Counts an error. Returns how often it has occurred since the last different one; 1 for a new error.
    pub(super) fn count(&mut self, text: &str) -> u32 {
        if self.count == 0 || self.text != text {
            text.clone_into(&mut self.text);
            self.count = 0;
        }
        self.count += 1;
        self.count
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_equal_errors_in_a_row_are_counted() {
        let mut errors = Repeated::default();
        let counts = ["a", "a", "b", "b", "b", "a"].map(|text| errors.count(text));
        assert_eq!(counts, [1, 2, 1, 2, 3, 1]);
        let mut empty = Repeated::default();
        assert_eq!(["", ""].map(|text| empty.count(text)), [1, 2]);
    }
}
