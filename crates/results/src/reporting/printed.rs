//! The designs that the paper prints, on this model.

use campaign::file::{PercentileRule, Sampling};
use gear::paper::printed::{self as paper, Place};
use report::{
    GearDrawing, PreliminaryDesign, PrintedDesign, PrintedFigures, SimilarDesign, SteCurves,
};
use stages::references::{design, name};
use stages::responses::{self, Samples};

use super::optima::{drawing, ste};
use super::sources::Sources;
use crate::percentile::percentile;

pub(super) fn preliminary(sources: &Sources) -> Vec<PreliminaryDesign> {
    let sampling = &sources.problem.campaign().sampling;
    let k = sampling.samples_per_design as usize;
    let of_paper = Sampling {
        percentile: Some(PercentileRule::Paper),
        ..*sampling
    };
    paper::PRELIMINARY
        .iter()
        .enumerate()
        .filter_map(|(row, printed)| {
            let samples = sources.verified.get(&name(Place::Preliminary(row)))?;
            // As many as the paper's: the p value falls with the number of samples.
            let samples = &samples[..samples.len().min(paper::ACCURATE_SAMPLES)];
            let plain = Samples::plain(samples);
            let response = responses::response(0, plain, &of_paper).ok()?;
            let variance =
                stats::p90_variance(response.standard_deviation.powi(2), k, of_paper.normal().z);
            Some(PreliminaryDesign {
                variables: printed.variables,
                samples: samples.len(),
                mean_um: response.mean,
                sd_um: response.standard_deviation,
                p90_um: response.percentile,
                lilliefors_p: response.lilliefors_p.unwrap_or(f64::NAN),
                p90_variance_um2: variance.unwrap_or(f64::NAN),
            })
        })
        .collect()
}

pub(super) fn similar(sources: &Sources) -> Vec<SimilarDesign> {
    let sampling = &sources.problem.campaign().sampling;
    paper::SIMILAR
        .iter()
        .enumerate()
        .filter_map(|(row, printed)| {
            let place = Place::Similar(row);
            let gears = sources.problem.gears()?;
            let pair = gears.pair(&design(place)).ok()?;
            Some(SimilarDesign {
                variables: printed.variables,
                delta_ste_archard_um: pair.archard(gears.wear()).analysis.delta_ste_um,
                p90: percentile(sampling, sources.verified.get(&name(place))?),
            })
        })
        .collect()
}

pub(super) fn printed_designs(sources: &Sources) -> Vec<PrintedDesign> {
    (6..=10)
        .map(|figure| PrintedDesign {
            figure,
            outcome: printed_figures(sources, figure),
            // The start of an optimisation; the others stand beside the campaign's own optima.
            drawing: (figure == 6).then(|| drawn(sources, figure)).flatten(),
        })
        .collect()
}

fn drawn(sources: &Sources, figure: u8) -> Option<(GearDrawing, SteCurves)> {
    let gears = sources.problem.gears()?;
    let pair = gears.pair(&design(Place::Figure(figure))).ok()?;
    Some((drawing(&pair), ste(&pair, gears.wear())))
}

fn printed_figures(sources: &Sources, figure: u8) -> Result<PrintedFigures, String> {
    let gears = sources.problem.gears().ok_or("no gears")?;
    let pair = gears
        .pair(&design(Place::Figure(figure)))
        .map_err(|error| error.to_string())?;
    let unworn = pair.unworn();
    let worn = pair.archard(gears.wear()).analysis;
    // Figures 6 and 7 are designs of the problem without wear, the others of problems with it.
    let analysis = if figure <= 7 { &unworn } else { &worn };
    let pressure = analysis.hertz_pressure_mpa;
    let criteria = gears.pair_criteria(&pair, pressure);
    let samples = match figure {
        6 => &[][..],
        _ => sources
            .verified
            .get(&name(Place::Figure(figure)))
            .map_or(&[][..], Vec::as_slice),
    };
    let p90 = percentile(&sources.problem.campaign().sampling, samples);
    let criterion = match figure {
        6 | 7 => unworn.delta_ste_um,
        9 => worn.delta_ste_um,
        // The captions give a kriging prediction and an estimate from 30 samples; the model's
        // figure beside them is its own accurate percentile.
        _ => p90.value,
    };
    let notched = pair.root_stress().iter().any(|root| !root.in_range);
    let mut von_mises = report::ModelFigure::from(criteria.root_stress_mpa);
    if notched {
        von_mises.note =
            "The notch factor’s formula is outside its range (1 to 8) here.".to_owned();
    }
    Ok(PrintedFigures {
        // That of whole involutes, as printed; the start of Figure 6 is undercut.
        contact_ratio: pair.geometry().contact_ratio.into(),
        specific_slip: criteria.specific_sliding.into(),
        von_mises_mpa: von_mises,
        pressure_mpa: criteria.hertz_pressure_mpa.into(),
        criterion: criterion.into(),
        p90_um: p90.value.into(),
    })
}
