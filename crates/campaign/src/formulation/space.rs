//! The box that an approach searches, and how its points become designs.

use std::borrow::Cow;

use super::Design;

/// A number that an approach moves.
#[derive(Debug, Clone, PartialEq)]
pub struct Coordinate {
    /// Its name, with its unit at the end where it has one of the gear pair's.
    pub name: Cow<'static, str>,
    /// Its unit where the name does not say it; empty for a number without one.
    pub unit: Cow<'static, str>,
    /// `[low, high]`.
    pub range: [f64; 2],
}

/// Where the value of a variable of a design comes from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Source {
    /// From elsewhere: a given design, which another approach may have found.
    Kept,
    /// The campaign file.
    Fixed(f64),
    /// The campaign file, in modules of the design.
    FixedInModules(f64),
    /// The coordinate of this number.
    Moved(usize),
    /// The coordinate of this number, in modules of the design.
    MovedInModules(usize),
    /// The same as of the pinion, which stands before the mate.
    Tied,
    /// What is left of the sum of the profile shifts that module and centre distance ask for.
    Follows,
}

/// What follows from other variables of a design. Where a design has no such number, another finite one
/// stands for it, with which the simulator refuses the design.
pub(super) trait Derived {
    /// The normal module, mm.
    fn module(&self, values: &[f64]) -> f64;

    /// The profile shift of the mate.
    fn mate_shift(&self, values: &[f64]) -> f64;
}

/// Of a problem in which nothing follows.
impl Derived for () {
    fn module(&self, _values: &[f64]) -> f64 {
        1.0
    }

    fn mate_shift(&self, _values: &[f64]) -> f64 {
        0.0
    }
}

/// The box that an approach searches.
#[derive(Debug, Clone)]
pub(super) struct Space {
    coordinates: Vec<Coordinate>,
    sources: Vec<Source>,
}

impl Space {
    /// A box, and the source of each variable.
    pub(super) const fn new(coordinates: Vec<Coordinate>, sources: Vec<Source>) -> Self {
        Self {
            coordinates,
            sources,
        }
    }

    /// A box of all variables.
    pub(super) fn of_all(coordinates: Vec<Coordinate>) -> Self {
        let sources = (0..coordinates.len()).map(Source::Moved).collect();
        Self::new(coordinates, sources)
    }

    pub(super) fn coordinates(&self) -> &[Coordinate] {
        &self.coordinates
    }

    /// Whether variables are left to other designs.
    pub(super) fn keeps(&self) -> bool {
        self.sources.contains(&Source::Kept)
    }

    /// The coordinates at a point of the unit cube.
    pub(super) fn scaled(&self, unit: &[f64]) -> Vec<f64> {
        let ranges = self.coordinates.iter().zip(unit);
        ranges
            .map(|(coordinate, &unit)| {
                let [low, high] = coordinate.range;
                low + (high - low) * unit
            })
            .collect()
    }

    /// The inverse of [`Self::scaled`].
    pub(super) fn unit(&self, x: &[f64]) -> Vec<f64> {
        let ranges = self.coordinates.iter().zip(x);
        ranges
            .map(|(coordinate, x)| {
                let [low, high] = coordinate.range;
                (x - low) / (high - low)
            })
            .collect()
    }

    /// What `design` has where this space keeps variables; 0 elsewhere.
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

    /// The design with the coordinates `x`, and the values of `base` where this space keeps variables.
    pub(super) fn design(&self, x: &[f64], base: &Design, derived: &dyn Derived) -> Design {
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
    pub(super) fn coordinates_of(&self, design: &Design, derived: &dyn Derived) -> Vec<f64> {
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
