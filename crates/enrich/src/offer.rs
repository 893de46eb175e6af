//! The best observations of one region, which compete by value per sample.

use rayon::prelude::*;

use crate::Error;
use crate::context::Context;
use crate::criterion::{self, InfillCriterion};
use crate::models::Region;
use crate::search::{Candidate, search};

/// Share of δ from which an observation is worth making: several small gains add up.
const WORTHWHILE: f64 = 0.25;

/// The best new design of a region, and the sampled design where more samples are worth most.
#[derive(Debug)]
pub(crate) struct Offer {
    new: Option<Candidate>,
    /// A row and the value of more samples there.
    more: Option<(usize, f64)>,
}

/// The better observation of an offer.
#[derive(Debug, PartialEq)]
pub(crate) enum Winner {
    New(Candidate),
    /// More samples at a row.
    More {
        row: usize,
        value: f64,
    },
}

impl Offer {
    /// Finds the offer of a region without regard to the budget: the possible gain of a region does
    /// not depend on whether the budget pays for it.
    pub(crate) fn find(context: &Context<'_>, region: &Region, turn: usize) -> Result<Self, Error> {
        let (rows, options) = (&context.rows, context.options);
        let criterion = criterion::prepare(&region.model, rows, &region.incumbents, options)?;
        let mut rng = context.rng(turn);
        Ok(Self {
            new: search(context, region, criterion.as_ref(), &mut rng)?,
            more: most_promising(context, region, criterion.as_ref()),
        })
    }

    /// The highest value in the region.
    pub(crate) fn value(&self) -> f64 {
        let new = self.new.as_ref().map_or(0.0, |candidate| candidate.value);
        new.max(self.more.map_or(0.0, |(_, value)| value))
    }

    /// The observation with the higher value per sample among those that `left` samples pay for.
    /// `None` if neither is worth the effort.
    pub(crate) fn winner(self, context: &Context<'_>, left: u32) -> Option<Winner> {
        let options = context.options;
        let (cost_new, cost_more) = (options.samples_new, options.samples_more);
        let affordable = Self {
            new: self.new.filter(|_| cost_new <= left),
            more: self.more.filter(|_| cost_more <= left),
        };
        if affordable.value() < WORTHWHILE * options.delta_um {
            return None;
        }
        let per_sample = |value: f64, samples: u32| value / f64::from(samples);
        match (affordable.new, affordable.more) {
            (Some(candidate), Some((row, value)))
                if per_sample(value, cost_more) > per_sample(candidate.value, cost_new) =>
            {
                Some(Winner::More { row, value })
            }
            (Some(candidate), _) => (candidate.value > 0.0).then_some(Winner::New(candidate)),
            (None, Some((row, value))) => (value > 0.0).then_some(Winner::More { row, value }),
            (None, None) => None,
        }
    }
}

/// The feasible incumbent where more samples are worth most, and their value.
fn most_promising(
    context: &Context<'_>,
    region: &Region,
    criterion: &dyn InfillCriterion,
) -> Option<(usize, f64)> {
    let sampled = &context.rows.sampled;
    let feasible = region.incumbents.par_iter().copied();
    let values: Vec<(usize, f64)> = feasible
        .filter(|&i| sampled[i].violation <= 0.0)
        .map(|i| (i, criterion.more_samples(&sampled[i])))
        .collect();
    values.into_iter().max_by(|a, b| a.1.total_cmp(&b.1))
}
