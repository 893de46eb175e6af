//! Disjoint, ascending ranges of sample indices.

use std::collections::BTreeSet;
use std::ops::Range;

/// Whether two ranges have a sample in common.
pub(crate) const fn overlap(a: &Range<u32>, b: &Range<u32>) -> bool {
    a.start < b.end && b.start < a.end
}

/// Removes `taken` from disjoint, ascending `ranges`.
pub fn subtract(ranges: &mut Vec<Range<u32>>, taken: &Range<u32>) {
    if !ranges.iter().any(|range| overlap(range, taken)) {
        return;
    }
    *ranges = ranges
        .iter()
        .flat_map(|range| {
            [
                range.start..range.end.min(taken.start),
                range.start.max(taken.end)..range.end,
            ]
        })
        .filter(|range| range.start < range.end)
        .collect();
}

/// The ranges of `0..wanted` that are not in `stored`.
#[must_use]
pub fn gaps(stored: &BTreeSet<u32>, wanted: u32) -> Vec<Range<u32>> {
    let mut gaps = Vec::new();
    let mut next = 0;
    for &sample in stored.range(..wanted) {
        if sample > next {
            gaps.push(next..sample);
        }
        next = sample + 1;
    }
    if next < wanted {
        gaps.push(next..wanted);
    }
    gaps
}

/// The samples of `ranges` that lie in `within`.
pub(crate) fn common(ranges: &[Range<u32>], within: &Range<u32>) -> Vec<Range<u32>> {
    ranges
        .iter()
        .map(|range| range.start.max(within.start)..range.end.min(within.end))
        .filter(|range| range.start < range.end)
        .collect()
}

/// Sorts disjoint ranges and joins neighbours.
pub(crate) fn join(ranges: &mut Vec<Range<u32>>) {
    ranges.sort_by_key(|range| range.start);
    ranges.dedup_by(|next, range| {
        let touches = next.start == range.end;
        if touches {
            range.end = next.end;
        }
        touches
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_taken_away_and_put_back_leaves_one_range() {
        let mut ranges = vec![0..4, 6..20];
        subtract(&mut ranges, &(2..9));
        assert_eq!(ranges, [0..2, 9..20]);
        subtract(&mut ranges, &(12..14));
        assert_eq!(ranges, [0..2, 9..12, 14..20]);
        ranges.extend([12..14, 2..9]);
        join(&mut ranges);
        assert_eq!(ranges, vec![0..20]);
    }

    #[test]
    fn gaps_are_what_is_not_stored() {
        let stored = BTreeSet::from([0, 1, 5, 9]);
        assert_eq!(gaps(&stored, 8), [2..5, 6..8]);
        assert_eq!(gaps(&BTreeSet::new(), 3), vec![0..3]);
    }
}
