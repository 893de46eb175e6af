//! The pair of a file in each case of its load.

use gear::Pair;
use problem::PairFile;
use problem::formulation::gears::LoadedCases;
use problem::formulation::{Bound, Constraint};
use results::number::fixed;
use serde::Serialize;
use stats::streams::{Purpose, stream};

use super::{Request, WearChoice};

/// ΔSTE in the cases of a load.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub(super) struct Cases {
    #[serde(rename = "cases", skip_serializing_if = "Vec::is_empty")]
    pub(super) each: Vec<CaseFigures>,
    /// The measure of a campaign with this load: the greatest ΔSTE of a pair in any case, or the weighted mean.
    #[serde(rename = "all_cases", skip_serializing_if = "Option::is_none")]
    all: Option<Combined>,
}

/// ΔSTE over all cases.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct Combined {
    combination: &'static str,
    #[serde(flatten)]
    found: DeltaSte,
}

/// ΔSTE in one case.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct CaseFigures {
    name: String,
    pinion_torque_nm: f64,
    /// Share of the wear's depth.
    wear: f64,
    #[serde(flatten)]
    found: DeltaSte,
    /// Limit of P90.
    #[serde(skip_serializing_if = "Option::is_none")]
    delta_ste_max_um: Option<f64>,
}

/// ΔSTE of a pair without random effects, and of random pairs.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct DeltaSte {
    delta_ste_um: f64,
    /// P90 over the random pairs of the simulation, and its 95 % interval.
    #[serde(skip_serializing_if = "Option::is_none")]
    p90_um: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    p90_interval_um: Option<[f64; 2]>,
}

impl DeltaSte {
    /// `samples` are of random pairs; empty if none were simulated.
    fn of(delta_ste_um: f64, samples: &[f64]) -> anyhow::Result<Self> {
        let p90 = match samples.is_empty() {
            true => None,
            false => Some(stats::order_statistic(samples, 0.9, 0.95)?),
        };
        Ok(Self {
            delta_ste_um,
            p90_um: p90.map(|p90| p90.value),
            p90_interval_um: p90.and_then(|p90| p90.interval.map(<[f64; 2]>::from)),
        })
    }

    fn describe(&self) -> String {
        let interval = self
            .p90_interval_um
            .map_or_else(String::new, |[low, high]| {
                format!(" [{}; {}]", fixed(low, 4), fixed(high, 4))
            });
        let p90 = self.p90_um.map_or_else(String::new, |p90| {
            format!(", P90 {}{interval}", fixed(p90, 4))
        });
        format!("ΔSTE {}{p90} µm", fixed(self.delta_ste_um, 4))
    }
}

impl Cases {
    /// The cases of a file; none without `[[load.cases]]`. Random pairs have the random numbers of the simulation.
    pub(super) fn of(pair: &Pair, file: &PairFile, request: Request) -> anyhow::Result<Self> {
        let load = &file.load;
        if load.cases.is_empty() {
            return Ok(Self::default());
        }
        let loaded = LoadedCases::new(pair.clone(), load, &file.wear, file.scatter())?;
        let analyses = match request.wear {
            WearChoice::None => loaded.unworn(),
            WearChoice::Archard | WearChoice::Random => loaded.worn(),
        };
        let mut sampler = loaded.sampler();
        let drawn: Vec<Vec<f64>> = match request.wear {
            WearChoice::Random => (0..u64::from(request.samples))
                .map(|sample| sampler.draw(&mut stream(request.seed, Purpose::Wear, 0, sample)))
                .collect(),
            WearChoice::None | WearChoice::Archard => Vec::new(),
        };
        let values: Vec<f64> = analyses.iter().map(|one| one.delta_ste_um).collect();
        let each = load.cases.iter().zip(load.case_names()).enumerate();
        let each = each.map(|(place, (case, name))| {
            let samples: Vec<f64> = drawn.iter().map(|sample| sample[place]).collect();
            Ok(CaseFigures {
                name,
                pinion_torque_nm: load.torque_of(case),
                wear: match request.wear {
                    WearChoice::None => 0.0,
                    WearChoice::Archard | WearChoice::Random => case.wear,
                },
                found: DeltaSte::of(values[place], &samples)?,
                delta_ste_max_um: case.delta_ste_max_um,
            })
        });
        let combined: Vec<f64> = drawn.iter().map(|sample| load.combined(sample)).collect();
        Ok(Self {
            each: each.collect::<anyhow::Result<_>>()?,
            all: Some(Combined {
                combination: match load.weights() {
                    Some(_) => "weighted mean",
                    None => "greatest",
                },
                found: DeltaSte::of(load.combined(&values), &combined)?,
            }),
        })
    }

    /// The cases and the measure over all of them, in words.
    pub(super) fn rows(&self) -> impl Iterator<Item = (String, String)> {
        let all = self.all.iter().map(|all| {
            let name = format!("all cases, {}", all.combination);
            (name, all.found.describe())
        });
        self.each.iter().map(CaseFigures::row).chain(all)
    }
}

impl CaseFigures {
    /// The constraint on the case's P90, if it has a limit and random pairs were simulated.
    pub(super) fn constraint(&self) -> Option<Constraint> {
        let name = format!("P90 of ΔSTE, case {}", self.name);
        let (value, limit) = (self.found.p90_um?, self.delta_ste_max_um?);
        Some(Constraint::new(name, "µm", value, Bound::AtMost, limit))
    }

    /// The case and its figures, in words.
    pub(super) fn row(&self) -> (String, String) {
        let wear = match self.wear {
            0.0 => "new".to_owned(),
            1.0 => "mean wear".to_owned(),
            share => format!("{share} of the mean wear"),
        };
        (
            format!("case {}", self.name),
            format!(
                "{} N·m, {wear}: {}",
                self.pinion_torque_nm,
                self.found.describe()
            ),
        )
    }
}
