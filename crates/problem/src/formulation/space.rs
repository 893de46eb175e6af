//! The search space of an approach, and the conversion of its points to designs.

use std::borrow::Cow;

use super::Design;

/// A number that an approach varies.
#[derive(Debug, Clone, PartialEq)]
pub struct Coordinate {
    /// The name. For gear pairs it ends with the unit, if there is one.
    pub name: Cow<'static, str>,
    /// The unit, if the name does not contain it; empty for a number without one.
    pub unit: Cow<'static, str>,
    /// The range, `[low, high]`.
    pub range: [f64; 2],
    /// The values of a discrete coordinate, increasing, two or more; none for a continuous one.
    pub values: Vec<f64>,
}

impl Coordinate {
    /// The value at a place of the unit interval, in which the values of a discrete coordinate have equal cells.
    fn at(&self, unit: f64) -> f64 {
        let [low, high] = self.range;
        match self.values.len() {
            0 => low + (high - low) * unit,
            count => self.values[((unit * count as f64) as usize).min(count - 1)],
        }
    }

    /// The place of a value in the unit interval: the middle of the nearest value's cell for a discrete coordinate.
    fn place(&self, x: f64) -> f64 {
        let [low, high] = self.range;
        let nearest = |values: &[f64]| {
            let distances = values.iter().map(|value| (value - x).abs()).enumerate();
            distances
                .min_by(|a, b| a.1.total_cmp(&b.1))
                .map_or(0, |(place, _)| place)
        };
        match self.values.len() {
            0 => (x - low) / (high - low),
            count => (nearest(&self.values) as f64 + 0.5) / count as f64,
        }
    }
}

/// The source of the value of a design's variable.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Source {
    /// A given design, which may come from another approach.
    Kept,
    /// The campaign file.
    Fixed(f64),
    /// The campaign file, in modules of the design.
    FixedInModules(f64),
    /// The coordinate with this number.
    Moved(usize),
    /// The coordinate with this number, in modules of the design.
    MovedInModules(usize),
    /// The pinion's variable, which precedes the mate's.
    Tied,
    /// The remainder of the sum of profile shifts that module and centre distance require.
    Follows,
}

/// Values that follow from other variables of a design. If such a value does not exist, the result
/// is another finite number with which the simulator refuses the design.
pub(super) trait DerivedValues {
    /// The normal module, mm.
    fn module(&self, values: &[f64]) -> f64;

    /// The profile shift of the mate.
    fn mate_shift(&self, values: &[f64]) -> f64;
}

/// For a problem without such values.
impl DerivedValues for () {
    fn module(&self, _values: &[f64]) -> f64 {
        1.0
    }

    fn mate_shift(&self, _values: &[f64]) -> f64 {
        0.0
    }
}

/// The search space of an approach, a box.
#[derive(Debug, Clone)]
pub(super) struct Space {
    coordinates: Vec<Coordinate>,
    sources: Vec<Source>,
}

impl Space {
    /// Makes a space from its coordinates and the source of each variable.
    pub(super) const fn new(coordinates: Vec<Coordinate>, sources: Vec<Source>) -> Self {
        Self {
            coordinates,
            sources,
        }
    }

    pub(super) fn coordinates(&self) -> &[Coordinate] {
        &self.coordinates
    }

    /// Whether some variables are taken from a given design.
    pub(super) fn keeps(&self) -> bool {
        self.sources.contains(&Source::Kept)
    }

    /// The coordinates at a point of the unit cube.
    pub(super) fn scaled(&self, unit: &[f64]) -> Vec<f64> {
        let ranges = self.coordinates.iter().zip(unit);
        ranges
            .map(|(coordinate, &unit)| coordinate.at(unit))
            .collect()
    }

    /// The inverse of [`Self::scaled`].
    pub(super) fn unit(&self, x: &[f64]) -> Vec<f64> {
        let ranges = self.coordinates.iter().zip(x);
        ranges.map(|(coordinate, &x)| coordinate.place(x)).collect()
    }

    /// The values in `design` of the variables that this space takes from a given design; 0 for all
    /// others.
    pub(super) fn kept(&self, design: &Design) -> Design {
        let values = self.sources.iter().zip(design.values());
        Design::new(
            values
                .map(|(source, &value)| match source {
                    Source::Kept => value,
                    _ => 0.0,
                })
                .collect(),
        )
    }

    /// The design with the coordinates `x`, and with the values of `base` for the variables that
    /// this space takes from a given design.
    pub(super) fn design(&self, x: &[f64], base: &Design, derived: &dyn DerivedValues) -> Design {
        let mut values = base.values().to_vec();
        for (value, source) in values.iter_mut().zip(&self.sources) {
            match *source {
                Source::Moved(number) => *value = x[number],
                Source::Fixed(fixed) => *value = fixed,
                _ => {}
            }
        }
        self.tie(&mut values);
        if let Some(mate) = self.sources.iter().position(|s| *s == Source::Follows) {
            values[mate] = derived.mate_shift(&values);
        }
        let in_modules = |source: &Source| match *source {
            Source::MovedInModules(number) => Some(x[number]),
            Source::FixedInModules(fixed) => Some(fixed),
            _ => None,
        };
        if self.sources.iter().any(|s| in_modules(s).is_some()) {
            let module = derived.module(&values);
            for (value, source) in values.iter_mut().zip(&self.sources) {
                if let Some(modules) = in_modules(source) {
                    *value = module * modules;
                }
            }
            self.tie(&mut values);
        }
        Design::new(values)
    }

    fn tie(&self, values: &mut [f64]) {
        for (mate, source) in self.sources.iter().enumerate() {
            if *source == Source::Tied {
                values[mate] = values[mate - 1];
            }
        }
    }

    /// The coordinates of a design of this space.
    pub(super) fn coordinates_of(&self, design: &Design, derived: &dyn DerivedValues) -> Vec<f64> {
        let values = design.values();
        let mut x = vec![0.0; self.coordinates.len()];
        for (source, &value) in self.sources.iter().zip(values) {
            match *source {
                Source::Moved(number) => x[number] = value,
                Source::MovedInModules(number) => {
                    x[number] = value / derived.module(values);
                }
                _ => {}
            }
        }
        x
    }
}
