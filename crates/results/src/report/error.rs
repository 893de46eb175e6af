/// Why a chart or a report could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A chart was asked for without a single point that it could show. [`render`](crate::report::render)
    /// never returns this: it writes the sentence in the chart's place.
    #[error("{chart}: nothing to draw, because {why}")]
    NothingToDraw {
        chart: &'static str,
        /// The missing data, as the end of a sentence.
        why: &'static str,
    },
    /// Two lists that describe the same points have different lengths.
    #[error("{what} has {found} values, but there are {expected} abscissae")]
    LengthMismatch {
        /// The list at fault.
        what: &'static str,
        expected: usize,
        found: usize,
    },
    /// The page template failed.
    #[error("filling the page template failed")]
    Template(#[from] askama::Error),
}
