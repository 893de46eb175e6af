//! Data that can be fitted.

use crate::data::scaled::ScaledData;
use crate::data::{Data, Points, contradiction, points};
use crate::{Error, Warning};

/// The points that a model is fitted to.
pub(crate) struct Prepared {
    pub(crate) points: Points,
    /// The number of different points.
    pub(crate) distinct: usize,
    pub(crate) scaled: ScaledData,
    /// The warnings about the data.
    pub(crate) warnings: Vec<Warning>,
}

impl Prepared {
    /// Checks that the data can be fitted.
    pub(crate) fn new(data: &Data<'_>, unknown_nugget: bool) -> Result<Self, Error> {
        let (points, mut warnings) = points(data, unknown_nugget)?;
        let distinct = points.distinct();
        if distinct < 2 {
            return Err(Error::TooFewPoints { distinct });
        }
        let scaled = ScaledData::new(&points)?;
        if !unknown_nugget {
            contradiction::check(&points, &scaled)?;
        }
        for coordinate in (0..data.d).filter(|j| !scaled.active.contains(j)) {
            warnings.push(Warning::IgnoredCoordinate { coordinate });
        }
        if scaled.is_constant() {
            warnings.push(Warning::ConstantResponse);
        }
        Ok(Self {
            points,
            distinct,
            scaled,
            warnings,
        })
    }
}
