//! The check of `[strength]`.

use gear::rating::Factors;

use super::FileError;
use super::validate::Source;

pub(super) fn is_default(factors: &Factors) -> bool {
    *factors == Factors::default()
}

pub(super) fn validate(factors: &Factors, source: Source<'_>) -> Result<(), FileError> {
    for (key, factor) in [
        ("application_factor", [factors.application_factor; 2]),
        ("dynamic_factor", [factors.dynamic_factor; 2]),
        ("face_load_factor", [factors.face_load_factor; 2]),
        (
            "transverse_load_factor",
            [factors.transverse_load_factor; 2],
        ),
        ("root_life_factor", factors.root_life_factor),
        ("root_factor", factors.root_factor),
        ("flank_life_factor", factors.flank_life_factor),
        ("flank_factor", factors.flank_factor),
    ] {
        for factor in factor {
            source.within(&format!("strength.{key}"), factor, 0.01, 100.0, "")?;
        }
    }
    Ok(())
}
