//! The size of a study.

/// The size of a study.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Size {
    /// Reliable figures: ten minutes of CPU time for the paper's campaign.
    Full,
    /// Rough figures: one to three minutes.
    Quick,
    /// About this many designs, for tests of the program.
    Designs(u32),
}

impl Size {
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::Full => "full".to_owned(),
            Self::Quick => "quick".to_owned(),
            Self::Designs(count) => format!("{count} designs"),
        }
    }

    /// Picks the value for this size; a test takes the third.
    pub(crate) fn pick<T>(self, full: T, quick: T, test: T) -> T {
        match self {
            Self::Full => full,
            Self::Quick => quick,
            Self::Designs(_) => test,
        }
    }

    /// Number of designs to measure; a test measures at most its own number.
    pub(crate) fn designs(self, full: usize, quick: usize) -> usize {
        match self {
            Self::Designs(count) => quick.min(count as usize),
            _ => self.pick(full, quick, quick),
        }
    }
}
