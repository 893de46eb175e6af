//! Campaigns derived from another one.

use super::{Campaign, FileError, Pair};

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
        let what = format!("{file} with {teeth} pinion teeth");
        self.with_pair(&what, &format!("z{teeth}"), |pair| {
            pair.pinion_teeth = teeth;
        })
    }

    /// The same campaign with other teeth of both gears, and with another module if one is given.
    ///
    /// # Errors
    ///
    /// As [`with_pinion_teeth`](Self::with_pinion_teeth).
    pub fn with_size(
        &self,
        file: &str,
        teeth: [u32; 2],
        normal_module_mm: Option<f64>,
    ) -> Result<Self, FileError> {
        let [pinion, mate] = teeth;
        let what = format!("{file} with {pinion} and {mate} teeth");
        let changed = self.with_pair(&what, &format!("z{pinion}-{mate}"), |pair| {
            pair.pinion_teeth = pinion;
            (pair.gear_ratio, pair.gear_teeth) = (None, Some(mate));
            pair.normal_module_mm = normal_module_mm.or(pair.normal_module_mm);
        });
        Ok(changed?.0)
    }

    /// The same campaign with a changed pair, and the text of its file. `suffix` is appended to the name, and `what`
    /// names the campaign in errors.
    fn with_pair(
        &self,
        what: &str,
        suffix: &str,
        change: impl FnOnce(&mut Pair),
    ) -> Result<(Self, String), FileError> {
        let mut other = self.clone();
        other.name = format!("{}-{suffix}", self.name);
        if let Some(sections) = other.gears_mut() {
            change(&mut sections.pair);
            sections.report.compare_with_paper = false;
        }
        let text = toml::to_string(&other).expect("plain numbers and names serialise");
        Ok((Self::parse(what, &text)?, text))
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
