//! The studies, their kinds and sizes.

use anyhow::Context as _;
use problem::formulation::Problem;

use crate::tradeoff::runner::Runner;
use crate::tradeoff::size::Size;
use crate::tradeoff::table::Table;
use crate::tradeoff::view::View;
use crate::tradeoff::{
    contact, cores, estimators, growth, kriging, optimisation, percentile, runner, simulator,
};

/// The kinds of study.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Grids of the simulator.
    Simulator,
    /// Tooth models against finite elements.
    Contact,
    /// Estimators of the percentile.
    Percentile,
    /// Estimators of the percentile on responses of known distributions.
    Estimators,
    /// Kriging models of the percentile.
    Kriging,
    /// Approaches to the optimum.
    Optimisation,
    /// The overhead of the runner.
    Runner,
    /// The campaign on more and more processors.
    Cores,
    /// The growth of costs with the sizes of tasks.
    Growth,
}

/// A study with its measurements.
#[derive(Debug, Clone, PartialEq)]
pub struct Study {
    pub kind: Kind,
    pub table: Table,
}

impl Kind {
    /// All kinds, from the simulator outwards.
    pub const ALL: [Self; 9] = [
        Self::Simulator,
        Self::Contact,
        Self::Percentile,
        Self::Estimators,
        Self::Kriging,
        Self::Optimisation,
        Self::Runner,
        Self::Cores,
        Self::Growth,
    ];

    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Simulator => "simulator",
            Self::Contact => "contact",
            Self::Percentile => "percentile",
            Self::Estimators => "estimators",
            Self::Kriging => "kriging",
            Self::Optimisation => "optimisation",
            Self::Runner => "runner",
            Self::Cores => "cores",
            Self::Growth => "growth",
        }
    }

    #[must_use]
    pub const fn title(self) -> &'static str {
        match self {
            Self::Simulator => "Simulator",
            Self::Contact => "Contact",
            Self::Percentile => "Percentile",
            Self::Estimators => "Estimators",
            Self::Kriging => "Kriging",
            Self::Optimisation => "Optimisation",
            Self::Runner => "Runner",
            Self::Cores => "Cores",
            Self::Growth => "Growth",
        }
    }

    /// The introduction of the study.
    #[must_use]
    pub const fn lead(self) -> &'static str {
        match self {
            Self::Simulator => simulator::LEAD,
            Self::Contact => contact::LEAD,
            Self::Percentile => percentile::LEAD,
            Self::Estimators => estimators::LEAD,
            Self::Kriging => kriging::LEAD,
            Self::Optimisation => optimisation::LEAD,
            Self::Runner => runner::LEAD,
            Self::Cores => cores::LEAD,
            Self::Growth => growth::LEAD,
        }
    }

    /// Measures this kind of study. `runner` runs samples and campaigns; `progress` receives messages meanwhile.
    ///
    /// # Errors
    ///
    /// The campaign designs no gears, too few of its designs are simulable, or the runner fails.
    pub fn run(
        self,
        problem: &Problem,
        size: Size,
        runner: &mut dyn Runner,
        progress: &mut dyn FnMut(&str),
    ) -> anyhow::Result<Study> {
        let table = match self {
            Self::Simulator => simulator::run(problem, size, progress),
            Self::Contact => contact::run(size, progress),
            Self::Percentile => percentile::run(problem, size, progress),
            Self::Estimators => estimators::run(problem, size, progress),
            Self::Kriging => kriging::run(problem, size, progress),
            Self::Optimisation => optimisation::run(problem, size, runner, progress),
            Self::Runner => runner::run(size, runner, progress),
            Self::Cores => cores::run(problem, size, runner, progress),
            Self::Growth => growth::run(problem, size, progress),
        };
        let table = table.with_context(|| format!("the study {}", self.name()))?;
        Ok(Study { kind: self, table })
    }
}

impl Study {
    #[must_use]
    pub fn views(&self) -> Vec<View<'_>> {
        let pairs = match self.kind {
            Kind::Simulator => simulator::PAIRS,
            Kind::Contact => contact::PAIRS,
            Kind::Percentile => percentile::PAIRS,
            Kind::Estimators => estimators::PAIRS,
            Kind::Kriging => kriging::PAIRS,
            Kind::Optimisation => optimisation::PAIRS,
            Kind::Runner => runner::PAIRS,
            Kind::Cores => cores::PAIRS,
            Kind::Growth => growth::PAIRS,
        };
        let panels = self.table.panels().into_iter();
        panels
            .flat_map(|panel| pairs.iter().map(move |pair| (panel, pair)))
            .enumerate()
            .map(|(number, (panel, pair))| View {
                file: format!("{}-{}", self.kind.name(), number + 1),
                table: &self.table,
                panel,
                pair: *pair,
            })
            .collect()
    }
}
