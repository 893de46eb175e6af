//! The observations of a round, chosen one after the other.

use crate::context::Context;
use crate::expectation::Expectation;
use crate::models::Regions;
use crate::offer::{Offer, Winner};
use crate::rotation::Rotation;
use crate::{Error, Infill, Note, Reason};

/// The observations that a round asks for.
pub(crate) struct Batch {
    pub(crate) infill: Vec<Infill>,
    /// Number of samples left in the budget after these observations.
    pub(crate) left: u32,
    pub(crate) notes: Vec<Note>,
}

impl Batch {
    /// The new designs so far.
    pub(crate) fn new_designs(&self) -> impl Iterator<Item = &[f64]> {
        self.infill.iter().filter_map(|infill| match infill {
            Infill::New { x, .. } => Some(x.as_slice()),
            Infill::More { .. } => None,
        })
    }

    /// Chooses observations by the criterion until the batch is full or every region is exhausted.
    ///
    /// Regions that had no turn are consulted afterwards if the others expect less than δ or gave
    /// no observation. So an expectation below δ holds for every basin and the whole box, however
    /// small the batch is, and an empty batch means that no region has anything to observe.
    pub(crate) fn choose(
        &mut self,
        context: &Context<'_>,
        mut regions: Regions,
    ) -> Result<Expectation, Error> {
        let options = context.options;
        let mut rotation = Rotation::new(context, regions.basins.len());
        let mut expectation = Expectation::new(regions.count());
        let mut observations = 0;
        for turn in 0..options.batch {
            let Some(region) = rotation.region(turn) else {
                break;
            };
            let offer = Offer::find(context, regions.get(region), turn)?;
            expectation.record(region, offer.value());
            if self.take(context, &mut regions, region, offer) {
                observations += 1;
            } else {
                rotation.close(region);
            }
        }
        for region in 0..regions.count() {
            let is_settled = observations > 0 && expectation.expected_um >= options.delta_um;
            if is_settled || expectation.was_consulted(region) {
                continue;
            }
            // The random streams with lower numbers belong to the turns and to space filling.
            let offer = Offer::find(context, regions.get(region), 3 * options.batch + region)?;
            expectation.record(region, offer.value());
            if observations < options.batch && self.take(context, &mut regions, region, offer) {
                observations += 1;
            }
        }
        Ok(expectation)
    }

    /// Adds the winner of an offer to the batch; false if nothing was added.
    fn take(
        &mut self,
        context: &Context<'_>,
        regions: &mut Regions,
        region: usize,
        offer: Offer,
    ) -> bool {
        let options = context.options;
        let sampled = &context.rows.sampled;
        let (x, samples) = match offer.winner(context, self.left) {
            None => return false,
            Some(Winner::More { row, value }) => {
                let samples = options.samples_more;
                self.push_more(context.rows.index[row], samples, value);
                (sampled[row].x.clone(), samples)
            }
            Some(Winner::New(candidate)) => {
                let samples = options.samples_new;
                let mut rows = sampled.iter();
                if let Some(row) = rows.position(|row| context.is_same(&row.x, &candidate.x)) {
                    let design = context.rows.index[row];
                    self.notes.push(Note::Repeated { design });
                    // As many samples as the value was computed for; the budget suffices for them.
                    self.push_more(design, samples, candidate.value);
                    (sampled[row].x.clone(), samples)
                } else if self.new_designs().any(|x| context.is_same(x, &candidate.x)) {
                    return false;
                } else {
                    self.infill.push(Infill::New {
                        x: candidate.x.clone(),
                        samples,
                        value: candidate.value,
                        reason: if region == regions.basins.len() {
                            Reason::Global
                        } else {
                            Reason::Local
                        },
                    });
                    (candidate.x, samples)
                }
            }
        };
        self.left -= samples;
        regions.believe(&x, samples);
        true
    }

    /// Adds samples at a design; several turns at one design become one entry.
    fn push_more(&mut self, design: usize, samples: u32, value: f64) {
        let mut infill = self.infill.iter_mut();
        let earlier = infill.find_map(|infill| match infill {
            Infill::More {
                design: d, samples, ..
            } if *d == design => Some(samples),
            _ => None,
        });
        match earlier {
            Some(total) => *total += samples,
            None => self.infill.push(Infill::More {
                design,
                samples,
                value,
            }),
        }
    }
}
