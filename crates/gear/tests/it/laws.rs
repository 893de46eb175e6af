//! Laws of wear and tooth models against an independent implementation.

use gear::paper::{MAX_DEPTH_UM, SIGNED_WEAR, full_design, printed};
use gear::{Discretisation, Pair, PairInput, ToothModel};
use serde_json::Value;

use crate::support::WEAR;

fn numbers<const N: usize>(value: &Value) -> [f64; N] {
    std::array::from_fn(|i| value[i].as_f64().expect("the case file holds numbers"))
}

/// ΔSTE without wear and with either law, µm, and F without wear, MPa, of 33 designs at helix angles
/// from 0 to 30°.
#[test]
fn independent_cases() {
    assert_eq!(MAX_DEPTH_UM, 3.5, "the cases are of this depth");
    let file: Value = serde_json::from_str(include_str!("../data/laws.json")).unwrap();
    let mut compared = 0;
    for case in file["cases"].as_array().unwrap() {
        let mut variables = printed::with_frozen(numbers(&case["variables"]));
        variables[10] = case["beta_deg"].as_f64().unwrap();
        for &tooth_model in ToothModel::ALL {
            if case[tooth_model.to_string()].is_null() {
                continue;
            }
            let expected: [f64; 4] = numbers(&case[tooth_model.to_string()]);
            let input = PairInput {
                tooth_model,
                ..full_design(variables)
            };
            let coarse = Pair::new(&input, &Discretisation::default()).unwrap();
            let fine = Pair::converged(&input, &WEAR, 1e-5).unwrap().pair;
            for (pair, tolerance) in [(fine, 1.5e-3), (coarse, 3e-3)] {
                let unworn = pair.unworn();
                let ours = [
                    unworn.delta_ste_um,
                    pair.archard(&WEAR).analysis.delta_ste_um,
                    pair.archard(&SIGNED_WEAR).analysis.delta_ste_um,
                    unworn.hertz_pressure_mpa,
                ];
                for (ours, expected) in ours.into_iter().zip(expected) {
                    assert!(
                        (ours / expected - 1.0).abs() < tolerance,
                        "{tooth_model} {variables:?}: {ours} against {expected}"
                    );
                    compared += 1;
                }
            }
        }
    }
    assert_eq!(compared, 33 * 3 * 2 * 4);
}
