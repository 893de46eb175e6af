//! The tip rule `clear-root`.

use gear::{Discretisation, Pair, PairInput};

use crate::support::{figure_7, plain};

/// `clear-root` turns a pressing tip down to zero clearance and leaves the others alone.
#[test]
fn clear_root_ends_at_zero_clearance() {
    let pressing = PairInput {
        tool_dedendum: [1.6, 1.0],
        ..plain()
    };
    let disc = Discretisation::default();
    let as_cut = Pair::new(&pressing, &disc).unwrap();
    assert!(as_cut.geometry().clearance[0] < -0.1);
    let cleared = PairInput {
        tip_rule: gear::TipRule::ClearRoot,
        ..pressing
    };
    let cleared = Pair::new(&cleared, &disc).unwrap();
    assert!(cleared.geometry().clearance[0].abs() < 1e-12);
    assert_eq!(
        cleared.geometry().clearance[1],
        as_cut.geometry().clearance[1]
    );
    let unchanged = PairInput {
        tip_rule: gear::TipRule::ClearRoot,
        ..figure_7()
    };
    assert_eq!(
        Pair::new(&unchanged, &disc).unwrap().geometry(),
        Pair::new(&figure_7(), &disc).unwrap().geometry()
    );
}
