//! More samples at the recommended design.

use crate::batch::Batch;
use crate::{Infill, Options, Recommendation, Z95};

/// The fewest turns of a confirmation: new samples tell less than their number suggests, because the
/// model has learned part of it from correlated neighbours.
const CONFIRMING: f64 = 6.0;

/// Gives the recommended design as many samples as bring the half-width of its interval to δ, within
/// a batch, if no other observation is worth the effort.
pub(crate) fn confirm(options: &Options, best: &Recommendation, batch: &mut Batch) {
    let half = best.half_width();
    if !batch.infill.is_empty() || half < options.delta_um {
        return;
    }
    let sd = half / Z95;
    let wanted = options.delta_um / Z95;
    // Precisions add up: 1/s² now, and k/v from k more samples.
    let lacking = (1.0 / (wanted * wanted) - 1.0 / (sd * sd)).max(0.0);
    let turns = (lacking * best.sd_of_sample_um.powi(2) / f64::from(options.samples_more))
        .ceil()
        .max(CONFIRMING)
        .min(options.batch as f64);
    // At least 1 and at most a batch.
    let samples = (turns as u32)
        .saturating_mul(options.samples_more)
        .min(batch.left);
    batch.left -= samples;
    batch.infill.push(Infill::More {
        design: best.design,
        samples,
        value: 0.0,
    });
}
