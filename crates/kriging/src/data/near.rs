//! Points that are nearly the same.

/// The groups of at least two points that are nearly the same: sorted by one coordinate after the other and
/// divided wherever the next point is more than that coordinate's entry of `nearly` away. Points of a
/// group may differ by more where others lie between them.
pub(crate) fn groups(columns: &[Vec<f64>], nearly: &[f64], n: usize) -> Vec<Vec<usize>> {
    let mut groups = Vec::new();
    let mut open = vec![((0..n).collect::<Vec<usize>>(), 0)];
    while let Some((mut group, j)) = open.pop() {
        let Some(column) = columns.get(j) else {
            group.sort_unstable();
            groups.push(group);
            continue;
        };
        group.sort_by(|&a, &b| column[a].total_cmp(&column[b]));
        let close = |a: &usize, b: &usize| column[*b] - column[*a] <= nearly[j];
        let parts = group.chunk_by(close).filter(|part| part.len() > 1);
        open.extend(parts.map(|part| (part.to_vec(), j + 1)));
    }
    groups.sort_unstable();
    groups
}
