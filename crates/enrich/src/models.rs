//! The models of a round and the regions that infill points are sought in.

use kriging::Warning;
use rayon::prelude::*;

use crate::context::Context;
use crate::surrogate::Surrogate;
use crate::{Note, Recommendation, Z95};

/// Share by which a trust region exceeds the designs it spans, on each side.
const WIDER: f64 = 0.1;
/// Smallest half-width of a trust region, as a share of the range.
const LEAST: f64 = 0.005;
/// Smallest distance between the centres of two basins, as a share of the ranges.
const APART: f64 = 0.15;

/// A part of the box and the model that chooses infill points in it.
pub(crate) struct Region {
    pub(crate) model: Surrogate,
    pub(crate) bounds: Vec<(f64, f64)>,
    /// The row with the lowest upper quantile; the search begins there.
    pub(crate) best: usize,
    /// The rows in the region that are to be improved on.
    pub(crate) incumbents: Vec<usize>,
}

/// The regions of a round.
pub(crate) struct Regions {
    /// The basins in the order of their best designs, the best one first. A basin is listed once
    /// for each of its models.
    pub(crate) basins: Vec<Region>,
    /// The whole box, with the model of all designs.
    pub(crate) whole: Region,
}

impl Regions {
    /// Fits the models. `None`, with a note of the reason, if no model could be fitted or all responses are
    /// equal.
    pub(crate) fn fit(context: &Context<'_>, notes: &mut Vec<Note>) -> Option<Self> {
        let rows = &context.rows;
        let all: Vec<usize> = (0..rows.sampled.len()).collect();
        let global = match Surrogate::fit(rows, &all, context.options) {
            Ok(models) => models,
            Err(error) => {
                let reason = error.to_string();
                notes.push(Note::NoModel { reason });
                return None;
            }
        };
        for warning in global[0].warnings() {
            match warning {
                Warning::ConstantResponse => {
                    notes.push(Note::Plateau);
                    return None;
                }
                Warning::NoStructure { .. } => notes.push(Note::NoStructure),
                _ => {}
            }
        }
        let incumbents = rows.incumbents(&all);
        if rows.sampled[incumbents[0]].violation > 0.0 {
            notes.push(Note::NoFeasibleDesign);
        }
        let found: Vec<(Vec<Region>, Vec<Note>)> = centres(context, &global[0], &incumbents)
            .into_par_iter()
            .map(|centre| basin(context, &global, centre))
            .collect();
        let (mut basins, notes_on_basins): (Vec<Vec<Region>>, Vec<Vec<Note>>) =
            found.into_iter().unzip();
        notes.extend(notes_on_basins.into_iter().flatten());
        // A local model may order the basins differently than the model of all designs.
        let quantile = |b: &Vec<Region>| upper_quantile(context, &b[0].model, b[0].best);
        basins.sort_by(|a, b| quantile(a).total_cmp(&quantile(b)));
        let basins: Vec<Region> = basins.into_iter().flatten().collect();
        let whole = Region {
            best: basins.first()?.best,
            model: global.into_iter().next()?,
            bounds: context.options.bounds.intervals().to_vec(),
            incumbents,
        };
        Some(Self { basins, whole })
    }

    /// Number of regions.
    pub(crate) fn count(&self) -> usize {
        self.basins.len() + 1
    }

    /// The region with a number: the basins come first, the whole box is the last one.
    pub(crate) fn get(&self, region: usize) -> &Region {
        self.basins.get(region).unwrap_or(&self.whole)
    }

    /// Updates every model as if `samples` samples at `x` had confirmed the model's own prediction.
    pub(crate) fn believe(&mut self, x: &[f64], samples: u32) {
        let regions = self.basins.par_iter_mut().chain([&mut self.whole]);
        regions.for_each(|region| {
            // A point too near to another one cannot be added, and the model needs none there.
            if let Ok(after) = region.model.kriging_believer(x, samples) {
                region.model = after;
            }
        });
    }

    /// The best design of the best basin, if it is feasible.
    pub(crate) fn recommendation(&self, context: &Context<'_>) -> Option<Recommendation> {
        let basin = self.basins.first()?;
        let row = &context.rows.sampled[basin.best];
        if row.violation > 0.0 {
            return None;
        }
        let belief = basin.model.belief(&row.x, row.baseline);
        let predicted = belief.response_quantile(0.0);
        // To first order, a small change of a logarithm is a change of the response in proportion.
        let scale = if belief.logarithm { predicted } else { 1.0 };
        Some(Recommendation {
            design: context.rows.index[basin.best],
            x: row.x.clone(),
            predicted,
            interval: (
                belief.response_quantile(-Z95),
                belief.response_quantile(Z95),
            ),
            sd_of_sample_um: basin.model.noise(1).sqrt() * scale,
        })
    }
}

