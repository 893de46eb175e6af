//! The designs that the paper prints, on this model.

use problem::file::{EstimatorRule, SIGNIFICANCE, Sampling};
use stages::references::design;
use stages::responses::{self, ControlledSamples};
use stats::IntervalEstimate;

use super::drawing::{self, Illustration};
use super::paper::{self, Place};
use crate::snapshot::Snapshot;

/// The paper's designs on this model.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PaperFigures {
    /// Tables 1 and 2.
    pub preliminary: Vec<PreliminaryDesign>,
    /// Table 4.
    pub similar: Vec<SimilarDesign>,
    /// Figures 6 to 10.
    pub designs: Vec<PrintedDesign>,
}

/// A preliminary design, simulated often enough to know its distribution.
#[derive(Debug, Clone, PartialEq)]
pub struct PreliminaryDesign {
    /// The row of Table 1, from 1.
    pub number: usize,
    /// The paper's row.
    pub printed: &'static paper::PreliminaryRow,
    /// Number of samples behind the statistics.
    pub samples: u64,
    /// Mean of ΔSTE, µm.
    pub mean_um: f64,
    /// Standard deviation of ΔSTE, µm.
    pub sd_um: f64,
    /// Estimated 90th percentile of ΔSTE, µm.
    pub p90_um: f64,
    /// p value of the Lilliefors test: small values speak against a normal distribution.
    pub lilliefors_p: f64,
    /// Variance of a percentile estimated from k samples, µm² (Equation (14)).
    pub p90_variance_um2: f64,
}

/// A design of Table 4.
#[derive(Debug, Clone, PartialEq)]
pub struct SimilarDesign {
    /// The row of Table 4, from 1.
    pub number: usize,
    /// The paper's row.
    pub printed: &'static paper::SimilarRow,
    /// ΔSTE with Archard's wear, µm.
    pub delta_ste_archard_um: f64,
    /// The 90th percentile; `None` without samples.
    pub p90: Option<IntervalEstimate>,
}

/// A design of Figures 6 to 10.
#[derive(Debug, Clone, PartialEq)]
pub struct PrintedDesign {
    pub printed: &'static paper::PrintedDesign,
    /// Its figures beside the model's, or why the design could not be simulated.
    pub figures: Result<Vec<PrintedFigure>, String>,
    /// Drawing and curves of a design that no approach of the campaign has.
    pub illustration: Option<Illustration>,
}

/// A figure of a printed design beside the model's.
#[derive(Debug, Clone, PartialEq)]
pub struct PrintedFigure {
    /// The paper's symbol.
    pub symbol: &'static str,
    /// The name on the page, as markup.
    pub markup: &'static str,
    /// The unit; empty for a number without one.
    pub unit: &'static str,
    /// The paper's value.
    pub printed: f64,
    /// The model's value.
    pub ours: f64,
    /// A remark on how they compare; may be empty.
    pub note: String,
}

impl PaperFigures {
    /// `None` if the campaign does not compare itself with the paper.
    pub(super) fn of(snapshot: &Snapshot) -> Option<Self> {
        let compares = snapshot.problem.campaign().compares_with_paper();
        compares.then(|| Self {
            preliminary: preliminary(snapshot),
            similar: similar(snapshot),
            designs: paper::PRINTED
                .iter()
                .map(|printed| PrintedDesign {
                    printed,
                    figures: figures(snapshot, printed),
                    // The start of an optimisation; the others stand beside the campaign's own optima.
                    illustration: (printed.figure == 6)
                        .then(|| illustration(snapshot, printed.figure))
                        .flatten(),
                })
                .collect(),
        })
    }
}

impl PreliminaryDesign {
    /// Whether the samples speak against a normal distribution.
    pub(super) fn is_not_normal(&self) -> bool {
        self.lilliefors_p < SIGNIFICANCE
    }
}

impl SimilarDesign {
    /// Number of samples behind the percentile.
    pub(super) fn samples(&self) -> u64 {
        self.p90.map_or(0, |p90| p90.n as u64)
    }
}

impl PrintedFigure {
    /// The model's value over the paper's, minus one.
    pub(super) fn gap(&self) -> f64 {
        paper::gap(self.ours, self.printed)
    }

    pub(super) fn is_notable(&self) -> bool {
        self.gap().abs() > paper::NOTABLE_GAP
    }

    /// The decimals that the paper prints.
    pub(super) fn decimals(&self) -> usize {
        match self.printed.abs() >= 100.0 {
            true => 0,
            false => 2,
        }
    }
}

