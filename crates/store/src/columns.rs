//! Designs, criteria and infill points in schemas before 9, with one column for each variable and
//! each response of a gear pair.

use crate::Error;
use crate::connection::Connection;
use crate::keyed;
use crate::rounds::InfillRow;
use crate::rows::{CriteriaRow, DesignRow};

/// A design.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct OldDesign {
    pub(crate) design: u64,
    pub(crate) x_p: f64,
    pub(crate) x_r: f64,
    pub(crate) ha0_p: f64,
    pub(crate) ha0_r: f64,
    pub(crate) hf0_p: f64,
    pub(crate) hf0_r: f64,
}

/// The criteria of a design.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct OldCriteria {
    pub(crate) design: u64,
    pub(crate) feasible: bool,
    pub(crate) reason: Option<String>,
    pub(crate) contact_ratio: Option<f64>,
    pub(crate) specific_sliding: Option<f64>,
    pub(crate) hertz_pressure_mpa: Option<f64>,
    pub(crate) hertz_pressure_worn_mpa: Option<f64>,
    pub(crate) root_stress_mpa: Option<f64>,
    pub(crate) clearance_p_mm: Option<f64>,
    pub(crate) clearance_r_mm: Option<f64>,
    pub(crate) flank_margin_p_mm: Option<f64>,
    pub(crate) flank_margin_r_mm: Option<f64>,
    pub(crate) delta_ste_um: Option<f64>,
    pub(crate) delta_ste_archard_um: Option<f64>,
}

/// An infill point.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct OldInfill {
    pub(crate) infill: u64,
    pub(crate) round: u64,
    pub(crate) name: String,
    pub(crate) number: u64,
    pub(crate) reason: String,
    pub(crate) x_p: f64,
    pub(crate) x_r: f64,
    pub(crate) ha0_p: f64,
    pub(crate) ha0_r: f64,
    pub(crate) hf0_p: f64,
    pub(crate) hf0_r: f64,
    pub(crate) violation: f64,
    pub(crate) samples: u64,
    pub(crate) failed: bool,
}

impl OldDesign {
    fn update(self) -> DesignRow {
        DesignRow {
            design: self.design,
            x: vec![
                self.x_p, self.x_r, self.ha0_p, self.ha0_r, self.hf0_p, self.hf0_r,
            ],
        }
    }
}

impl OldCriteria {
    fn update(self) -> CriteriaRow {
        let responses = [
            self.contact_ratio,
            self.specific_sliding,
            self.hertz_pressure_mpa,
            self.hertz_pressure_worn_mpa,
            self.root_stress_mpa,
            self.clearance_p_mm,
            self.clearance_r_mm,
            self.flank_margin_p_mm,
            self.flank_margin_r_mm,
            self.delta_ste_um,
            self.delta_ste_archard_um,
        ];
        CriteriaRow {
            design: self.design,
            feasible: self.feasible,
            reason: self.reason,
            responses: responses.into_iter().collect(),
        }
    }
}

impl OldInfill {
    fn update(self) -> InfillRow {
        InfillRow {
            infill: self.infill,
            round: self.round,
            name: self.name,
            number: self.number,
            reason: self.reason,
            x: vec![
                self.x_p, self.x_r, self.ha0_p, self.ha0_r, self.hf0_p, self.hf0_r,
            ],
            violation: self.violation,
            samples: self.samples,
            failed: self.failed,
        }
    }
}

/// Seals the rows of a schema before 6.
pub(crate) async fn seal(connection: &mut Connection<'_>) -> Result<(), Error> {
    keyed::seal::<OldDesign>(connection).await?;
    keyed::seal::<OldCriteria>(connection).await?;
    keyed::seal::<OldInfill>(connection).await
}

/// Checks the rows against their seals.
pub(crate) async fn check(connection: &mut Connection<'_>) -> Result<(), Error> {
    keyed::all::<OldDesign>(connection).await?;
    keyed::all::<OldCriteria>(connection).await?;
    keyed::all::<OldInfill>(connection).await.map(drop)
}

/// Replaces the columns by lists of numbers, for the migration that introduced the lists.
pub(crate) async fn convert(connection: &mut Connection<'_>) -> Result<(), Error> {
    let designs: Vec<OldDesign> = keyed::all(connection).await?;
    let criteria: Vec<OldCriteria> = keyed::all(connection).await?;
    let infill: Vec<OldInfill> = keyed::all(connection).await?;
    for statement in DROPPED {
        connection.run("drop a column", statement).await?;
    }
    let designs: Vec<DesignRow> = designs.into_iter().map(OldDesign::update).collect();
    keyed::replace(connection, &designs).await?;
    let criteria: Vec<CriteriaRow> = criteria.into_iter().map(OldCriteria::update).collect();
    keyed::replace(connection, &criteria).await?;
    let infill: Vec<InfillRow> = infill.into_iter().map(OldInfill::update).collect();
    keyed::replace(connection, &infill).await
}

const DROPPED: [&str; 23] = [
    "ALTER TABLE design DROP COLUMN x_p",
    "ALTER TABLE design DROP COLUMN x_r",
    "ALTER TABLE design DROP COLUMN ha0_p",
    "ALTER TABLE design DROP COLUMN ha0_r",
    "ALTER TABLE design DROP COLUMN hf0_p",
    "ALTER TABLE design DROP COLUMN hf0_r",
    "ALTER TABLE criteria DROP COLUMN contact_ratio",
    "ALTER TABLE criteria DROP COLUMN specific_sliding",
    "ALTER TABLE criteria DROP COLUMN hertz_pressure_mpa",
    "ALTER TABLE criteria DROP COLUMN hertz_pressure_worn_mpa",
    "ALTER TABLE criteria DROP COLUMN root_stress_mpa",
    "ALTER TABLE criteria DROP COLUMN clearance_p_mm",
    "ALTER TABLE criteria DROP COLUMN clearance_r_mm",
    "ALTER TABLE criteria DROP COLUMN flank_margin_p_mm",
    "ALTER TABLE criteria DROP COLUMN flank_margin_r_mm",
    "ALTER TABLE criteria DROP COLUMN delta_ste_um",
    "ALTER TABLE criteria DROP COLUMN delta_ste_archard_um",
    "ALTER TABLE infill DROP COLUMN x_p",
    "ALTER TABLE infill DROP COLUMN x_r",
    "ALTER TABLE infill DROP COLUMN ha0_p",
    "ALTER TABLE infill DROP COLUMN ha0_r",
    "ALTER TABLE infill DROP COLUMN hf0_p",
    "ALTER TABLE infill DROP COLUMN hf0_r",
];