/// The rows that basins are built around: good designs that are far apart, the best one first.
fn centres(context: &Context<'_>, model: &Surrogate, incumbents: &[usize]) -> Vec<usize> {
    let mut ordered: Vec<(f64, usize)> = incumbents
        .iter()
        .map(|&i| (upper_quantile(context, model, i), i))
        .collect();
    ordered.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let x = |i: usize| &context.rows.sampled[i].x;
    let mut centres: Vec<usize> = Vec::new();
    for (_, i) in ordered {
        let apart = |&c: &usize| context.distance(x(c), x(i)) >= APART;
        if centres.len() < context.options.basins && centres.iter().all(apart) {
            centres.push(i);
        }
    }
    centres
}

/// The basin around a row, once for each model, the one with the smaller residuals first. A model of
/// the nearest designs replaces that of all designs where its residuals are smaller.
fn basin(context: &Context<'_>, global: &[Surrogate], centre: usize) -> (Vec<Region>, Vec<Note>) {
    let mut notes = Vec::new();
    let rows = &context.rows;
    let x = &rows.sampled[centre].x;
    let mut near: Vec<usize> = (0..rows.sampled.len()).collect();
    near.sort_by(|&a, &b| {
        let to = |i: usize| context.distance(x, &rows.sampled[i].x);
        to(a).total_cmp(&to(b)).then(a.cmp(&b))
    });
    let bounds = trust_region(context, x, &near);
    near.truncate(context.options.local_points);
    let is_local = near.len() < rows.sampled.len();
    let refits = if is_local {
        Surrogate::fit(rows, &near, context.options).unwrap_or_default()
    } else {
        Vec::new()
    };
    let mut models = Vec::new();
    for model in global {
        let global_rmse = model.error_at(rows, &near);
        let plain = |w: &Warning| matches!(w, Warning::NoStructure { .. });
        let refit = refits.iter().find(|refit| refit.has_scale_of(model));
        let local = refit.map(|refit| (refit, refit.error_at(rows, &near)));
        match local {
            Some((refit, local_rmse))
                if local_rmse < global_rmse && !refit.warnings().iter().any(plain) =>
            {
                notes.push(Note::LocalRefit {
                    design: rows.index[centre],
                    global_rmse,
                    local_rmse,
                });
                models.push((local_rmse, refit.clone()));
            }
            _ => models.push((global_rmse, model.clone())),
        }
    }
    models.sort_by(|a, b| a.0.total_cmp(&b.0));
    let regions = models.into_iter().map(|(_, model)| {
        let inside = |i: &&usize| {
            let mut sides = bounds.iter().zip(&rows.sampled[**i].x);
            sides.all(|((low, high), v)| (*low..=*high).contains(v))
        };
        let within: Vec<usize> = model.rows.iter().filter(inside).copied().collect();
        let incumbents = if within.is_empty() {
            vec![centre]
        } else {
            rows.incumbents(&within)
        };
        let best = incumbents
            .iter()
            .map(|&i| (upper_quantile(context, &model, i), i))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map_or(centre, |(_, i)| i);
        Region {
            model,
            bounds: bounds.clone(),
            best,
            incumbents,
        }
    });
    (regions.collect(), notes)
}

/// The quantile by which designs are compared.
fn upper_quantile(context: &Context<'_>, model: &Surrogate, row: usize) -> f64 {
    let row = &context.rows.sampled[row];
    let belief = model.belief(&row.x, row.baseline);
    belief.response_quantile(context.options.quantile_z)
}

/// The box around the nearest designs.
fn trust_region(context: &Context<'_>, centre: &[f64], nearest: &[usize]) -> Vec<(f64, f64)> {
    let options = context.options;
    let spanned = &nearest[..options.region_points.min(nearest.len())];
    let intervals = options.bounds.intervals().iter().enumerate();
    intervals
        .map(|(j, &(low, high))| {
            let reach = spanned
                .iter()
                .map(|&i| (context.rows.sampled[i].x[j] - centre[j]).abs())
                .fold(0.0, f64::max);
            let half = ((1.0 + WIDER) * reach).max(LEAST * (high - low));
            ((centre[j] - half).max(low), (centre[j] + half).min(high))
        })
        .collect()
}
