//! The look-up of the cell of an uneven grid that holds a place, through even bins.
//!
//! A new design looks up hundreds of places, and every second comparison of a binary search is a mispredicted branch.

/// Bins per node.
const DENSITY: usize = 2;

/// An index of increasing nodes.
#[derive(Debug, Clone)]
pub(crate) struct CellIndex {
    start: f64,
    /// Bins per length.
    density: f64,
    /// For each bin the number of nodes up to its start.
    before: Vec<u32>,
}

impl CellIndex {
    /// The index of `nodes`, of which there are two at least.
    pub(crate) fn new(nodes: &[f64]) -> Self {
        let (start, end) = (nodes[0], nodes[nodes.len() - 1]);
        let bins = DENSITY * nodes.len();
        let width = (end - start) / bins as f64;
        let mut count = 0;
        let before = (0..bins).map(|bin| {
            let from = start + bin as f64 * width;
            while count < nodes.len() && nodes[count] <= from {
                count += 1;
            }
            count as u32
        });
        Self {
            before: before.collect(),
            density: 1.0 / width,
            start,
        }
    }

    /// The cell that holds `s`; the first or the last one for a place outside all.
    pub(crate) fn cell(&self, nodes: &[f64], s: f64) -> usize {
        // A place before all, or a NaN, becomes 0.
        let bin = ((s - self.start) * self.density) as usize;
        let mut count = self.before[bin.min(self.before.len() - 1)] as usize;
        while count < nodes.len() && nodes[count] <= s {
            count += 1;
        }
        // The start of a bin is known up to rounding.
        while count > 0 && nodes[count - 1] > s {
            count -= 1;
        }
        count.clamp(1, nodes.len() - 1) - 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_place_has_the_cell_of_a_binary_search() {
        let even = (0..50).map(|k| 3.0 + 0.1 * f64::from(k));
        let halved = (0..40).map(|k| 1.0 - 0.5_f64.powi(k));
        let grids = [even.collect(), halved.collect(), vec![-1.0, 7.0]];
        for nodes in grids {
            let nodes: Vec<f64> = nodes;
            let index = CellIndex::new(&nodes);
            let (first, last) = (nodes[0], nodes[nodes.len() - 1]);
            let between = (-20..=1020).map(|k| first + (last - first) * f64::from(k) / 1000.0);
            let beside = nodes.iter().flat_map(|s| [s.next_down(), *s, s.next_up()]);
            for s in between.chain(beside).chain([f64::NAN, f64::INFINITY]) {
                let searched = nodes.partition_point(|node| *node <= s);
                let expected = searched.clamp(1, nodes.len() - 1) - 1;
                assert_eq!(index.cell(&nodes, s), expected, "{s} in {nodes:?}");
            }
        }
    }
}
