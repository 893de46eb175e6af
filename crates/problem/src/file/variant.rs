//! Campaigns derived from another one.

use super::{Campaign, FileError};

impl Campaign {
    /// The same campaign with another number of pinion teeth, and the text of its file, which
    /// parses to it. The number is appended to its name. It leaves out the comparison with the
    /// paper, whose designs have one tooth number. The mate's number follows from the ratio, or is
    /// unchanged; the module follows from the centre distance, or the reverse.
    ///
    /// `file` names the original in errors.
    ///
    /// # Errors
    ///
    /// The file is invalid with these teeth. The line is that of the new text.
    ///
    /// # Panics
    ///
    /// Never: a campaign is plain numbers and names, which TOML can hold.
    pub fn with_pinion_teeth(&self, file: &str, teeth: u32) -> Result<(Self, String), FileError> {
        let mut other = self.clone();
        other.name = format!("{}-z{teeth}", self.name);
        if let Some(sections) = other.gears_mut() {
            sections.pair.pinion_teeth = teeth;
            sections.report.compare_with_paper = false;
        }
        let text = toml::to_string(&other).expect("plain numbers and names serialise");
        let parsed = Self::parse(&format!("{file} with {teeth} pinion teeth"), &text)?;
        Ok((parsed, text))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_teeth_change_the_pair_and_nothing_that_is_drawn_at_random() {
        let paper = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
        let (other, text) = paper.with_pinion_teeth("paper.toml", 27).unwrap();
        assert_eq!(other.gears().unwrap().pair.teeth(), [27, 30]);
        assert_eq!(other.name, "paper-z27");
        assert!(!other.compares_with_paper());
        assert_eq!(Campaign::parse("again", &text).unwrap(), other);
        assert_ne!(other.digest(), paper.digest());
        let mut back = other;
        back.name.clone_from(&paper.name);
        let (sections, papers) = (back.gears_mut().unwrap(), paper.gears().unwrap());
        sections.pair.pinion_teeth = 20;
        sections.report = papers.report;
        assert_eq!(back, paper);
    }

    #[test]
    fn teeth_that_make_no_sense_are_refused_by_key() {
        let paper = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
        let error = paper.with_pinion_teeth("my.toml", 2000).unwrap_err();
        let message = error.to_string();
        assert!(
            message.contains("my.toml with 2000 pinion teeth"),
            "{message}"
        );
        assert!(message.contains("pair.gear_ratio"), "{message}");
    }
}
