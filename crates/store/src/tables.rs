//! What each table's rows are to SQLite: columns, checks, and when two of them agree.

use sqlx::Row as _;
use sqlx::error::BoxDynError;
use sqlx::sqlite::{SqliteArguments, SqliteRow};
use sqlx::{Arguments as _, Error as SqlxError};

use crate::Error;
use crate::keyed::{Columns, Keyed};
use crate::query::index;
use crate::rows::{
    CriteriaRow, DesignRow, JobTimeRow, OptimiserRunRow, ResponseRow, SampleRow, VerifyRow,
};

impl DesignRow {
    fn variables(&self) -> [f64; 6] {
        [
            self.x_p, self.x_r, self.ha0_p, self.ha0_r, self.hf0_p, self.hf0_r,
        ]
    }
}

impl Columns for DesignRow {
    const TABLE: &'static str = "design";
    const COLUMNS: &'static [&'static str] =
        &["design", "x_p", "x_r", "ha0_p", "ha0_r", "hf0_p", "hf0_r"];

    fn check(&self) -> Result<(), Error> {
        fits("design.design", self.design)?;
        let columns = [
            "design.x_p",
            "design.x_r",
            "design.ha0_p",
            "design.ha0_r",
            "design.hf0_p",
            "design.hf0_r",
        ];
        for (column, value) in columns.into_iter().zip(self.variables()) {
            finite(column, || format!("design {}", self.design), value)?;
        }
        Ok(())
    }

    fn bind(&self, arguments: &mut SqliteArguments) -> Result<(), BoxDynError> {
        self.bind_key(arguments)?;
        for value in self.variables() {
            arguments.add(number(value))?;
        }
        Ok(())
    }
}

impl Keyed for DesignRow {
    const KEYS: usize = 1;
    const OFTEN_REPEATED: bool = false;
    const READING: &'static str = "read designs";
    type Key<'a> = u64;

    fn key(&self) -> u64 {
        self.design
    }

    fn bind_key(&self, arguments: &mut SqliteArguments) -> Result<(), BoxDynError> {
        arguments.add(self.design.cast_signed())
    }

    fn read(row: &SqliteRow) -> Result<Self, SqlxError> {
        Ok(Self {
            design: index(row.try_get(0)?),
            x_p: row.try_get(1)?,
            x_r: row.try_get(2)?,
            ha0_p: row.try_get(3)?,
            ha0_r: row.try_get(4)?,
            hf0_p: row.try_get(5)?,
            hf0_r: row.try_get(6)?,
        })
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

impl CriteriaRow {
    fn numbers(&self) -> [Option<f64>; 11] {
        [
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
        ]
    }
}

impl Columns for CriteriaRow {
    const TABLE: &'static str = "criteria";
    const COLUMNS: &'static [&'static str] = &[
        "design",
        "feasible",
        "reason",
        "contact_ratio",
        "specific_sliding",
        "hertz_pressure_mpa",
        "hertz_pressure_worn_mpa",
        "root_stress_mpa",
        "clearance_p_mm",
        "clearance_r_mm",
        "flank_margin_p_mm",
        "flank_margin_r_mm",
        "delta_ste_um",
        "delta_ste_archard_um",
    ];

    fn check(&self) -> Result<(), Error> {
        fits("criteria.design", self.design)?;
        let key = || format!("design {}", self.design);
        let columns = [
            "criteria.contact_ratio",
            "criteria.specific_sliding",
            "criteria.hertz_pressure_mpa",
            "criteria.hertz_pressure_worn_mpa",
            "criteria.root_stress_mpa",
            "criteria.clearance_p_mm",
            "criteria.clearance_r_mm",
            "criteria.flank_margin_p_mm",
            "criteria.flank_margin_r_mm",
            "criteria.delta_ste_um",
            "criteria.delta_ste_archard_um",
        ];
        for (column, value) in columns.into_iter().zip(self.numbers()) {
            finite(column, key, value.unwrap_or(0.0))?;
        }
        Ok(())
    }

    fn bind(&self, arguments: &mut SqliteArguments) -> Result<(), BoxDynError> {
        self.bind_key(arguments)?;
        arguments.add(self.feasible)?;
        arguments.add(self.reason.as_deref())?;
        for value in self.numbers() {
            arguments.add(value.map(number))?;
        }
        Ok(())
    }
}

impl Keyed for CriteriaRow {
    const KEYS: usize = 1;
    // Every job of a design brings them.
    const OFTEN_REPEATED: bool = true;
    const READING: &'static str = "read criteria";
    type Key<'a> = u64;

    fn key(&self) -> u64 {
        self.design
    }

    fn bind_key(&self, arguments: &mut SqliteArguments) -> Result<(), BoxDynError> {
        arguments.add(self.design.cast_signed())
    }

