//! Conditions on the values of files, among them the ranges that the simulator accepts.

use serde::Serialize;

use super::FileError;
use super::validate::{Source, TEETH, TEETH_IN_WORDS};

impl Source<'_> {
    pub(super) fn require(
        self,
        holds: bool,
        key: &str,
        found: impl Serialize,
        expected: &str,
    ) -> Result<(), FileError> {
        if holds {
            Ok(())
        } else {
            Err(self.refuse(key, found, expected))
        }
    }

    /// Requires that limits of a section, the smallest and the largest value, leave a range.
    pub(super) fn limits(
        self,
        section: &str,
        [min, max]: [Option<f64>; 2],
    ) -> Result<(), FileError> {
        for (key, limit) in [("min", min), ("max", max)] {
            self.require(
                limit.is_none_or(f64::is_finite),
                &format!("{section}.{key}"),
                limit.unwrap_or_default(),
                "a finite number",
            )?;
        }
        if let (Some(min), Some(max)) = (min, max) {
            self.require(
                min < max,
                &format!("{section}.max"),
                max,
                &format!("a number above min, which is {min:?}"),
            )?;
        }
        Ok(())
    }

    /// Requires `low < value < high`. With infinite limits it requires only a finite value.
    pub(super) fn between(
        self,
        key: &str,
        value: f64,
        low: f64,
        high: f64,
    ) -> Result<(), FileError> {
        if value.is_finite() && value > low && value < high {
            return Ok(());
        }
        let expected = match (low.is_finite(), high.is_finite()) {
            (true, true) => format!("a number above {low} and below {high}"),
            (true, false) => format!("a finite number above {low}"),
            (false, true) => format!("a finite number below {high}"),
            (false, false) => "a finite number".to_owned(),
        };
        Err(self.refuse(key, value, expected))
    }

    pub(crate) fn positive(self, key: &str, value: f64) -> Result<(), FileError> {
        self.between(key, value, 0.0, f64::INFINITY)
    }

    pub(super) fn not_negative(self, key: &str, value: f64) -> Result<(), FileError> {
        self.require(
            value.is_finite() && value >= 0.0,
            key,
            value,
            "a finite number, zero or more",
        )
    }

    /// Requires a number from `low` to `high`, both included. `unit` is a word such as `mm`, or
    /// empty.
    pub(super) fn within(
        self,
        key: &str,
        value: f64,
        low: f64,
        high: f64,
        unit: &str,
    ) -> Result<(), FileError> {
        let expected = format!("a number from {low} to {high} {unit}");
        self.require(
            (low..=high).contains(&value),
            key,
            value,
            expected.trim_end(),
        )
    }

    /// Requires a number of teeth.
    pub(super) fn teeth(self, key: &str, teeth: u32) -> Result<(), FileError> {
        self.require(TEETH.contains(&teeth), key, teeth, TEETH_IN_WORDS)
    }

    /// Requires a length in mm that the simulator accepts.
    pub(super) fn length(self, key: &str, value: f64) -> Result<(), FileError> {
        self.within(key, value, 1e-4, 1e6, "mm")
    }

    /// Requires a tip rounding radius in mm that the simulator accepts. Zero is a sharp edge.
    pub(super) fn tip_radius(self, key: &str, value: f64) -> Result<(), FileError> {
        self.within(key, value, 0.0, 1e6, "mm")
    }

    /// Requires a root fillet radius in mm that the simulator accepts.
    pub(super) fn root_radius(self, key: &str, value: f64) -> Result<(), FileError> {
        self.within(key, value, 1e-6, 1e6, "mm")
    }

    /// Requires a pressure angle in degrees that the simulator accepts.
    pub(super) fn pressure_angle(self, key: &str, value: f64) -> Result<(), FileError> {
        self.within(key, value, 1.0, 45.0, "degrees")
    }

    /// Requires a helix angle in degrees that the simulator accepts.
    pub(super) fn helix_angle(self, key: &str, value: f64) -> Result<(), FileError> {
        self.within(key, value, -60.0, 60.0, "degrees")
    }

    /// Requires a whole number within `low..=high`.
    pub(super) fn count(self, key: &str, value: u32, low: u32, high: u32) -> Result<(), FileError> {
        self.require(
            (low..=high).contains(&value),
            key,
            value,
            &format!("a whole number from {low} to {high}"),
        )
    }

    /// Requires two finite values in ascending order within `[low, high]`.
    pub(super) fn ordered(
        self,
        key: &str,
        range: [f64; 2],
        low: f64,
        high: f64,
    ) -> Result<(), FileError> {
        let holds = range
            .iter()
            .all(|bound| bound.is_finite() && (low..=high).contains(bound))
            && range[0] < range[1];
        self.require(
            holds,
            key,
            range,
            &format!("[low, high] with low < high, both within {low} and {high}"),
        )
    }
}