fn preliminary(snapshot: &Snapshot) -> Vec<PreliminaryDesign> {
    let sampling = &snapshot.problem.campaign().sampling;
    let k = sampling.samples_per_design as usize;
    let of_paper = Sampling {
        estimator: Some(EstimatorRule::Paper),
        ..sampling.clone()
    };
    let rows = paper::PRELIMINARY.iter().enumerate();
    rows.filter_map(|(row, printed)| {
        let samples = snapshot.printed.get(&Place::Preliminary(row))?;
        // The test takes as many samples as the paper's, because the p value falls with the number of samples.
        let samples = &samples[..samples.len().min(paper::ACCURATE_SAMPLES)];
        let plain = ControlledSamples::plain(samples);
        let response = responses::response(0, plain, &of_paper).ok()?;
        let variance =
            stats::percentile_variance(response.standard_deviation.powi(2), k, of_paper.normal().z);
        Some(PreliminaryDesign {
            number: row + 1,
            printed,
            samples: samples.len() as u64,
            mean_um: response.mean,
            sd_um: response.standard_deviation,
            p90_um: response.measure,
            lilliefors_p: response.lilliefors_p.unwrap_or(f64::NAN),
            p90_variance_um2: variance.unwrap_or(f64::NAN),
        })
    })
    .collect()
}

fn similar(snapshot: &Snapshot) -> Vec<SimilarDesign> {
    let sampling = &snapshot.problem.campaign().sampling;
    let rows = paper::SIMILAR.iter().enumerate();
    rows.filter_map(|(row, printed)| {
        let place = Place::Similar(row);
        let gears = snapshot.problem.gears()?;
        let pair = gears.pair(&design(place)).ok()?;
        Some(SimilarDesign {
            number: row + 1,
            printed,
            delta_ste_archard_um: pair.archard(gears.wear()).analysis.delta_ste_um,
            p90: sampling.verified(snapshot.printed.get(&place)?).ok(),
        })
    })
    .collect()
}

fn illustration(snapshot: &Snapshot, figure: u8) -> Option<Illustration> {
    let gears = snapshot.problem.gears()?;
    let pair = gears.pair(&design(Place::Figure(figure))).ok()?;
    Some(Illustration {
        torque: None,
        grid_difference_um: None,
        drawing: drawing::drawing(&pair),
        ste: drawing::ste(&pair, gears.wear()),
        contact: None,
    })
}

fn figures(
    snapshot: &Snapshot,
    printed: &paper::PrintedDesign,
) -> Result<Vec<PrintedFigure>, String> {
    let place = Place::Figure(printed.figure);
    let gears = snapshot.problem.gears().ok_or("no gears")?;
    let pair = gears
        .pair(&design(place))
        .map_err(|error| error.to_string())?;
    let unworn = pair.unworn();
    let worn = pair.archard(gears.wear()).analysis;
    // Figures 6 and 7 are designs of the problem without wear, the others of problems with it.
    let analysis = if printed.figure <= 7 { &unworn } else { &worn };
    let pressure = analysis.hertz_pressure_mpa;
    let criteria = gears.pair_criteria(&pair, pressure);
    let sampling = &snapshot.problem.campaign().sampling;
    let samples = snapshot.printed.get(&place);
    let p90 = samples.and_then(|samples| sampling.verified(samples).ok());
    let p90 = p90.map_or(f64::NAN, |p90| p90.value);
    let criterion = match printed.figure {
        6 | 7 => unworn.delta_ste_um,
        9 => worn.delta_ste_um,
        // The captions give a kriging prediction and an estimate from 30 samples; the model's
        // figure beside them is its own accurate percentile.
        _ => p90,
    };
    let is_notched = pair.root_stress().iter().any(|root| !root.in_range);
    let figure = |symbol, markup, unit, printed, ours| PrintedFigure {
        symbol,
        markup,
        unit,
        printed,
        ours,
        note: String::new(),
    };
    // Contact ratio and sliding are those of whole involutes, as printed: the start of Figure 6 is undercut.
    let geometry = pair.geometry();
    let mut figures = vec![
        figure(
            "r_c",
            "contact ratio <var>ε</var><sub>γ</sub>",
            "",
            printed.contact_ratio,
            geometry.contact_ratio,
        ),
        figure(
            "g_s",
            "specific sliding <var>ζ</var>",
            "",
            printed.specific_slip,
            geometry
                .sliding_between([geometry.s_in, geometry.s_out])
                .max,
        ),
        PrintedFigure {
            note: match is_notched {
                true => "The notch factor’s formula is outside its range (1 to 8) here.".to_owned(),
                false => String::new(),
            },
            ..figure(
                "σ_vm",
                "root stress <var>σ</var><sub>vm</sub>",
                "MPa",
                printed.von_mises_mpa,
                criteria.root_stress_mpa,
            )
        },
        figure(
            "F",
            "contact pressure <var>p</var><sub>H</sub>",
            "MPa",
            printed.pressure_mpa,
            criteria.hertz_pressure_mpa,
        ),
        figure(
            printed.criterion,
            printed.criterion,
            "µm",
            printed.criterion_um,
            criterion,
        ),
    ];
    figures.extend(
        printed
            .p90_um
            .map(|printed| figure("P90", "P90 from 500 samples", "µm", printed, p90)),
    );
    Ok(figures)
}