    fn read(row: &SqliteRow) -> Result<Self, SqlxError> {
        Ok(Self {
            design: index(row.try_get(0)?),
            feasible: row.try_get(1)?,
            reason: row.try_get(2)?,
            contact_ratio: row.try_get(3)?,
            specific_sliding: row.try_get(4)?,
            hertz_pressure_mpa: row.try_get(5)?,
            hertz_pressure_worn_mpa: row.try_get(6)?,
            root_stress_mpa: row.try_get(7)?,
            clearance_p_mm: row.try_get(8)?,
            clearance_r_mm: row.try_get(9)?,
            flank_margin_p_mm: row.try_get(10)?,
            flank_margin_r_mm: row.try_get(11)?,
            delta_ste_um: row.try_get(12)?,
            delta_ste_archard_um: row.try_get(13)?,
        })
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

impl Columns for SampleRow {
    const TABLE: &'static str = "sample";
    const COLUMNS: &'static [&'static str] = &["design", "sample", "delta_ste_um"];

    fn check(&self) -> Result<(), Error> {
        fits("sample.design", self.design)?;
        fits("sample.sample", self.sample)?;
        let key = || format!("sample {} of design {}", self.sample, self.design);
        finite("sample.delta_ste_um", key, self.delta_ste_um)
    }

    fn bind(&self, arguments: &mut SqliteArguments) -> Result<(), BoxDynError> {
        self.bind_key(arguments)?;
        arguments.add(number(self.delta_ste_um))
    }
}

impl Keyed for SampleRow {
    const KEYS: usize = 2;
    const OFTEN_REPEATED: bool = false;
    const READING: &'static str = "read samples";
    type Key<'a> = (u64, u64);

    fn key(&self) -> (u64, u64) {
        (self.design, self.sample)
    }

    fn bind_key(&self, arguments: &mut SqliteArguments) -> Result<(), BoxDynError> {
        arguments.add(self.design.cast_signed())?;
        arguments.add(self.sample.cast_signed())
    }

    fn read(row: &SqliteRow) -> Result<Self, SqlxError> {
        Ok(Self {
            design: index(row.try_get(0)?),
            sample: index(row.try_get(1)?),
            delta_ste_um: row.try_get(2)?,
        })
    }

    fn agree(held: &Self, offered: &Self) -> Result<(), Error> {
        match differ(held.delta_ste_um, offered.delta_ste_um) {
            None => Ok(()),
            Some((held, value)) => Err(Error::Conflict {
                design: offered.design,
                sample: offered.sample,
                held,
                offered: value,
            }),
        }
    }
}

impl Columns for VerifyRow {
    const TABLE: &'static str = "verify_sample";
    const COLUMNS: &'static [&'static str] = &["approach", "sample", "delta_ste_um"];

    fn check(&self) -> Result<(), Error> {
        fits("verify_sample.sample", self.sample)?;
        let key = || format!("sample {} of \"{}\"", self.sample, self.approach);
        finite("verify_sample.delta_ste_um", key, self.delta_ste_um)
    }

    fn bind(&self, arguments: &mut SqliteArguments) -> Result<(), BoxDynError> {
        self.bind_key(arguments)?;
        arguments.add(number(self.delta_ste_um))
    }
}

impl Keyed for VerifyRow {
    const KEYS: usize = 2;
    const OFTEN_REPEATED: bool = false;
    const READING: &'static str = "read verification samples";
    type Key<'a> = (&'a str, u64);

    fn key(&self) -> (&str, u64) {
        (&self.approach, self.sample)
    }

    fn bind_key(&self, arguments: &mut SqliteArguments) -> Result<(), BoxDynError> {
        arguments.add(self.approach.as_str())?;
        arguments.add(self.sample.cast_signed())
    }

    fn read(row: &SqliteRow) -> Result<Self, SqlxError> {
        Ok(Self {
            approach: row.try_get(0)?,
            sample: index(row.try_get(1)?),
            delta_ste_um: row.try_get(2)?,
        })
    }

    fn agree(held: &Self, offered: &Self) -> Result<(), Error> {
        match differ(held.delta_ste_um, offered.delta_ste_um) {
            None => Ok(()),
            Some((held, value)) => Err(Error::VerifyConflict {
                approach: offered.approach.clone(),
                sample: offered.sample,
                held,
                offered: value,
            }),
        }
    }
}

impl Columns for OptimiserRunRow {
    const TABLE: &'static str = "optimiser_run";
    const COLUMNS: &'static [&'static str] = &[
        "approach",
        "start",
        "result_json",
        "simulator_calls",
        "cpu_seconds",
    ];

    fn check(&self) -> Result<(), Error> {
        fits("optimiser_run.start", self.start)?;
        fits("optimiser_run.simulator_calls", self.simulator_calls)?;
        let key = || format!("run {} of \"{}\"", self.start, self.approach);
        finite("optimiser_run.cpu_seconds", key, self.cpu_seconds)
    }

    fn bind(&self, arguments: &mut SqliteArguments) -> Result<(), BoxDynError> {
        self.bind_key(arguments)?;
        arguments.add(self.result_json.as_str())?;
        arguments.add(self.simulator_calls.cast_signed())?;
        arguments.add(number(self.cpu_seconds))
    }
}

