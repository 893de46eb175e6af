//! `[bounds]` and `[frozen]` of a gear campaign: the ranges of its designs.

use std::ops::Range;

use gear::Rack;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::validate::Source;
use super::{FileError, Pair};

/// `[bounds]`: the values that each variable may take, for both gears together or for each.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Bounds {
    /// A standard rack, instead of tool addendum, tool dedendum and root radius.
    pub rack: Option<Rack>,
    /// Addendum modification coefficient, modules.
    pub profile_shift: OfGears,
    /// Tool addendum, modules.
    pub tool_addendum: Option<OfGears>,
    /// Tool dedendum, modules.
    pub tool_dedendum: Option<OfGears>,
    /// Tip rounding radius, in modules of the design.
    pub tip_radius_modules: OfGears,
    /// Root fillet radius, in modules of the design.
    pub root_radius_modules: Option<OfGears>,
    /// Helix angle, degrees.
    pub helix_angle_deg: Setting,
}

/// The values of one kind of variable, for both gears together or for each.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(
    untagged,
    expecting = "expected [low, high], [low, high, step], a number, or { pinion = …, mate = … } with these or mate = \"tied\""
)]
#[schemars(
    title = "[low, high], [low, high, step], a number, or { pinion = …, mate = … } with these or mate = \"tied\" or \"follows\""
)]
pub enum OfGears {
    /// The same for both gears, each of which has a value of its own.
    Both(Setting),
    /// Separate values for each gear.
    Each(Each),
}

/// The values for pinion and mate.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Each {
    /// The pinion's.
    pub pinion: Setting,
    /// The mate's.
    pub mate: Setting,
}

/// The values that a variable of one gear may take.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(
    untagged,
    expecting = "expected [low, high], [low, high, step] or a number"
)]
#[schemars(title = "[low, high], [low, high, step] or a number")]
pub enum Setting {
    /// Free within `[low, high]`.
    Free([f64; 2]),
    /// Free in steps: the numbers `low`, `low + step`, … up to `high`, so that every design can be made.
    Stepped([f64; 3]),
    /// Fixed to a number.
    Fixed(f64),
    /// Bound to another variable.
    Relation(Relation),
}

/// The relation by which a variable of the mate is bound.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Relation {
    /// Equal to the pinion's variable.
    Tied,
    /// The profile shift that results from module and centre distance.
    Follows,
}

/// The source of the variables that the problems with wear do not vary.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FrozenFrom {
    /// The values that the campaign file gives.
    Printed,
    /// The campaign's own optimum without wear.
    Deterministic,
}

/// `[frozen]`, optional: free variables that are varied only in the optimisation without wear.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FrozenSection {
    /// The source of the values.
    pub from: FrozenFrom,
    /// Tip rounding radii of pinion and mate, mm.
    pub tip_radius_mm: Option<[f64; 2]>,
    /// Root fillet radii of pinion and mate, mm.
    pub root_radius_mm: Option<[f64; 2]>,
    /// Helix angle, degrees.
    pub helix_angle_deg: Option<f64>,
}

/// The indices of the tip radii in the design's variables.
pub(crate) const TIP_RADII: Range<usize> = 6..8;
/// The indices of the root radii.
pub(crate) const ROOT_RADII: Range<usize> = 8..10;
/// The index of the helix angle, which is the last variable.
pub(crate) const HELIX_ANGLE: usize = 10;

