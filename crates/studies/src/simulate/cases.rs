//! The pair of a file in each case of its load.

use gear::Pair;
use problem::PairFile;
use problem::formulation::gears::LoadedCases;
use problem::formulation::{Bound, Constraint};
use results::number::fixed;
use serde::Serialize;
use stats::streams::{Purpose, stream};

use super::{Request, WearChoice};

/// ΔSTE in one case.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct CaseFigures {
    name: String,
    pinion_torque_nm: f64,
    /// Share of the wear's depth.
    wear: f64,
    delta_ste_um: f64,
    /// P90 over the random pairs of the simulation, and its 95 % interval.
    #[serde(skip_serializing_if = "Option::is_none")]
    p90_um: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    p90_interval_um: Option<[f64; 2]>,
    /// Limit of P90.
    #[serde(skip_serializing_if = "Option::is_none")]
    delta_ste_max_um: Option<f64>,
}

impl CaseFigures {
    /// The cases of a file; none without `[[load.cases]]`. Random pairs have the random numbers of the simulation.
    pub(super) fn of(pair: &Pair, file: &PairFile, request: Request) -> anyhow::Result<Vec<Self>> {
        let load = &file.load;
        if load.cases.is_empty() {
            return Ok(Vec::new());
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
        let names = load.case_names();
        let each = load.cases.iter().zip(names).zip(analyses).enumerate();
        each.map(|(place, ((case, name), analysis))| {
            let samples: Vec<f64> = drawn.iter().map(|sample| sample[place]).collect();
            let p90 = match samples.is_empty() {
                true => None,
                false => Some(stats::order_statistic(&samples, 0.9, 0.95)?),
            };
            Ok(Self {
                name,
                pinion_torque_nm: load.torque_of(case),
                wear: match request.wear {
                    WearChoice::None => 0.0,
                    WearChoice::Archard | WearChoice::Random => case.wear,
                },
                delta_ste_um: analysis.delta_ste_um,
                p90_um: p90.map(|p90| p90.value),
                p90_interval_um: p90.and_then(|p90| p90.interval.map(<[f64; 2]>::from)),
                delta_ste_max_um: case.delta_ste_max_um,
            })
        })
        .collect()
    }

    /// The constraint on the case's P90, if it has a limit and random pairs were simulated.
    pub(super) fn constraint(&self) -> Option<Constraint> {
        let name = format!("P90 of ΔSTE, case {}", self.name);
        let (value, limit) = (self.p90_um?, self.delta_ste_max_um?);
        Some(Constraint::new(name, "µm", value, Bound::AtMost, limit))
    }

    /// The case and its figures, in words.
    pub(super) fn row(&self) -> (String, String) {
        let wear = match self.wear {
            0.0 => "new".to_owned(),
            1.0 => "mean wear".to_owned(),
            share => format!("{share} of the mean wear"),
        };
        let interval = self
            .p90_interval_um
            .map_or_else(String::new, |[low, high]| {
                format!(" [{}; {}]", fixed(low, 4), fixed(high, 4))
            });
        let p90 = self.p90_um.map_or_else(String::new, |p90| {
            format!(", P90 {}{interval}", fixed(p90, 4))
        });
        (
            format!("case {}", self.name),
            format!(
                "{} N·m, {wear}: ΔSTE {}{p90} µm",
                self.pinion_torque_nm,
                fixed(self.delta_ste_um, 4)
            ),
        )
    }
}
