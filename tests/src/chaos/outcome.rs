//! The final content of a campaign's store, with nothing lost, duplicated or added.

use std::collections::BTreeMap;
use std::path::Path;

use serde_json::Value;
use store::{FailureKind, FailureRow, Store};

use super::Violation;
use super::kinds::Kind;
use super::programs::Programs;

/// Tables that are compared in every column, except measured ones.
const TABLES: [&str; 6] = [
    "designs",
    "samples",
    "responses",
    "optima",
    "rounds",
    "infill",
];

/// Keys of the status that are compared.
const KEYS: [&str; 7] = [
    "finished",
    "designs",
    "samples",
    "samples_digest",
    "optimiser_runs",
    "optima",
    "enrichment",
];

/// The result of a campaign.
#[derive(Debug)]
pub(crate) struct Outcome {
    /// The output of `coordinator status`.
    pub(crate) status: Value,
    /// The lines of every exported table, without processor times.
    tables: BTreeMap<&'static str, Vec<String>>,
    /// The samples of every optimum and infill point, as index and bits.
    verification: BTreeMap<String, Vec<(u64, u64)>>,
    /// The recorded failures.
    failures: Vec<FailureRow>,
}

impl Outcome {
    /// Reads the store `db` in `folder`.
    pub(crate) fn read(programs: &Programs, folder: &Path, db: &str) -> Result<Self, Violation> {
        let mut tables = BTreeMap::new();
        for table in TABLES {
            let text = programs.export(folder, db, table)?;
            tables.insert(table, without_times(&text));
        }
        let (verification, failures) = rows(&folder.join(db))?;
        Ok(Self {
            status: programs.status(folder, db)?,
            tables,
            verification,
            failures,
        })
    }

    /// The values of a column of a table.
    pub(crate) fn column(&self, table: &str, name: &str) -> Vec<&str> {
        let lines = self.tables.get(table).map_or(&[][..], Vec::as_slice);
        let header = lines.first().map_or("", String::as_str);
        let Some(place) = header.split(',').position(|field| field == name) else {
            return Vec::new();
        };
        let lines = lines.iter().skip(1);
        lines
            .filter_map(|line| line.split(',').nth(place))
            .collect()
    }

    /// Checks that a status equals that of this outcome.
    pub(crate) fn has_status(&self, status: &Value) -> Result<(), Violation> {
        for key in KEYS {
            let (now, then) = (&status[key], &self.status[key]);
            if now != then {
                return Err(Violation(format!(
                    "{key} is {now}, and undisturbed it was {then}"
                )));
            }
        }
        Ok(())
    }

    /// Checks that this equals the outcome of an undisturbed run.
    pub(crate) fn compare(&self, undisturbed: &Self) -> Result<(), Violation> {
        undisturbed.has_status(&self.status)?;
        for (table, lines) in &self.tables {
            same(table, lines, &undisturbed.tables[table])?;
        }
        let names = |outcome: &Self| outcome.verification.keys().cloned().collect::<Vec<_>>();
        same("verified points", &names(self), &names(undisturbed))?;
        for (point, samples) in &self.verification {
            let what = format!("the samples of {point}");
            same(&what, samples, &undisturbed.verification[point])?;
        }
        self.is_whole()
    }

    /// Checks that all failures were provoked: the built-in model never fails.
    pub(crate) fn check_failures(&self, kind: Kind) -> Result<(), Violation> {
        let is_expected = |row: &FailureRow| match row.kind {
            FailureKind::Crash => true,
            FailureKind::Failure | FailureKind::Quarantine => kind.has_outages(),
        };
        match self.failures.iter().find(|row| !is_expected(row)) {
            Some(row) => Err(Violation(format!("{}: {}", row.stream, row.error))),
            None => Ok(()),
        }
    }

    /// Checks that every sample is stored once.
    fn is_whole(&self) -> Result<(), Violation> {
        let keys = self.column("samples", "design");
        let keys = keys.into_iter().zip(self.column("samples", "sample"));
        let mut seen = std::collections::BTreeSet::new();
        for key in keys {
            if !seen.insert(key) {
                return Err(Violation(format!("a sample is there twice: {key:?}")));
            }
        }
        let (rows, counted) = (seen.len() as u64, &self.status["samples"]["done"]);
        if counted.as_u64() != Some(rows) {
            return Err(Violation(format!(
                "{rows} samples exported, {counted} counted"
            )));
        }
        Ok(())
    }
}