/// A kind of variable: its key in `[bounds]`, and the smallest and largest valid number.
type Kind = (&'static str, [f64; 2]);

const SHIFT: Kind = ("bounds.profile_shift", [-10.0, 10.0]);
const ADDENDUM: Kind = ("bounds.tool_addendum", [0.0, 10.0]);
const DEDENDUM: Kind = ("bounds.tool_dedendum", [0.0, 10.0]);
const TIP: Kind = ("bounds.tip_radius_modules", [0.0, 10.0]);
const ROOT: Kind = ("bounds.root_radius_modules", [1e-6, 10.0]);
const HELIX: Kind = ("bounds.helix_angle_deg", [-60.0, 60.0]);

impl Bounds {
    /// The values of each variable, in the order of the design's variables: pinion, then mate, and
    /// last the helix angle.
    ///
    /// # Panics
    ///
    /// Never for a validated section, which has either a rack or its keys.
    pub(crate) fn settings(&self) -> [Setting; HELIX_ANGLE + 1] {
        let of_rack = |written: Option<OfGears>, of: fn(&Rack) -> f64| {
            let rack = || self.rack.expect("validation asks for a rack or its keys");
            let fixed = || OfGears::Both(Setting::Fixed(of(&rack())));
            written.unwrap_or_else(fixed).settings()
        };
        let [a, b] = self.profile_shift.settings();
        let [c, d] = of_rack(self.tool_addendum, Rack::addendum);
        let [e, f] = of_rack(self.tool_dedendum, Rack::dedendum);
        let [g, h] = self.tip_radius_modules.settings();
        let [i, j] = of_rack(self.root_radius_modules, Rack::root_radius);
        [a, b, c, d, e, f, g, h, i, j, self.helix_angle_deg]
    }

    /// Validates the section of a campaign with this `pair`.
    pub(super) fn validate(&self, source: Source<'_>, pair: &Pair) -> Result<(), FileError> {
        let optional = [
            (ADDENDUM, self.tool_addendum),
            (DEDENDUM, self.tool_dedendum),
            (ROOT, self.root_radius_modules),
        ];
        for ((key, limits), written) in optional {
            match (written, self.rack) {
                (Some(written), None) => written.validate(source, key, limits)?,
                (None, Some(_)) => {}
                (Some(written), Some(rack)) => {
                    return Err(source.refuse(
                        key,
                        written,
                        format!("absent beside bounds.rack: \"{rack}\" gives it"),
                    ));
                }
                (None, None) => {
                    return Err(source.missing(key, "given, unless bounds.rack is"));
                }
            }
        }
        self.profile_shift.validate(source, SHIFT.0, SHIFT.1)?;
        self.tip_radius_modules.validate(source, TIP.0, TIP.1)?;
        self.helix_angle_deg.validate(source, HELIX.0, HELIX.1)?;
        let settings = self.settings();
        let follows = |setting: &Setting| *setting == Setting::Relation(Relation::Follows);
        if let Some(place) = settings
            .iter()
            .position(follows)
            .filter(|place| *place != 1)
        {
            let (key, _) = [SHIFT, ADDENDUM, DEDENDUM, TIP, ROOT, HELIX][place / 2];
            return Err(source.refuse(
                key,
                "follows",
                "[low, high] or a number: only the profile shift of the mate can follow",
            ));
        }
        let absent = [
            ("pair.normal_module_mm", pair.normal_module_mm),
            ("pair.centre_distance_mm", pair.centre_distance_mm),
        ]
        .into_iter()
        .find_map(|(key, length)| length.is_none().then_some(key));
        match (absent, follows(&settings[1])) {
            (Some(key), true) => {
                return Err(source.missing(
                    key,
                    "given where the mate of bounds.profile_shift \"follows\" from module and centre distance; \
                     or give the mate's profile shift itself, [low, high] or a number",
                ));
            }
            (None, false) => {
                return Err(source.refuse(
                    SHIFT.0,
                    self.profile_shift,
                    "{ pinion = …, mate = \"follows\" } beside pair.normal_module_mm and \
                     pair.centre_distance_mm, from which the sum of the profile shifts follows; or leave out one \
                     of these two",
                ));
            }
            _ => {}
        }
        Ok(())
    }
}

impl OfGears {
    /// The settings of pinion and mate.
    pub(crate) fn settings(&self) -> [Setting; 2] {
        match self {
            Self::Both(setting) => [*setting; 2],
            Self::Each(each) => [each.pinion, each.mate],
        }
    }

    pub(super) fn validate(
        self,
        source: Source<'_>,
        key: &str,
        limits: [f64; 2],
    ) -> Result<(), FileError> {
        match self {
            Self::Both(setting) => setting.validate(source, key, limits),
            Self::Each(Each { pinion, mate }) => {
                pinion.validate(source, key, limits)?;
                match mate {
                    Setting::Relation(_) => Ok(()),
                    mate => mate.validate(source, key, limits),
                }
            }
        }
    }
}

/// The most values of a stepped variable.
const MOST_STEPS: f64 = 1000.0;

impl Setting {
    /// The ends of a free variable; `None` for a fixed or a bound one.
    pub(crate) const fn range(&self) -> Option<[f64; 2]> {
        match *self {
            Self::Free(range) => Some(range),
            Self::Stepped([low, high, _]) => Some([low, high]),
            Self::Fixed(_) | Self::Relation(_) => None,
        }
    }

    /// The possible values of a variable that is free in steps; empty for any other one.
    pub(crate) fn values(&self) -> Vec<f64> {
        let Self::Stepped([low, high, step]) = *self else {
            return Vec::new();
        };
        // The small addition keeps a last step that rounding would cut off. `tidy` makes 3 · 0.1 equal 0.3.
        let steps = ((high - low) / step + 1e-9) as usize;
        let tidy = |value: f64| (value * 1e9).round() / 1e9;
        (0..=steps)
            .map(|count| tidy(low + count as f64 * step))
            .collect()
    }

    /// Requires a value that is valid for a variable other than the mate's.
    pub(super) fn validate(
        self,
        source: Source<'_>,
        key: &str,
        limits: [f64; 2],
    ) -> Result<(), FileError> {
        let [low, high] = limits;
        match self {
            Self::Free(range) => source.ordered(key, range, low, high),
            Self::Stepped([from, to, step]) => {
                source.ordered(key, [from, to], low, high)?;
                source.require(
                    step > 0.0 && to - from >= step && (to - from) / step < MOST_STEPS,
                    key,
                    self,
                    "[low, high, step] with step > 0 and 1 to 999 steps between low and high",
                )
            }
            Self::Fixed(value) => source.within(key, value, low, high, ""),
            Self::Relation(_) => Err(source.refuse(
                key,
                self,
                "[low, high] or a number: only the mate of { pinion = …, mate = … } can be \
                 \"tied\" or \"follows\"",
            )),
        }
    }
}

impl FrozenSection {
    /// Only free variables can be frozen.
    pub(super) fn validate(&self, source: Source<'_>, bounds: &Bounds) -> Result<(), FileError> {
        let settings = bounds.settings();
        let is_free = |setting: &Setting| setting.range().is_some();
        let expected = "absent: bounds fix this variable";
        type Check<'a> = fn(Source<'a>, &str, f64) -> Result<(), FileError>;
        let radii: [(_, _, _, Check<'_>); 2] = [
            (
                "frozen.tip_radius_mm",
                self.tip_radius_mm,
                TIP_RADII,
                Source::tip_radius,
            ),
            (
                "frozen.root_radius_mm",
                self.root_radius_mm,
                ROOT_RADII,
                Source::root_radius,
            ),
        ];
        for (key, radii, places, check) in radii {
            let Some(radii) = radii else { continue };
            radii
                .iter()
                .try_for_each(|radius| check(source, key, *radius))?;
            let are_free = settings[places].iter().all(is_free);
            source.require(are_free, key, radii, expected)?;
        }
        if let Some(angle) = self.helix_angle_deg {
            let key = "frozen.helix_angle_deg";
            source.helix_angle(key, angle)?;
            source.require(is_free(&settings[HELIX_ANGLE]), key, angle, expected)?;
        }
        Ok(())
    }
}
