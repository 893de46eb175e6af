//! The search spaces of the approaches, from the campaign file.

use super::super::Design;
use super::super::space::{Coordinate, Source, Space};
use super::{ALL_VARIABLES, variable_names};
use crate::file::{GearSections, HELIX_ANGLE, ROOT_RADII, Relation, Setting, TIP_RADII};

/// The names of the radii in modules.
const RADII_IN_MODULES: [&str; 4] = [
    "rho_a_p_modules",
    "rho_a_r_modules",
    "rho_f_p_modules",
    "rho_f_r_modules",
];

/// The space of all variables that the campaign leaves free.
pub(in super::super) fn whole(sections: &GearSections) -> Space {
    space(sections, &[None; ALL_VARIABLES])
}

/// The space of the DoE, without the frozen variables.
pub(in super::super) fn free(sections: &GearSections) -> Space {
    space(sections, &frozen(sections))
}

/// The campaign file's values of the variables that the DoE does not vary.
pub(in super::super) fn base(sections: &GearSections) -> Design {
    let mut values = frozen(sections).map(Option::unwrap_or_default).to_vec();
    values.resize(sections.settings().len(), 0.0);
    Design::new(values)
}

/// The value of each frozen variable.
fn frozen(sections: &GearSections) -> [Option<f64>; ALL_VARIABLES] {
    let mut values = [None; ALL_VARIABLES];
    let Some(frozen) = &sections.frozen else {
        return values;
    };
    for (places, radii) in [
        (TIP_RADII, frozen.tip_radius_mm),
        (ROOT_RADII, frozen.root_radius_mm),
    ] {
        values[places].copy_from_slice(&radii.map_or([None; 2], |radii| radii.map(Some)));
    }
    values[HELIX_ANGLE] = frozen.helix_angle_deg;
    values
}

fn space(sections: &GearSections, frozen: &[Option<f64>; ALL_VARIABLES]) -> Space {
    let mut coordinates = Vec::new();
    let mut sources = Vec::new();
    let settings = sections.settings().into_iter();
    for (place, (setting, name)) in settings.zip(variable_names(sections)).enumerate() {
        let in_modules = (TIP_RADII.start..ROOT_RADII.end).contains(&place);
        sources.push(match setting {
            _ if frozen.get(place).is_some_and(Option::is_some) => Source::Kept,
            Setting::Fixed(value) if in_modules => Source::FixedInModules(value),
            Setting::Fixed(value) => Source::Fixed(value),
            Setting::Relation(Relation::Tied) => Source::Tied,
            Setting::Relation(Relation::Follows) => Source::Follows,
            Setting::Free([low, high]) | Setting::Stepped([low, high, _]) => {
                let name = if in_modules {
                    RADII_IN_MODULES[place - TIP_RADII.start]
                } else {
                    name
                };
                coordinates.push(Coordinate {
                    name: name.into(),
                    unit: "".into(),
                    range: [low, high],
                    values: setting.values(),
                });
                let number = coordinates.len() - 1;
                if in_modules {
                    Source::MovedInModules(number)
                } else {
                    Source::Moved(number)
                }
            }
        });
    }
    Space::new(coordinates, sources)
}
