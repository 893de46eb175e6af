//! A search as it is written and read.

use nalgebra::DVector;
use serde::{Deserialize, Serialize};

use crate::stop::Window;
use crate::strategy::{Candidate, CmaEs};
use crate::{Error, Evaluation, Options, Stop};

/// The version of the form.
const FORMAT: u32 = 1;

/// Everything that a search knows; the strategy parameters follow from the options. Matrices are
/// column by column.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Stored {
    format: u32,
    pub(crate) options: Options,
    pub(crate) mean: Vec<f64>,
    pub(crate) sigma: f64,
    pub(crate) covariance: Vec<f64>,
    pub(crate) axes: Vec<f64>,
    pub(crate) lengths: Vec<f64>,
    pub(crate) p_sigma: Vec<f64>,
    pub(crate) p_c: Vec<f64>,
    pub(crate) generation: usize,
    pub(crate) decomposed_at: usize,
    pub(crate) evaluations: usize,
    pub(crate) asked: Vec<StoredCandidate>,
    pub(crate) best: Option<(Vec<f64>, Evaluation)>,
    pub(crate) window: Window,
    pub(crate) stop: Option<Stop>,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct StoredCandidate {
    z: Vec<f64>,
    y: Vec<f64>,
    x: Vec<f64>,
    redrawn: bool,
}

impl From<StoredCandidate> for Candidate {
    fn from(stored: StoredCandidate) -> Self {
        Self {
            z: DVector::from_vec(stored.z),
            y: DVector::from_vec(stored.y),
            x: stored.x,
            redrawn: stored.redrawn,
        }
    }
}

impl From<CmaEs> for Stored {
    fn from(search: CmaEs) -> Self {
        let asked = search.asked.into_iter().map(|c| StoredCandidate {
            z: c.z.as_slice().to_vec(),
            y: c.y.as_slice().to_vec(),
            x: c.x,
            redrawn: c.redrawn,
        });
        Self {
            format: FORMAT,
            mean: search.mean.as_slice().to_vec(),
            sigma: search.sigma,
            covariance: search.covariance.as_slice().to_vec(),
            axes: search.axes.as_slice().to_vec(),
            lengths: search.lengths.as_slice().to_vec(),
            p_sigma: search.p_sigma.as_slice().to_vec(),
            p_c: search.p_c.as_slice().to_vec(),
            generation: search.generation,
            decomposed_at: search.decomposed_at,
            evaluations: search.evaluations,
            asked: asked.collect(),
            best: search.best,
            window: search.window,
            stop: search.stop,
            options: search.options,
        }
    }
}

impl TryFrom<Stored> for CmaEs {
    type Error = Error;

    /// Refuses what is not the state of a search, so that one that was read cannot panic.
    fn try_from(stored: Stored) -> Result<Self, Error> {
        let wrong = |what| Err(Error::State { what });
        if stored.format != FORMAT {
            return wrong("its format has another version than 1");
        }
        stored.options.check()?;
        let n = stored.options.bounds.dimension();
        let vectors = [&stored.mean, &stored.lengths, &stored.p_sigma, &stored.p_c];
        let matrices = [&stored.covariance, &stored.axes];
        let candidates = stored.asked.iter();
        let fits = vectors.iter().all(|v| v.len() == n)
            && matrices.iter().all(|m| m.len() == n * n)
            && candidates
                .clone()
                .all(|c| [&c.z, &c.y, &c.x].iter().all(|v| v.len() == n))
            && stored.best.iter().all(|(x, _)| x.len() == n);
        if !fits {
            return wrong("a vector or matrix has another size than the bounds ask for");
        }
        let population = stored.options.population;
        if !(stored.asked.is_empty() || stored.asked.len() == population) {
            return wrong("the candidates waiting are not one population");
        }
        let finite = vectors.iter().all(|v| v.iter().all(|v| v.is_finite()))
            && stored.axes.iter().all(|v| v.is_finite())
            && candidates
                .flat_map(|c| c.z.iter().chain(&c.y).chain(&c.x))
                .all(|v| v.is_finite());
        if !(finite && stored.sigma.is_finite() && stored.sigma > 0.0) {
            return wrong("a number is not finite, or the step size is not positive");
        }
        if stored.lengths.iter().any(|l| *l <= 0.0) {
            return wrong("an axis of the distribution has no positive length");
        }
        if stored.mean.iter().any(|m| !(0.0..=1.0).contains(m)) {
            return wrong("the mean is outside the bounds");
        }
        if !stored.window.fits(n, population) {
            return wrong("the window of values has another length than the options ask for");
        }
        Ok(Self::restored(stored))
    }
}
