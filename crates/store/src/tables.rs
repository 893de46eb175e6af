//! The mapping of rows to SQLite: the columns of each table, and when two rows agree.

use ledger::StreamId;
use sqlx::sqlite::SqliteRow;
use sqlx::{Error as SqlxError, Row as _};

use crate::Error;
use crate::derived::Derivation;
use crate::keyed::{Column, Keyed, Table, Value};
use crate::rounds::{InfillRow, RoundRow};
use crate::rows::{
    CampaignRow, CriteriaRow, DesignRow, EvaluationRow, JobTimeRow, ModelRow, OptimiserRunRow,
    OptimumRow, ResponseRow, StageTimeRow,
};
use crate::samples::SampleBlock;

/// Implements a table whose columns are the fields of its row, those of the key first.
macro_rules! table {
    ($row:ident: $name:literal, $reading:literal, $keys:literal keys, sealed $sealed:literal,
     $($column:ident)+) => {
        impl Table for $row {
            const NAME: &'static str = $name;
            const COLUMNS: &'static [&'static str] = &[$(stringify!($column)),+];
            const KEYS: usize = $keys;
            const SEALED: bool = $sealed;
            const READING: &'static str = $reading;

            fn each(&self, mut visit: impl FnMut(Value<'_>)) {
                $(visit(self.$column.value());)+
            }

            fn read(row: &SqliteRow) -> Result<Self, SqlxError> {
                let mut columns = 0..;
                // Evaluated in this order, which is that of the columns.
                Ok(Self { $($column: Column::read(row, columns.next().unwrap_or(0))?,)+ })
            }
        }
    };
}

table!(DesignRow: "design", "read designs", 1 keys, sealed true,
    design x);
table!(CriteriaRow: "criteria", "read criteria", 1 keys, sealed true,
    design simulable reason responses);
table!(InfillRow: "infill", "read infill points", 1 keys, sealed true,
    infill round name number reason x violation samples failed);
table!(SampleBlock: "sample_block", "read samples", 2 keys, sealed true,
    stream first_sample samples);
table!(OptimiserRunRow: "optimiser_run", "read optimiser runs", 1 keys, sealed true,
    stream result_json simulator_calls cpu_seconds);
table!(EvaluationRow: "evaluation", "read evaluations", 2 keys, sealed true,
    stream evaluation x refused value criteria worn_criteria samples);
table!(ResponseRow: "response", "read responses", 1 keys, sealed true,
    design mean standard_deviation percentile percentile_variance lilliefors_p);
table!(ModelRow: "model", "read models", 1 keys, sealed true,
    name json summary_json);
table!(OptimumRow: "optimum", "read optima", 1 keys, sealed true,
    approach x_json criterion feasible criteria_json simulator_calls cpu_seconds note);
table!(Derivation: "derivation", "read what results were computed from", 1 keys, sealed true,
    name inputs output failure);
table!(JobTimeRow: "job_time", "read what jobs cost", 2 keys, sealed false,
    stream part cpu_seconds);
table!(StageTimeRow: "stage_time", "read how long stages took", 1 keys, sealed false,
    stage wall_seconds);
table!(RoundRow: "enrichment_round", "read rounds", 1 keys, sealed true,
    round expected_improvement recommendation_json stop_json notes_json simulator_calls
    cpu_seconds);

impl Table for CampaignRow {
    const NAME: &'static str = "campaign";
    const COLUMNS: &'static [&'static str] = &[
        "one",
        "name",
        "file_text",
        "digest",
        "seed",
        "program_version",
        "model_digest",
    ];
    const KEYS: usize = 1;
    const SEALED: bool = true;
    const READING: &'static str = "read the campaign";

    fn each(&self, mut visit: impl FnMut(Value<'_>)) {
        visit(Value::Count(1));
        visit(self.name.value());
        visit(self.file_text.value());
        visit(self.digest.value());
        visit(Value::Bits(self.seed));
        visit(self.program_version.value());
        visit(self.model_digest.value());
    }

    fn read(row: &SqliteRow) -> Result<Self, SqlxError> {
        Ok(Self {
            name: row.try_get(1)?,
            file_text: row.try_get(2)?,
            digest: row.try_get(3)?,
            seed: row.try_get::<i64, _>(4)?.cast_unsigned(),
            program_version: row.try_get(5)?,
            model_digest: row.try_get(6)?,
        })
    }
}

impl Keyed for DesignRow {
    type Key<'a> = u64;

    fn key(&self) -> u64 {
        self.design
    }

    fn agree(held: &Self, offered: &Self) -> Result<(), Error> {
        if held == offered {
            Ok(())
        } else {
            Err(Error::DesignConflict {
                design: offered.design,
            })
        }
    }
}

impl Keyed for CriteriaRow {
    type Key<'a> = u64;

    fn key(&self) -> u64 {
        self.design
    }

    fn agree(held: &Self, offered: &Self) -> Result<(), Error> {
        if held == offered {
            Ok(())
        } else {
            Err(Error::CriteriaConflict {
                design: offered.design,
                held: Box::new(held.clone()),
                offered: Box::new(offered.clone()),
            })
        }
    }
}

impl Keyed for OptimiserRunRow {
    type Key<'a> = StreamId;

    fn key(&self) -> StreamId {
        self.stream
    }

    fn agree(held: &Self, offered: &Self) -> Result<(), Error> {
        // The processor time is measured and differs between attempts.
        if (&held.result_json, held.simulator_calls)
            == (&offered.result_json, offered.simulator_calls)
        {
            Ok(())
        } else {
            Err(Error::RunConflict {
                stream: offered.stream,
            })
        }
    }
}

impl Keyed for EvaluationRow {
    type Key<'a> = (StreamId, u64);

    fn key(&self) -> (StreamId, u64) {
        (self.stream, self.evaluation)
    }

    fn agree(held: &Self, offered: &Self) -> Result<(), Error> {
        if held == offered {
            return Ok(());
        }
        Err(Error::EvaluationConflict {
            stream: offered.stream,
            evaluation: offered.evaluation,
        })
    }
}

impl Keyed for JobTimeRow {
    type Key<'a> = (StreamId, u64);

    fn key(&self) -> (StreamId, u64) {
        (self.stream, self.part)
    }

    fn agree(_: &Self, _: &Self) -> Result<(), Error> {
        // The time is measured, so the first value is kept whatever the second one is.
        Ok(())
    }
}

/// The value as SQLite returns it: -0.0 becomes 0.0.
pub(crate) fn number(value: f64) -> f64 {
    value + 0.0
}

/// Both values, unless they are equal to the last bit.
pub(crate) fn differ(held: f64, offered: f64) -> Option<(f64, f64)> {
    let (held, offered) = (number(held), number(offered));
    (held.to_bits() != offered.to_bits()).then_some((held, offered))
}
