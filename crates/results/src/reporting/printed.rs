//! The designs that the paper prints, on this model.

use campaign::file::{PercentileRule, Sampling};
use gear::paper::printed::{self as paper, Place};
use stages::references::design;
use stages::responses::{self, Samples};

use crate::report::{
    Illustration, ModelFigure, PreliminaryDesign, PrintedDesign, PrintedFigures, SimilarDesign,
    drawing, ste,
};
use crate::snapshot::Snapshot;

pub(super) fn preliminary(snapshot: &Snapshot) -> Vec<PreliminaryDesign> {
    let sampling = &snapshot.problem.campaign().sampling;
    let k = sampling.samples_per_design as usize;
    let of_paper = Sampling {
        percentile: Some(PercentileRule::Paper),
        ..*sampling
    };
    paper::PRELIMINARY
        .iter()
        .enumerate()
        .filter_map(|(row, printed)| {
            let samples = snapshot.printed.get(&Place::Preliminary(row))?;
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

pub(super) fn similar(snapshot: &Snapshot) -> Vec<SimilarDesign> {
    let sampling = &snapshot.problem.campaign().sampling;
    paper::SIMILAR
        .iter()
        .enumerate()
        .filter_map(|(row, printed)| {
            let place = Place::Similar(row);
            let gears = snapshot.problem.gears()?;
            let pair = gears.pair(&design(place)).ok()?;
            Some(SimilarDesign {
                variables: printed.variables,
                delta_ste_archard_um: pair.archard(gears.wear()).analysis.delta_ste_um,
                p90: sampling.verified(snapshot.printed.get(&place)?).ok(),
            })
        })
        .collect()
}

pub(super) fn printed_designs(snapshot: &Snapshot) -> Vec<PrintedDesign> {
    (6..=10)
        .map(|figure| PrintedDesign {
            figure,
            outcome: printed_figures(snapshot, figure),
            // The start of an optimisation; the others stand beside the campaign's own optima.
            illustration: (figure == 6).then(|| drawn(snapshot, figure)).flatten(),
        })
        .collect()
}

fn drawn(snapshot: &Snapshot, figure: u8) -> Option<Illustration> {
    let gears = snapshot.problem.gears()?;
    let pair = gears.pair(&design(Place::Figure(figure))).ok()?;
    Some(Illustration {
        converged_difference_um: None,
        drawing: drawing(&pair),
        ste: ste(&pair, gears.wear()),
        contact: None,
    })
}

fn printed_figures(snapshot: &Snapshot, figure: u8) -> Result<PrintedFigures, String> {
    let gears = snapshot.problem.gears().ok_or("no gears")?;
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
        _ => snapshot
            .printed
            .get(&Place::Figure(figure))
            .map_or(&[][..], Vec::as_slice),
    };
    let sampling = &snapshot.problem.campaign().sampling;
    let p90 = sampling.verified(samples).map_or(f64::NAN, |p90| p90.value);
    let criterion = match figure {
        6 | 7 => unworn.delta_ste_um,
        9 => worn.delta_ste_um,
        // The captions give a kriging prediction and an estimate from 30 samples; the model's
        // figure beside them is its own accurate percentile.
        _ => p90,
    };
    let notched = pair.root_stress().iter().any(|root| !root.in_range);
    let mut von_mises = ModelFigure::from(criteria.root_stress_mpa);
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
        p90_um: p90.into(),
    })
}
