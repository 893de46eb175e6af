//! The work that is missing until a DoE is sampled.

use std::collections::BTreeMap;
use std::ops::Range;

use crate::Error;
use crate::connection::Connection;
use crate::designs::{self, DesignRow};

/// The missing work of a design.
#[derive(Debug, Clone, PartialEq)]
pub struct MissingWork {
    /// The design.
    pub design: DesignRow,
    /// Whether its criteria are missing.
    pub criteria: bool,
    /// The missing samples, as disjoint ascending ranges. For a design whose criteria are missing
    /// they are needed only if it proves simulable.
    pub samples: Vec<Range<u64>>,
}

/// The designs that lack criteria, or that are simulable, not ruled out, and lack samples below
/// `wanted` or below their larger number in `more`.
pub(crate) async fn work(
    connection: &mut Connection<'_>,
    wanted: u64,
    more: &BTreeMap<u64, u64>,
) -> Result<Vec<MissingWork>, Error> {
    let limit = limit(wanted);
    // The query skips designs that have enough samples without gaps.
    let query = sqlx::query!(
        r#"SELECT design.design AS "design!: u64",
                  criteria.design IS NULL AS "without_criteria!: bool",
                  coalesce(sample_tally.samples, 0) AS "samples!: u64",
                  coalesce(sample_tally.samples > sample_tally.last_sample, TRUE)
                      AS "without_gaps!: bool"
           FROM design
           LEFT JOIN criteria ON criteria.design = design.design
           LEFT JOIN sample_tally ON sample_tally.stream = design.design
           WHERE criteria.design IS NULL
              OR criteria.simulable = 1 AND criteria.reason IS NULL
                 AND (coalesce(sample_tally.samples, 0) < ?1
                      OR sample_tally.samples <= sample_tally.last_sample)
           ORDER BY design.design"#,
        limit,
    );
    let mut missing = BTreeMap::new();
    for row in connection.all(query).await? {
        let samples = if row.without_gaps {
            // Without gaps, the missing samples are known without reading any.
            gaps(std::iter::once(0..row.samples), wanted)
        } else {
            samples(connection, row.design, wanted).await?
        };
        if row.without_criteria || !samples.is_empty() {
            missing.insert(row.design, (row.without_criteria, samples));
        }
    }
    for (&design, &wanted) in more {
        let samples = samples(connection, design, wanted).await?;
        if let Some((_, missing)) = missing.get_mut(&design) {
            *missing = samples;
        } else if !samples.is_empty() {
            missing.insert(design, (false, samples));
        }
    }
    let mut work = Vec::with_capacity(missing.len());
    if missing.is_empty() {
        return Ok(work);
    }
    for design in designs::all(connection).await? {
        if let Some((criteria, samples)) = missing.remove(&design.design) {
            work.push(MissingWork {
                design,
                criteria,
                samples,
            });
        }
    }
    Ok(work)
}

/// No sample beyond `i64::MAX` can be stored, so none is missing there.
fn limit(wanted: u64) -> i64 {
    i64::try_from(wanted).unwrap_or(i64::MAX)
}

/// The missing samples of one design in `0..wanted`.
async fn samples(
    connection: &mut Connection<'_>,
    design: u64,
    wanted: u64,
) -> Result<Vec<Range<u64>>, Error> {
    let (design, limit) = (design.cast_signed(), limit(wanted));
    let query = sqlx::query!(
        r#"SELECT first_sample AS "first: u64", length(samples) / (8 * responses) AS "samples!: u64"
           FROM sample_block WHERE stream = ? AND first_sample < ? ORDER BY first_sample"#,
        design,
        limit,
    );
    let blocks = connection.all(query).await?;
    let stored = blocks
        .into_iter()
        .map(|row| row.first..row.first + row.samples);
    Ok(gaps(stored, limit.cast_unsigned()))
}

/// The parts of `0..wanted` that the ascending ranges `stored` leave out.
fn gaps(stored: impl IntoIterator<Item = Range<u64>>, wanted: u64) -> Vec<Range<u64>> {
    let mut gaps = Vec::new();
    let mut next = 0;
    for range in stored {
        if range.start.min(wanted) > next {
            gaps.push(next..range.start.min(wanted));
        }
        next = range.end;
    }
    if next < wanted {
        gaps.push(next..wanted);
    }
    gaps
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_are_what_is_not_stored() {
        let gaps = |stored: &[(u64, u64)], wanted| {
            gaps(stored.iter().map(|&(start, end)| start..end), wanted)
                .into_iter()
                .map(|gap| (gap.start, gap.end))
                .collect::<Vec<_>>()
        };
        assert_eq!(gaps(&[], 0), []);
        assert_eq!(gaps(&[], 3), [(0, 3)]);
        assert_eq!(gaps(&[(0, 2), (2, 3)], 3), []);
        assert_eq!(gaps(&[(0, 9)], 3), []);
        assert_eq!(gaps(&[(1, 3), (5, 6)], 8), [(0, 1), (3, 5), (6, 8)]);
        assert_eq!(gaps(&[(0, 1), (7, 20)], 8), [(1, 7)]);
        assert_eq!(gaps(&[(0, 1), (7, 20), (30, 31)], 5), [(1, 5)]);
    }
}
