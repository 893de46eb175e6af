//! The likelihood at parameters of one's own choice.

use std::borrow::Cow;

use crate::Error;
use crate::data::{Data, Points, keep, merge};
use crate::kernel::Kernel;
use crate::likelihood::gls::Trend;
use crate::likelihood::{Form, Likelihood, Order};
use crate::model::Parameters;
use crate::data::scaled::Scaled;

/// The likelihood at one set of parameters, and its derivatives.
#[derive(Debug, Clone, PartialEq)]
pub struct LikelihoodGradient {
    /// −ln L, as [`crate::Model::negative_log_likelihood`] counts it, the trend at its optimum.
    pub negative_log_likelihood: f64,
    /// ∂(−ln L)/∂ ln θⱼ, d numbers; zero for a coordinate in which all points agree.
    pub ln_ranges: Vec<f64>,
    /// ∂(−ln L)/∂ ln σ².
    pub ln_sigma2: f64,
    /// ∂(−ln L)/∂ ln τ² of the nugget; zero without one.
    pub ln_nugget: f64,
}

/// The negative log likelihood of data as a function of the parameters: what [`crate::fit()`]
/// minimises, for profiles and for tests of an optimum. As in the fit, observations of one point are merged
/// unless there is a nugget.
pub struct LogLikelihood {
    d: usize,
    /// Of the observations, those at one point merged.
    merged: Part,
    /// Of the observations one by one, for a nugget; none where no point is repeated.
    apart: Option<Part>,
}

/// The likelihood of points in their scaled units.
struct Part {
    function: Likelihood<'static>,
    active: Vec<usize>,
    extents: Vec<f64>,
    y_scale: f64,
    count: usize,
    within: f64,
}

impl Part {
    fn new(points: &Points, kernel: Kernel, trend: Trend) -> Result<Self, Error> {
        let scaled = Scaled::new(points)?;
        let form = Form {
            kernel,
            trend,
            tied: false,
            nugget: true,
        };
        Ok(Self {
            active: scaled.active.clone(),
            extents: scaled.extents.clone(),
            y_scale: scaled.y_scale,
            count: points.len(),
            within: points.within,
            function: Likelihood::new(form, Cow::Owned(scaled), 0.0),
        })
    }
}

impl LogLikelihood {
    /// The likelihood of `data` for a kernel and a trend.
    ///
    /// # Errors
    ///
    /// Those of [`crate::fit()`] for unusable data.
    pub fn new(data: &Data<'_>, kernel: Kernel, trend: Trend) -> Result<Self, Error> {
        let points = merge(data)?;
        let distinct = points.len();
        if distinct < 2 {
            return Err(Error::TooFewPoints { distinct });
        }
        let apart = keep(data)?;
        Ok(Self {
            d: data.d,
            apart: if apart.len() > distinct {
                Some(Part::new(&apart, kernel, trend)?)
            } else {
                None
            },
            merged: Part::new(&points, kernel, trend)?,
        })
    }

    /// Value and gradient at given ranges, process variance and nugget; `mu` and `slopes` of the
    /// parameters are not used, since the trend is at its optimum. Costs n³ multiplications.
    ///
    /// # Errors
    ///
    /// [`Error::Shape`] for another number of ranges than coordinates, [`Error::OutOfRange`] for a
    /// range or variance that is not positive or a negative nugget, and
    /// [`Error::NotPositiveDefinite`] if the covariance cannot be factorised without jitter.
    pub fn evaluate(&mut self, parameters: &Parameters) -> Result<LikelihoodGradient, Error> {
        let Parameters {
            ranges,
            sigma2,
            nugget,
            ..
        } = parameters;
        if ranges.len() != self.d {
            return Err(Error::Shape {
                what: "ranges",
                expected: self.d,
                got: ranges.len(),
            });
        }
        let variances = [
            ("sigma2", *sigma2, *sigma2 > 0.0 && sigma2.is_finite()),
            ("nugget", *nugget, *nugget >= 0.0 && nugget.is_finite()),
        ];
        let of_ranges = ranges.iter().map(|r| ("ranges", *r, *r > 0.0));
        for (what, value, holds) in variances.into_iter().chain(of_ranges) {
            if !holds {
                return Err(Error::OutOfRange { what, value });
            }
        }

        let part = match &mut self.apart {
            Some(apart) if *nugget > 0.0 => apart,
            _ => &mut self.merged,
        };
        let active = || part.active.iter().zip(&part.extents);
        let unit = part.y_scale * part.y_scale;
        let mut at: Vec<f64> = active().map(|(&j, e)| (ranges[j] / e).ln()).collect();
        // ln 0 is −∞, whose exponential is 0 again.
        at.push((nugget / unit).ln());
        at.push((sigma2 / unit).ln());
        let evaluation = part
            .function
            .evaluate(&at, Order::Gradient)
            .ok_or(Error::NotPositiveDefinite { jitter: 0.0 })?;
        let mut ln_ranges = vec![0.0; self.d];
        for (&j, slope) in part.active.iter().zip(&evaluation.gradient) {
            ln_ranges[j] = *slope;
        }
        let count = at.len();
        let value = evaluation.value + part.count as f64 * part.y_scale.ln() + part.within;
        Ok(LikelihoodGradient {
            negative_log_likelihood: value,
            ln_ranges,
            ln_nugget: evaluation.gradient[count - 2],
            ln_sigma2: evaluation.gradient[count - 1],
        })
    }
}
