//! The table of all results.

use problem::Approach;

use super::{PAPER_SECONDS, Row};

pub(super) fn table(rows: &[Row], enriched: &str) {
    println!(
        "\n| seed | method | P90, µm | 95 % interval | predicted, µm | worn calls | plain calls | CPU, s | s at 2 s a call |"
    );
    println!("|---:|---|---:|---|---|---:|---:|---:|---:|");
    for row in rows {
        let predicted = row.predicted.map_or("–".to_owned(), |(mean, low, high)| {
            format!("{mean:.3} [{low:.3}, {high:.3}]")
        });
        let slow = row.cpu + PAPER_SECONDS * (row.worn + row.plain) as f64;
        println!(
            "| {} | {} | {:.3} | [{:.3}, {:.3}] | {predicted} | {} | {} | {:.1} | {slow:.0} |",
            row.seed,
            row.method,
            row.p90,
            row.interval.0,
            row.interval.1,
            row.worn,
            row.plain,
            row.cpu
        );
    }
    let ours: Vec<&Row> = rows.iter().filter(|row| row.method == enriched).collect();
    let papers = [
        Approach::Nominal,
        Approach::Baseline,
        Approach::Kriging,
        Approach::BestOfDoe,
    ]
    .map(Approach::name);
    let wins = ours.iter().filter(|our| {
        let mut others = rows
            .iter()
            .filter(|row| row.seed == our.seed && papers.contains(&row.method.as_str()));
        others.all(|other| our.p90 < other.p90)
    });
    let holds = ours.iter().filter(|our| {
        let (low, high) = our.interval;
        our.predicted
            .is_some_and(|(mean, _, _)| (low..=high).contains(&mean))
    });
    // Both the model's prediction and the verification are uncertain.
    let agrees = ours.iter().filter(|our| {
        our.predicted.is_some_and(|(mean, low, high)| {
            let verified = 0.5 * (our.interval.1 - our.interval.0);
            (our.p90 - mean).abs() <= verified.hypot(0.5 * (high - low))
        })
    });
    println!(
        "\nEnrichment has the lowest P90 of all approaches of the paper in {} of {} seeds. The prediction \
         lies in the 95 % interval of the verified P90 in {}; the two agree within the 95 % interval of \
         their difference in {}.",
        wins.count(),
        ours.len(),
        holds.count(),
        agrees.count(),
    );
}
