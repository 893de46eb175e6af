//! The studies by name.

use anyhow::Context as _;
use campaign::formulation::Problem;

use crate::runner::Runner;
use crate::table::Table;
use crate::view::View;
use crate::{kriging, optimisation, percentile, runner, simulator};

/// How thoroughly a study measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Size {
    /// For figures to rely on: eight minutes of CPU time for the paper's campaign.
    Full,
    /// For a look: a minute or two.
    Quick,
    /// For a test of the program: from about so many designs.
    Designs(u32),
}

impl Size {
    /// The size in a word or two, which tells sizes apart.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::Full => "full".to_owned(),
            Self::Quick => "quick".to_owned(),
            Self::Designs(count) => format!("{count} designs"),
        }
    }

    /// The one of these values that belongs to the size; a test takes the third.
    pub(crate) fn pick<T>(self, full: T, quick: T, test: T) -> T {
        match self {
            Self::Full => full,
            Self::Quick => quick,
            Self::Designs(_) => test,
        }
    }

    /// How many designs to measure: so many at most in a test.
    pub(crate) fn designs(self, full: usize, quick: usize) -> usize {
        match self {
            Self::Designs(count) => quick.min(count as usize),
            _ => self.pick(full, quick, quick),
        }
    }
}

/// A study.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// The grid of the simulator.
    Simulator,
    /// The estimator of the percentile.
    Percentile,
    /// The model of the percentile.
    Kriging,
    /// The approach to the optimum.
    Optimisation,
    /// What runs the samples.
    Runner,
}

/// A study with what it measured.
#[derive(Debug, Clone, PartialEq)]
pub struct Study {
    /// Which one.
    pub kind: Kind,
    /// What it measured.
    pub table: Table,
}

impl Kind {
    /// All of them, from the inside out.
    pub const ALL: [Self; 5] = [
        Self::Simulator,
        Self::Percentile,
        Self::Kriging,
        Self::Optimisation,
        Self::Runner,
    ];

    /// The name of its files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Simulator => "simulator",
            Self::Percentile => "percentile",
            Self::Kriging => "kriging",
            Self::Optimisation => "optimisation",
            Self::Runner => "runner",
        }
    }

    /// Its heading.
    #[must_use]
    pub const fn title(self) -> &'static str {
        match self {
            Self::Simulator => "Simulator",
            Self::Percentile => "Percentile",
            Self::Kriging => "Kriging",
            Self::Optimisation => "Optimisation",
            Self::Runner => "Runner",
        }
    }

    /// What it measures, in a paragraph.
    #[must_use]
    pub const fn lead(self) -> &'static str {
        match self {
            Self::Simulator => simulator::LEAD,
            Self::Percentile => percentile::LEAD,
            Self::Kriging => kriging::LEAD,
            Self::Optimisation => optimisation::LEAD,
            Self::Runner => runner::LEAD,
        }
    }

    /// Measures; `runner` runs samples and campaigns, `progress` is told what is done.
    ///
    /// # Errors
    ///
    /// The campaign designs no gears, too few of its designs can be simulated, or the runner failed.
    pub fn run(
        self,
        problem: &Problem,
        size: Size,
        runner: &mut dyn Runner,
        progress: &mut dyn FnMut(&str),
    ) -> anyhow::Result<Study> {
        let table = match self {
            Self::Simulator => simulator::run(problem, size, progress),
            Self::Percentile => percentile::run(problem, size, progress),
            Self::Kriging => kriging::run(problem, size, progress),
            Self::Optimisation => optimisation::run(problem, size, runner, progress),
            Self::Runner => runner::run(size, runner, progress),
        };
        let table = table.with_context(|| format!("the study {}", self.name()))?;
        Ok(Study { kind: self, table })
    }
}

impl Study {
    /// Its charts.
    #[must_use]
    pub fn views(&self) -> Vec<View<'_>> {
        let pairs = match self.kind {
            Kind::Simulator => simulator::PAIRS,
            Kind::Percentile => percentile::PAIRS,
            Kind::Kriging => kriging::PAIRS,
            Kind::Optimisation => optimisation::PAIRS,
            Kind::Runner => runner::PAIRS,
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
