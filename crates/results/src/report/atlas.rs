//! The entries of the stability atlas.

use crate::report::quantity::NamedValue;
use crate::report::svg::Chart;

/// The stability atlas.
#[derive(Debug, Clone)]
pub struct AtlasPage {
    /// The version of the program, for the page's end.
    pub program_version: String,
    /// The methods with their entries, in the order in which they are to be shown.
    pub methods: Vec<AtlasMethod>,
}

/// The entries of one method.
#[derive(Debug, Clone)]
pub struct AtlasMethod {
    /// The method's name, which begins with a capital letter.
    pub name: String,
    pub entries: Vec<AtlasEntry>,
}

/// An input on which a method breaks or nearly does.
#[derive(Debug, Clone)]
pub struct AtlasEntry {
    /// A short stable name, also the anchor in the page.
    pub id: String,
    /// The failure, in a few words.
    pub title: String,
    pub input: String,
    /// Names of the warnings, refusals and reasons that the code returned; empty if it returned none.
    pub detected: Vec<String>,
    /// The messages that go with them.
    pub told: Vec<String>,
    /// The fallback.
    pub instead: String,
    /// The promises, each with whether it was kept.
    pub promises: Vec<(String, bool)>,
    pub figures: Vec<NamedValue>,
    /// Curves, where they say more than figures.
    pub charts: Vec<Chart>,
}

impl AtlasEntry {
    /// Whether every promise was kept.
    #[must_use]
    pub fn is_kept(&self) -> bool {
        self.promises.iter().all(|(_, is_kept)| *is_kept)
    }
}
