//! The order in which regions get their turns.

use crate::context::Context;

/// Gives every [`Options::global_every`](crate::Options::global_every)-th turn to the whole box and
/// the others to the basins in rotation. Exhausted regions are passed over.
pub(crate) struct Rotation {
    /// Whether a region may have turns: the basins first, the whole box last.
    is_open: Vec<bool>,
    /// The basin whose turn is next.
    next: usize,
    /// Number of turns before this round.
    before: usize,
    global_every: usize,
}

impl Rotation {
    /// A batch that is too small for all regions goes on where the last round ended, so that every
    /// region has its turn within some rounds. Larger batches begin with the best basin.
    pub(crate) fn new(context: &Context<'_>, basins: usize) -> Self {
        let (batch, global_every) = (context.options.batch, context.options.global_every);
        let is_small = batch < global_every.max(basins + 1);
        let before = if is_small { context.round * batch } else { 0 };
        Self {
            is_open: vec![true; basins + 1],
            next: before - before / global_every,
            before,
            global_every,
        }
    }

    /// The region of a turn; `None` if all are exhausted. The whole box has the last number.
    pub(crate) fn region(&mut self, turn: usize) -> Option<usize> {
        let whole = self.is_open.len() - 1;
        let is_open = |&i: &usize| self.is_open[i];
        let is_global = (self.before + turn) % self.global_every == self.global_every - 1;
        if is_global && is_open(&whole) {
            return Some(whole);
        }
        let basin = (self.next..self.next + whole)
            .map(|i| i % whole)
            .find(is_open);
        if let Some(basin) = basin {
            self.next = basin + 1;
        }
        basin.or_else(|| Some(whole).filter(is_open))
    }

    /// Gives a region no more turns in this round.
    pub(crate) fn close(&mut self, region: usize) {
        self.is_open[region] = false;
    }
}