/// Compares rows and reports the first difference.
fn same<T: PartialEq + std::fmt::Debug>(
    what: &str,
    now: &[T],
    undisturbed: &[T],
) -> Result<(), Violation> {
    if now.len() != undisturbed.len() {
        return Err(Violation(format!(
            "{what}: {} rows, and undisturbed {}",
            now.len(),
            undisturbed.len()
        )));
    }
    let differs = now.iter().zip(undisturbed).find(|(now, then)| now != then);
    match differs {
        Some((now, then)) => Err(Violation(format!(
            "{what}: {now:?}, and undisturbed {then:?}"
        ))),
        None => Ok(()),
    }
}

/// The lines of a table without the columns of processor times.
fn without_times(text: &str) -> Vec<String> {
    let mut lines = text.lines().peekable();
    let header = lines.peek().copied().unwrap_or_default();
    let is_time: Vec<bool> = header.split(',').map(|name| name.contains("cpu")).collect();
    if !is_time.contains(&true) {
        return lines.map(str::to_owned).collect();
    }
    let kept = |line: &str| {
        let fields = line.split(',').zip(&is_time);
        let fields = fields.filter(|(_, is_time)| !**is_time);
        fields.map(|(field, _)| field).collect::<Vec<_>>().join(",")
    };
    lines.map(kept).collect()
}

/// Rows that no table exports unchanged: all samples, including those of optima and infill points, and failures.
#[expect(clippy::type_complexity, reason = "it is taken apart at once")]
fn rows(db: &Path) -> Result<(BTreeMap<String, Vec<(u64, u64)>>, Vec<FailureRow>), Violation> {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .map_err(|error| Violation(error.to_string()))?;
    let read = async {
        let store = Store::open_read_only(db).await?;
        let mut points = BTreeMap::new();
        for stream in store.sample_tallies().await?.into_keys() {
            let mut bits = Vec::new();
            for block in store.blocks_of(stream).await? {
                for (sample, values) in block.indexed() {
                    bits.extend(values.iter().map(|value| (sample, value.to_bits())));
                }
            }
            points.insert(stream.to_string(), bits);
        }
        let failures = store.failures().await?;
        store.close().await?;
        Ok::<_, store::Error>((points, failures))
    };
    let rows = runtime.block_on(read);
    rows.map_err(|error| Violation(format!("the store cannot be read: {error}")))
}

#[cfg(test)]
mod tests {
    use ledger::StreamId;

    use super::*;

    fn outcome() -> Outcome {
        let samples = "design,sample,delta_ste_um\n0,0,1.5\n0,1,1.25\n";
        let optima = "approach,p90_um,cpu_seconds\nkriging,1.5,0.25\n";
        Outcome {
            status: serde_json::json!({"samples": {"done": 2}}),
            tables: BTreeMap::from([
                ("samples", without_times(samples)),
                ("optima", without_times(optima)),
            ]),
            verification: BTreeMap::from([("kriging".to_owned(), vec![(0, 7), (1, 8)])]),
            failures: Vec::new(),
        }
    }

    #[test]
    fn every_difference_is_seen_but_that_of_times() {
        let undisturbed = outcome();
        assert_eq!(undisturbed.tables["optima"][1], "kriging,1.5");
        outcome().compare(&undisturbed).unwrap();

        let mut other = outcome();
        other.verification.get_mut("kriging").unwrap()[1].1 = 9;
        let said = other.compare(&undisturbed).unwrap_err().to_string();
        assert!(said.contains("the samples of kriging: (1, 9)"), "{said}");

        let mut other = outcome();
        other.tables.get_mut("samples").unwrap().pop();
        let said = other.compare(&undisturbed).unwrap_err().to_string();
        assert!(said.contains("samples: 2 rows"), "{said}");

        let mut twice = outcome();
        twice.tables.get_mut("samples").unwrap()[2] = "0,0,1.5".to_owned();
        let said = twice.is_whole().unwrap_err().to_string();
        assert!(said.contains("twice"), "{said}");
    }

    #[test]
    fn only_failures_that_were_made_are_expected() {
        const EXTERNAL: [Kind; 5] = [
            Kind::External,
            Kind::Alone,
            Kind::Licence,
            Kind::Problem,
            Kind::Files,
        ];
        let row = |kind| FailureRow {
            stream: StreamId::design(3),
            sample: None,
            shared: false,
            lease: 1,
            worker: "w".to_owned(),
            serial: None,
            kind,
            error: "no licence".to_owned(),
            at_unix_ms: None,
        };
        for (failure, allowed) in [
            (FailureKind::Crash, &Kind::ALL[..]),
            (FailureKind::Failure, &EXTERNAL),
            (FailureKind::Quarantine, &EXTERNAL),
        ] {
            let mut outcome = outcome();
            outcome.failures.push(row(failure));
            for kind in Kind::ALL {
                let is_allowed = outcome.check_failures(kind).is_ok();
                assert_eq!(is_allowed, allowed.contains(&kind), "{failure:?} {kind:?}");
            }
        }
    }
}
