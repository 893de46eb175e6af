//! The user's files: the campaign file and the pair file.
//!
//! Both are TOML with units in their keys. A file is parsed strictly (unknown and missing keys are
//! errors) and validated once, here, so every [`Campaign`] is valid. Parsing simulates nothing.

mod accuracy;
mod advice;
mod allowances;
mod bounds;
mod budget;
mod campaign;
mod changes;
mod checks;
mod combination;
mod constraint;
mod corrections;
mod enrichment;
mod external;
mod face_width;
mod failed;
mod file_kind;
mod form;
mod formula;
mod gear_sections;
mod kriging;
mod limits;
mod load;
mod manufacture;
mod material;
mod measure;
mod objective;
mod pair;
mod random;
mod response;
mod result_line;
mod sampling;
mod settings;
mod simulator;
mod strength;
mod validate;
mod variant;
mod wear;

pub use self::kriging::Kriging;
pub use advice::outside;
pub use allowances::{Allowances, ThicknessAllowances};
pub use bounds::{Bounds, Each, FrozenFrom, FrozenSection, OfGears, Relation, Setting};
pub(crate) use bounds::{HELIX_ANGLE, ROOT_RADII, TIP_RADII};
pub use budget::Budget;
pub use campaign::{Campaign, Kind};
pub use combination::{Combination, Several};
pub use constraint::ConstraintSection;
pub(crate) use corrections::CORRECTIONS;
pub use corrections::{CorrectionsSection, PairCorrections, micrometres};
pub use enrichment::Enrichment;
pub use external::{Domain, ExternalSections, VariableSection};
pub use face_width::FaceWidth;
pub(crate) use form::Form;
pub(crate) use formula::Formula;
pub use gear_sections::{GearSections, Pair, Penalty, Report};
pub use limits::GearLimits;
pub use load::{Load, LoadCase};
pub use manufacture::Manufacture;
pub use material::{Grade, Material, Materials, Treatment};
pub use measure::SIGNIFICANCE;
pub use objective::{Aim, MeasureName, Objective};
pub(crate) use pair::gear_size;
pub use pair::{PairFile, PairSection};
pub use random::{CorrelationSection, Parameter, RandomSection};
pub use response::ResponseSection;
pub use result_line::ResultLine;
pub use sampling::{ControlVariate, EstimatorRule, FailedSamples, Sampling, WearCoefficients};
pub use settings::{Doe, Optimise, TableRows, Verify};
pub use simulator::{SimulatorKind, SimulatorSection, UmBridgeSection};
pub(crate) use validate::Source;
pub use variant::Dimensions;

/// The errors of campaign and pair files.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum FileError {
    /// The text is not TOML, or has an unknown key, a missing key or a value of the wrong type.
    #[error("{file}, line {line}: {message}")]
    Syntax {
        /// The file's name, as the user gave it.
        file: String,
        /// The line, counted from 1.
        line: usize,
        /// The parser's message.
        message: String,
    },
    /// A value is invalid.
    #[error("{file}, line {line}: {key} is {found}, but must be {expected}")]
    Value {
        /// The file's name, as the user gave it.
        file: String,
        /// The line, counted from 1.
        line: usize,
        /// The key with its section, such as `sampling.samples_per_design`.
        key: String,
        /// The value found.
        found: String,
        /// The values that would be valid.
        expected: String,
    },
}
