//! Errors in the rows and settings that a round is decided from.

/// Why no round could be decided.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A design does not have one coordinate per variable, each a finite number.
    #[error("design {index} must have {expected} finite coordinates, one per variable")]
    Design {
        /// Index of the design, from 0; failed designs are counted after the sampled ones.
        index: usize,
        /// The number of variables.
        expected: usize,
    },
    /// A response's variance is negative or not a number.
    #[error(
        "variance of the response of design {index} is {value}: it must be finite and not negative"
    )]
    Variance {
        /// Index of the design, from 0.
        index: usize,
        /// Variance of the response.
        value: f64,
    },
    /// A setting is out of range.
    #[error("{name} is {value}: it must be {expected}")]
    Setting {
        /// The setting's name.
        name: &'static str,
        /// Value of the setting.
        value: f64,
        /// The accepted values, in words.
        expected: &'static str,
    },
    /// A model could not be extended by a point.
    #[error("the kriging model cannot be used: {0}")]
    Model(#[from] kriging::Error),
    /// The search within a model could not be set up.
    #[error("the search for infill points cannot be set up: {0}")]
    Search(#[from] cmaes::Error),
}
