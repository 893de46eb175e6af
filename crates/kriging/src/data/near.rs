//! Points that are nearly the same.

use std::collections::BTreeMap;

/// The groups of at least two points that are nearly the same: in no coordinate do they differ by more than that
/// coordinate's entry of `nearly`. Points of a group may differ by more where others lie between them.
pub(crate) fn groups(columns: &[Vec<f64>], nearly: &[f64], n: usize) -> Vec<Vec<usize>> {
    let mut groups = Vec::new();
    let mut open = vec![((0..n).collect::<Vec<usize>>(), 0)];
    while let Some((mut group, j)) = open.pop() {
        let Some(column) = columns.get(j) else {
            groups.extend(connected(columns, nearly, group));
            continue;
        };
        // Splitting by single coordinates is cheap and suffices for few points. Many points form one chain in each.
        group.sort_by(|&a, &b| column[a].total_cmp(&column[b]));
        let close = |a: &usize, b: &usize| column[*b] - column[*a] <= nearly[j];
        let parts = group.chunk_by(close).filter(|part| part.len() > 1);
        open.extend(parts.map(|part| (part.to_vec(), j + 1)));
    }
    groups.sort_unstable();
    groups
}

/// Divides points into those that are connected by points near each other in every coordinate.
fn connected(columns: &[Vec<f64>], nearly: &[f64], mut group: Vec<usize>) -> Vec<Vec<usize>> {
    let near = |a: usize, b: usize| {
        let mut sides = columns.iter().zip(nearly);
        sides.all(|(column, nearly)| (column[b] - column[a]).abs() <= *nearly)
    };
    // The extent in units of `nearly`. Where it is largest, the fewest points are expected near a given one.
    let spread = |j: &usize| {
        let values = || group.iter().map(|&i| columns[*j][i]);
        let (low, high) = (
            values().fold(f64::INFINITY, f64::min),
            values().fold(f64::NEG_INFINITY, f64::max),
        );
        (high - low) / nearly[*j]
    };
    let widest = (0..columns.len()).max_by(|a, b| spread(a).total_cmp(&spread(b)));
    let Some(widest) = widest else {
        return vec![group];
    };
    let column = &columns[widest];
    group.sort_by(|&a, &b| column[a].total_cmp(&column[b]));
    let mut parent: Vec<usize> = (0..group.len()).collect();
    let root = |parent: &[usize], mut i: usize| {
        while parent[i] != i {
            i = parent[i];
        }
        i
    };
    for (i, &a) in group.iter().enumerate() {
        let followers = group[i + 1..].iter().enumerate();
        for (j, &b) in followers.take_while(|(_, b)| column[**b] - column[a] <= nearly[widest]) {
            if near(a, b) {
                let (one, other) = (root(&parent, i), root(&parent, i + 1 + j));
                parent[one.max(other)] = one.min(other);
            }
        }
    }
    let mut parts: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (i, &point) in group.iter().enumerate() {
        parts.entry(root(&parent, i)).or_default().push(point);
    }
    let mut parts: Vec<Vec<usize>> = parts.into_values().filter(|part| part.len() > 1).collect();
    parts.iter_mut().for_each(|part| part.sort_unstable());
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    /// In each coordinate alone all points form one chain.
    #[test]
    fn many_points_are_no_group() {
        let mut columns = [2.0_f64, 3.0].map(|of| -> Vec<f64> {
            // A sequence that fills the square evenly.
            (0..5000)
                .map(|i| (f64::from(i) * of.sqrt()).fract())
                .collect()
        });
        for column in &mut columns {
            column.push(column[17] + 1e-4);
        }
        assert_eq!(groups(&columns, &[2e-3; 2], 5001), [[17, 5000]]);
    }
}