impl Keyed for OptimiserRunRow {
    const KEYS: usize = 2;
    const OFTEN_REPEATED: bool = false;
    const READING: &'static str = "read optimiser runs";
    type Key<'a> = (&'a str, u64);

    fn key(&self) -> (&str, u64) {
        (&self.approach, self.start)
    }

    fn bind_key(&self, arguments: &mut SqliteArguments) -> Result<(), BoxDynError> {
        arguments.add(self.approach.as_str())?;
        arguments.add(self.start.cast_signed())
    }

    fn read(row: &SqliteRow) -> Result<Self, SqlxError> {
        Ok(Self {
            approach: row.try_get(0)?,
            start: index(row.try_get(1)?),
            result_json: row.try_get(2)?,
            simulator_calls: index(row.try_get(3)?),
            cpu_seconds: row.try_get(4)?,
        })
    }

    fn agree(held: &Self, offered: &Self) -> Result<(), Error> {
        // What it cost is measured, and differs from try to try.
        if (&held.result_json, held.simulator_calls)
            == (&offered.result_json, offered.simulator_calls)
        {
            Ok(())
        } else {
            Err(Error::RunConflict {
                approach: offered.approach.clone(),
                start: offered.start,
            })
        }
    }
}

impl Columns for JobTimeRow {
    const TABLE: &'static str = "job_time";
    const COLUMNS: &'static [&'static str] = &["job", "cpu_seconds"];

    fn check(&self) -> Result<(), Error> {
        let key = || format!("job {:#x}", self.job);
        finite("job_time.cpu_seconds", key, self.cpu_seconds)
    }

    fn bind(&self, arguments: &mut SqliteArguments) -> Result<(), BoxDynError> {
        self.bind_key(arguments)?;
        arguments.add(number(self.cpu_seconds))
    }
}

impl Keyed for JobTimeRow {
    const KEYS: usize = 1;
    const OFTEN_REPEATED: bool = false;
    const READING: &'static str = "read what jobs cost";
    type Key<'a> = u64;

    fn key(&self) -> u64 {
        self.job
    }

    fn bind_key(&self, arguments: &mut SqliteArguments) -> Result<(), BoxDynError> {
        // A job's number uses all 64 bits as flags, not as a count.
        arguments.add(self.job.cast_signed())
    }

    fn read(row: &SqliteRow) -> Result<Self, SqlxError> {
        Ok(Self {
            job: row.try_get::<i64, _>(0)?.cast_unsigned(),
            cpu_seconds: row.try_get(1)?,
        })
    }

    fn agree(_: &Self, _: &Self) -> Result<(), Error> {
        // Measured: the first one is kept, whatever the second one is.
        Ok(())
    }
}

impl Columns for ResponseRow {
    const TABLE: &'static str = "response";
    const COLUMNS: &'static [&'static str] = &[
        "design",
        "mean_um",
        "sd_um",
        "p90_um",
        "p90_variance_um2",
        "lilliefors_p",
    ];

    fn check(&self) -> Result<(), Error> {
        fits("response.design", self.design)?;
        let key = || format!("design {}", self.design);
        finite("response.mean_um", key, self.mean_um)?;
        finite("response.sd_um", key, self.sd_um)?;
        finite("response.p90_um", key, self.p90_um)?;
        finite("response.p90_variance_um2", key, self.p90_variance_um2)?;
        finite(
            "response.lilliefors_p",
            key,
            self.lilliefors_p.unwrap_or(0.0),
        )
    }

    fn bind(&self, arguments: &mut SqliteArguments) -> Result<(), BoxDynError> {
        arguments.add(self.design.cast_signed())?;
        arguments.add(number(self.mean_um))?;
        arguments.add(number(self.sd_um))?;
        arguments.add(number(self.p90_um))?;
        arguments.add(number(self.p90_variance_um2))?;
        arguments.add(self.lilliefors_p.map(number))
    }
}

/// SQLite's integers are signed.
pub(crate) fn fits(column: &'static str, value: u64) -> Result<(), Error> {
    match i64::try_from(value) {
        Ok(_) => Ok(()),
        Err(_) => Err(Error::TooLarge { column, value }),
    }
}

/// NaN would become NULL.
pub(crate) fn finite(
    column: &'static str,
    key: impl Fn() -> String,
    value: f64,
) -> Result<(), Error> {
    if value.is_finite() {
        Ok(())
    } else {
        Err(Error::NotFinite {
            column,
            key: key(),
            value,
        })
    }
}

/// The value as SQLite gives it back: -0.0 would lose its sign.
pub(crate) fn number(value: f64) -> f64 {
    value + 0.0
}

/// Both values, if they are not the same to the last bit.
fn differ(held: f64, offered: f64) -> Option<(f64, f64)> {
    let (held, offered) = (number(held), number(offered));
    (held.to_bits() != offered.to_bits()).then_some((held, offered))
}
