//! Profile corrections as variables of a design, after the eleven of the pair.

use super::super::Quantity;
use super::ALL_VARIABLES;
use crate::file::CorrectionsSection;

/// The names of the corrections in their order, as in exported columns.
const NAMES: [&str; 5] = [
    "tip_relief_p_um",
    "tip_relief_length_p_mm",
    "tip_relief_r_um",
    "tip_relief_length_r_mm",
    "crowning_um",
];

/// The corrections as variables.
pub(in super::super) fn variables() -> impl Iterator<Item = Quantity> {
    NAMES.iter().map(|name| Quantity::of(name, ""))
}

/// The name of each correction, and its range if the section has one.
pub(in super::super) fn ranges(
    section: &CorrectionsSection,
) -> impl Iterator<Item = (&'static str, Option<[f64; 2]>)> {
    let relief = section.tip_relief_um.zip(section.tip_relief_length_mm);
    let (amount, length) = relief.unzip();
    NAMES
        .into_iter()
        .zip([amount, length, amount, length, section.crowning_um])
}

/// The corrections in a design's values; none of a design without such variables. A length of zero
/// means no relief.
pub(super) fn of_values(values: &[f64], shape: gear::ReliefShape) -> gear::Corrections {
    let mut corrections = gear::Corrections::default();
    let Some(&[amount_p, length_p, amount_r, length_r, crowning]) = values.get(ALL_VARIABLES..)
    else {
        return corrections;
    };
    let reliefs = [(amount_p, length_p), (amount_r, length_r)];
    for (member, (amount, length)) in gear::Member::BOTH.into_iter().zip(reliefs) {
        if length > 0.0 {
            let relief = gear::TipRelief {
                amount: 1e-3 * amount,
                length,
                shape,
            };
            corrections = corrections.with_tip_relief(member, relief);
        }
    }
    corrections.with_crowning(1e-3 * crowning)
}
