//! The contents of a report.

use std::collections::BTreeMap;

use problem::Approach;
use problem::formulation::Problem;
use store::Store;

use super::doe::{self, DoePoint};
use super::drawing::{self, Illustration};
use super::enrichment::{self, Enrichment};
use super::head;
use super::model::{self, ScatterShare, Slice, VariableIndices};
use super::printed::PaperFigures;
use super::runs::{self, OptimiserRun};
use super::wear::{self, WearProfiles};
use crate::doubts;
use crate::sheet::{self, Section};
use crate::snapshot::Snapshot;
use crate::status;

/// The rows of a campaign, with the figures that are computed for its report.
///
/// A value that could not be computed is `f64::NAN`: tables show a dash, and charts leave it out.
pub struct Report {
    /// The campaign's rows.
    pub snapshot: Snapshot,
    /// The missing parts of an unfinished campaign, a clause each. Nothing is recommended before it is finished.
    pub missing: Vec<String>,
    /// Where and when the report was made, as (label, value).
    pub made: Vec<(String, String)>,
    /// The model along each variable through the recommended design; empty without either.
    pub slices: Vec<Slice>,
    /// The share of each variable in the variance of the model's mean over the box.
    pub indices: Vec<VariableIndices>,
    /// The share of each random input in the scatter at the recommended design.
    pub scatter: Vec<ScatterShare>,
    /// The rounds of infill; `None` for a campaign without an enrichment.
    pub enrichment: Option<Enrichment>,
    /// `None` for a problem other than gears.
    pub gears: Option<GearFigures>,
}

/// The figures that are computed for the report of a gear campaign.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct GearFigures {
    /// The paper's designs on this model; `None` if the campaign does not compare itself with the paper.
    pub paper: Option<PaperFigures>,
    /// The simulable designs of the DoE, in their order.
    pub doe: Vec<DoePoint>,
    /// Wear depths of one flank.
    pub wear: Option<WearProfiles>,
    /// Drawings and curves of the optima.
    pub illustrations: BTreeMap<Approach, Illustration>,
    /// The data sheet of the recommended design; empty without one.
    pub sheet: Vec<Section>,
    /// Reasons to doubt the recommended pair, by its own results.
    pub doubts: Vec<String>,
    /// The runs of the approaches that have an optimiser.
    pub runs: BTreeMap<Approach, Vec<OptimiserRun>>,
}

impl Report {
    /// Reads the campaign in `store` and computes its report; `made` says where and when.
    ///
    /// # Errors
    ///
    /// The store cannot be read, or holds what this version cannot read.
    pub async fn read(store: &Store, made: &[(String, String)]) -> anyhow::Result<Self> {
        let store = &store.snapshot().await?;
        let snapshot = Snapshot::read(store).await?;
        let status = status::of(store, &snapshot.problem, &snapshot.optima).await?;
        let recommended = snapshot.optima.recommended();
        let best = recommended.and_then(|best| best.optimum.feasible());
        Ok(Self {
            missing: head::missing(&status),
            made: made.to_vec(),
            slices: model::slices(&snapshot, best.map(|found| &found.design))?,
            indices: model::indices(&snapshot)?,
            scatter: model::scatter(&snapshot),
            enrichment: enrichment::of(store, &snapshot).await?,
            gears: match snapshot.problem.gears() {
                Some(_) => Some(GearFigures {
                    paper: PaperFigures::of(&snapshot),
                    doe: doe::points(&snapshot),
                    wear: wear::profiles(&snapshot),
                    illustrations: drawing::illustrations(&snapshot),
                    sheet: best.map_or_else(Vec::new, |best| {
                        sheet::of_design(&snapshot.problem, &best.design)
                    }),
                    doubts: best.map_or_else(Vec::new, |best| {
                        doubts::pair::of_design(&snapshot.problem, &best.design)
                    }),
                    runs: runs::finished(&snapshot)?,
                }),
                None => None,
            },
            snapshot,
        })
    }

    pub(crate) fn problem(&self) -> &Problem {
        &self.snapshot.problem
    }

    /// The paper's designs, if the campaign compares itself with the paper.
    pub(crate) fn paper(&self) -> Option<&PaperFigures> {
        self.gears.as_ref()?.paper.as_ref()
    }
}
