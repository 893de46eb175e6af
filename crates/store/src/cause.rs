//! The common cause of similar failures.

/// Maximum length of a cause in bytes. The common part of similar errors is at the beginning.
const LONGEST: usize = 200;

/// The error's first line with every number replaced by `#`: failures that differ only in a radius
/// or in the index of a sample have the same cause.
pub(crate) fn cause(error: &str) -> String {
    let mut cause = String::new();
    let mut characters = first_line(error).chars().peekable();
    while let Some(c) = characters.next() {
        if cause.len() >= LONGEST {
            break;
        }
        if !c.is_ascii_digit() {
            cause.push(c);
            continue;
        }
        cause.push('#');
        // "1.25" is one number, but the full stop in "sample 3." ends the sentence.
        while let Some(&next) = characters.peek() {
            let mut ahead = characters.clone();
            ahead.next();
            let inside = next.is_ascii_digit()
                || next == '.' && ahead.peek().is_some_and(char::is_ascii_digit);
            if !inside {
                break;
            }
            characters.next();
        }
    }
    cause
}

pub(crate) fn first_line(error: &str) -> &str {
    error.lines().next().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cause_has_no_numbers_and_no_second_line() {
        assert_eq!(
            cause("the pinion's tip radius 12.50 mm exceeds -3 mm in sample 17.\r\nat mesh 3"),
            "the pinion's tip radius # mm exceeds -# mm in sample #."
        );
        assert_eq!(cause("1..2 é 3.x"), "#..# é #.x");
        assert_eq!(cause(""), "");
        assert_eq!(cause("\nsecond"), "");
    }

    #[test]
    fn a_long_cause_is_cut_between_characters() {
        let cause = cause(&"é".repeat(1000));
        assert_eq!(cause, "é".repeat(LONGEST / 2));
    }
}
