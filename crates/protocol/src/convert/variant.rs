//! The messages of design variants.

use campaign::{Design, Variant, WearFactors};
use gear::{Corrections, ReliefShape, TipRelief};
use stats::streams::Purpose;

use super::{Malformed, malformed};
use crate::v1;

/// The message of a variant.
pub(super) fn message(variant: &Variant) -> v1::Variant {
    let relief = |relief: TipRelief| v1::TipRelief {
        amount_mm: relief.amount,
        length_mm: relief.length,
        is_parabolic: relief.shape == ReliefShape::Parabolic,
    };
    let Corrections {
        tip_relief: [pinion, mate],
        crowning,
    } = variant.corrections;
    let WearFactors {
        depth,
        variance,
        range,
    } = variant.wear;
    let (purpose, number) = variant.stream;
    let purpose = match purpose {
        Purpose::Wear => v1::Purpose::Wear,
        Purpose::Verify => v1::Purpose::Verify,
        _ => v1::Purpose::Unspecified,
    };
    v1::Variant {
        design: Some(super::design_message(&variant.design)),
        pinion_relief: pinion.map(relief),
        mate_relief: mate.map(relief),
        crowning_mm: crowning,
        normal_module_mm: variant.normal_module_mm,
        wear_factors: vec![depth, variance, range],
        purpose: purpose.into(),
        number,
        feasible_only: variant.feasible_only,
    }
}

/// Reads a variant from its message.
///
/// # Errors
///
/// The message is malformed.
pub(super) fn read(message: &v1::Variant) -> Result<Variant, Malformed> {
    let Some(design) = &message.design else {
        return malformed("has a variant of no design");
    };
    let [depth, variance, range] = *message.wear_factors else {
        return malformed("has not three factors on the wear for each variant");
    };
    let purpose = match message.purpose() {
        v1::Purpose::Wear => Purpose::Wear,
        v1::Purpose::Verify => Purpose::Verify,
        v1::Purpose::Unspecified => return malformed("names random streams that there are not"),
    };
    let relief = |relief: &v1::TipRelief| TipRelief {
        amount: relief.amount_mm,
        length: relief.length_mm,
        shape: if relief.is_parabolic {
            ReliefShape::Parabolic
        } else {
            ReliefShape::Linear
        },
    };
    Ok(Variant {
        design: Design::new(design.values.clone()),
        corrections: Corrections {
            tip_relief: [&message.pinion_relief, &message.mate_relief]
                .map(|given| given.as_ref().map(relief)),
            crowning: message.crowning_mm,
        },
        normal_module_mm: message.normal_module_mm,
        wear: WearFactors {
            depth,
            variance,
            range,
        },
        stream: (purpose, message.number),
        feasible_only: message.feasible_only,
    })
}
