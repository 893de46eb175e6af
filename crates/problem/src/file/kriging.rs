//! The section `[kriging]` of the campaign file.

use kriging::{Estimator, FitOptions, Kernel, Method, Noise, Nugget, Response, Settings, Trend};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::validate::Source;
use super::{FileError, Sampling};

/// `[kriging]`: the model of the percentile. An enrichment takes `kernel` and `noise` for its own models, and
/// none of the other keys.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Kriging {
    /// Covariance function.
    pub kernel: Kernel,
    /// Whether predictions use all designs or only the nearest ones.
    pub method: Method,
    /// Whether the parameters maximise the likelihood or the posterior.
    pub estimator: Estimator,
    /// The trend of the response.
    pub trend: Trend,
    /// The source of the known noise variances. Without it, the objective's model takes those of each design's own samples,
    /// as the paper does. An enrichment and the models of limits smooth them, so that no design is recommended that only
    /// seems good or safe.
    pub noise: Option<Noise>,
    /// Whether a noise variance is estimated in addition to the known ones.
    pub nugget: Nugget,
    /// Whether predicted variances are scaled to the leave-one-out residuals.
    pub calibrate: bool,
    /// Whether the response or its logarithm is modelled.
    pub response: Response,
    /// Numbers, from 0, of designs that are excluded from the fit.
    pub leave_out: Vec<u32>,
}

impl Kriging {
    pub(super) fn validate(
        &self,
        source: Source<'_>,
        designs: u32,
        sampling: &Sampling,
    ) -> Result<(), FileError> {
        source.require(
            self.noise != Some(Noise::Smoothed) || sampling.precision.is_none(),
            "kriging.noise",
            Noise::Smoothed,
            "\"own\" beside sampling.precision, which gives designs different numbers of samples",
        )?;
        if self.method == Method::Vecchia {
            source.require(
                self.trend == Trend::Constant,
                "kriging.trend",
                self.trend,
                "\"constant\" beside kriging.method = \"vecchia\"",
            )?;
        }
        let beyond = self.leave_out.iter().find(|design| **design >= designs);
        source.require(
            beyond.is_none(),
            "kriging.leave_out",
            &self.leave_out,
            &format!("numbers of designs, from 0 to {}", designs - 1),
        )
    }

    /// The section with the keys that affect only the model at their defaults. Two campaigns that
    /// differ only in these keys have the same samples.
    pub(super) fn without_choices(&self) -> Self {
        Self {
            kernel: self.kernel,
            ..Self::default()
        }
    }

    /// The settings of the fit.
    #[must_use]
    pub fn settings(&self, seed: u64) -> Settings {
        Settings {
            fit: FitOptions {
                kernel: self.kernel,
                estimator: self.estimator,
                seed,
                trend: self.trend,
                nugget: self.nugget,
                calibrate: self.calibrate,
                // If the model is no better than noise, its optimum would be a matter of luck.
                refuse_no_structure: true,
                ..FitOptions::default()
            },
            method: self.method,
            response: self.response,
            noise: self.noise.unwrap_or_default(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Campaign;

    fn with(keys: &str) -> Result<Campaign, FileError> {
        let text = Campaign::PAPER.replace("[kriging]\n", &format!("[kriging]\n{keys}\n"));
        Campaign::parse("paper.toml", &text)
    }

    #[test]
    fn every_key_reaches_the_fit() {
        let campaign = with(
            "method = \"exact\"\nestimator = \"posterior-mode\"\ntrend = \"linear\"\nnugget = \"estimated\"\nnoise = \"smoothed\"\n\
             calibrate = true\nresponse = \"log\"\nleave_out = [7, 2999]",
        )
        .unwrap();
        let Settings {
            fit,
            method,
            response,
            noise,
        } = campaign.kriging.settings(5);
        assert_eq!((method, response), (Method::Exact, Response::Log));
        assert_eq!(fit.estimator, Estimator::PosteriorMode);
        assert_eq!((fit.trend, fit.nugget), (Trend::Linear, Nugget::Estimated));
        assert_eq!(noise, Noise::Smoothed);
        assert_eq!((fit.calibrate, fit.seed), (true, 5));
        assert_eq!(campaign.kriging.leave_out, [7, 2999]);
    }

    #[test]
    fn another_choice_keeps_the_samples() {
        let paper = with("").unwrap();
        let logarithm = with("response = \"log\"\nleave_out = [3]").unwrap();
        assert_eq!(logarithm.values_digest(), paper.values_digest());
        assert!(logarithm.extends(&paper) && paper.extends(&logarithm));
        assert_ne!(logarithm.digest(), paper.digest());
    }

    #[test]
    fn impossible_choices_are_refused_by_their_line() {
        for (keys, key) in [
            ("method = \"vecchia\"\ntrend = \"linear\"", "kriging.trend"),
            ("leave_out = [3000]", "kriging.leave_out"),
        ] {
            let error = with(keys).unwrap_err().to_string();
            assert!(error.contains(key) && error.contains("line"), "{error}");
        }
        assert!(with("method = \"dense\"").is_err());
        assert!(with("method = \"vecchia\"\nnugget = \"estimated\"").is_ok());
        let precise = Campaign::PAPER
            .replace("# precision", "precision")
            .replace("# samples_max", "samples_max")
            .replace("[kriging]\n", "[kriging]\nnoise = \"smoothed\"\n");
        let error = Campaign::parse("paper.toml", &precise).unwrap_err();
        assert!(error.to_string().contains("kriging.noise"), "{error}");
    }
}
