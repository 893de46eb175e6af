//! The corrections in a design's values, after the eleven of the pair.

use super::ALL_VARIABLES;

/// The corrections in a design's values; none for a design without such variables. An amount of zero means no relief.
pub(super) fn of_values(values: &[f64], shape: gear::ReliefShape) -> gear::Corrections {
    let none = gear::Corrections::default();
    let Some(&[amount_p, amount_r, length_p, length_r, crowning, slope]) =
        values.get(ALL_VARIABLES..)
    else {
        return none;
    };
    let mm = |um: f64| 1e-3 * um;
    let reliefs = [(amount_p, length_p), (amount_r, length_r)].map(|(amount, length)| {
        let amount = mm(amount);
        (amount > 0.0).then_some(gear::TipRelief {
            amount,
            length,
            shape,
        })
    });
    gear::Corrections {
        tip_relief: reliefs,
        ..none
    }
    .with_crowning(mm(crowning))
    .with_helix_slope(mm(slope))
}
