//! The arguments of models of a user's own table.

use std::path::PathBuf;

use clap::Args;
use kriging::{Estimator, Kernel, Method, Nugget, Response, Trend};
use serde::Deserialize;
use serde::de::IntoDeserializer as _;
use serde::de::value::{Error, StrDeserializer};

#[derive(Debug, Args)]
pub(crate) struct Fit {
    /// The table: a header line, then rows of numbers; commas, semicolons, tabs or blanks between them
    #[arg(value_name = "DATA.csv")]
    pub(crate) data: PathBuf,
    /// The column of the observations
    #[arg(long, value_name = "COLUMN")]
    pub(crate) response: String,
    /// The column of the observations' noise variances, in the response's unit squared
    #[arg(long, value_name = "COLUMN")]
    pub(crate) variance: Option<String>,
    /// The columns of the inputs [default: all other columns whose numbers differ]
    #[arg(long, value_name = "A,B,…", value_delimiter = ',')]
    pub(crate) inputs: Option<Vec<String>>,
    /// Leave out rows in which a column of the model is empty, NA, NaN or the like, and say which
    #[arg(long)]
    pub(crate) skip_missing: bool,
    #[command(flatten)]
    pub(crate) how: FitSettings,
    /// The model file to write; one that exists is refused
    #[arg(long, value_name = "MODEL.json")]
    pub(crate) out: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    pub(crate) json: bool,
}

/// The settings of a fit, named like the keys of a campaign file's section [kriging].
#[derive(Debug, Args)]
pub(crate) struct FitSettings {
    /// matern-5-2, matern-3-2, squared-exponential, exponential, or radial-matern-5-2,
    /// radial-matern-3-2, radial-exponential
    #[arg(long, value_name = "NAME", default_value_t, value_parser = by_name::<Kernel>)]
    pub(crate) kernel: Kernel,
    /// auto, exact (all observations) or vecchia (the nearest ones); auto is exact up to 10 000
    #[arg(long, value_name = "NAME", default_value = "auto", value_parser = by_name::<Method>)]
    pub(crate) method: Method,
    /// likelihood or posterior-mode (a prior on the ranges, for few points)
    #[arg(long, value_name = "NAME", default_value = "likelihood",
        value_parser = by_name::<Estimator>)]
    pub(crate) estimator: Estimator,
    /// constant or linear
    #[arg(long, value_name = "NAME", default_value = "constant", value_parser = by_name::<Trend>)]
    pub(crate) trend: Trend,
    /// known (no noise but --variance) or estimated [default: known with --variance, else estimated]
    #[arg(long, value_name = "NAME", value_parser = by_name::<Nugget>)]
    pub(crate) nugget: Option<Nugget>,
    /// Scale the predicted variances to the leave-one-out residuals
    #[arg(long)]
    pub(crate) calibrate: bool,
    /// plain, or log to model the logarithm of a positive response
    #[arg(long, value_name = "NAME", default_value = "plain", value_parser = by_name::<Response>)]
    pub(crate) response_scale: Response,
    /// The seed of the search's random starts
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub(crate) seed: u64,
}

#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("model-source").required(true).args(["model", "db"]))]
pub(crate) struct Predict {
    /// The model file of `fit --out` or `export --table model`
    #[arg(long, value_name = "MODEL.json")]
    pub(crate) model: Option<PathBuf>,
    /// The store of a campaign, whose model of the percentile is taken
    #[arg(long, value_name = "FILE")]
    pub(crate) db: Option<PathBuf>,
    /// The points: a table with a column for each input, in any order
    #[arg(long, value_name = "POINTS.csv")]
    pub(crate) at: PathBuf,
    /// Leave out rows in which an input is empty, NA, NaN or the like, and say which
    #[arg(long)]
    pub(crate) skip_missing: bool,
    /// The probability of the quantile of the predicted distribution
    #[arg(long, value_name = "P", default_value_t = 0.9, value_parser = level)]
    pub(crate) level: f64,
    /// The probability of the intervals of the mean and of a new observation
    #[arg(long, value_name = "P", default_value_t = 0.95, value_parser = level)]
    pub(crate) interval: f64,
    /// The file, or - for standard output; one that exists is refused
    #[arg(long, value_name = "FILE|-", default_value = "-")]
    pub(crate) out: PathBuf,
    /// Write one JSON object instead of CSV
    #[arg(long)]
    pub(crate) json: bool,
}

/// Parses a choice by its name in a campaign file.
fn by_name<T: for<'a> Deserialize<'a>>(name: &str) -> Result<T, String> {
    let name: StrDeserializer<'_, Error> = name.into_deserializer();
    T::deserialize(name).map_err(|error| {
        error
            .to_string()
            .replace("unknown variant", "unknown choice")
    })
}

fn level(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(level) if level > 0.0 && level < 1.0 => Ok(level),
        _ => Err("it must be a number above 0 and below 1".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn choices_have_the_names_of_the_campaign_file() {
        assert_eq!(by_name("vecchia"), Ok(Method::Vecchia));
        assert_eq!(by_name("posterior-mode"), Ok(Estimator::PosteriorMode));
        assert_eq!(by_name("linear"), Ok(Trend::Linear));
        assert_eq!(by_name("log"), Ok(Response::Log));
        assert_eq!(by_name("estimated"), Ok(Nugget::Estimated));
        let refusal = by_name::<Trend>("cubic").unwrap_err();
        for part in ["unknown choice `cubic`", "`constant`", "`linear`"] {
            assert!(refusal.contains(part), "{refusal}");
        }
        assert!(level("1").is_err() && level("0.95").is_ok());
    }
}
