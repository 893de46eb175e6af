//! The measurements of a study, and their CSV file.

use anyhow::{Context as _, bail};
use results::row;
use results::table::{Cell, Column};

/// The columns of a row before its values.
const LABELS: [&str; 4] = ["measured_for", "method", "setting", "campaign"];

/// The measurements of one setting of a method.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// The object of the measurement. Rows of different panels are not compared.
    pub panel: String,
    pub method: String,
    pub setting: String,
    /// Whether the setting is the campaign's own.
    pub is_campaign: bool,
    /// One value for each column; NaN for none.
    pub values: Vec<f64>,
}

/// The measurements of a study.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// The names of the values, with units.
    pub columns: Vec<String>,
    pub rows: Vec<Row>,
}

impl Table {
    /// Creates a table without rows.
    #[must_use]
    pub fn new(columns: &[&str]) -> Self {
        Self {
            columns: columns.iter().map(|&column| column.to_owned()).collect(),
            rows: Vec::new(),
        }
    }

    /// The panels, in the order of their rows.
    #[must_use]
    pub fn panels(&self) -> Vec<&str> {
        let mut panels: Vec<&str> = Vec::new();
        for row in &self.rows {
            if !panels.contains(&&*row.panel) {
                panels.push(&row.panel);
            }
        }
        panels
    }

    /// The table as CSV, with enough digits to read back the same numbers.
    ///
    /// # Errors
    ///
    /// The number of values in a row is not the number of columns.
    pub fn csv(&self) -> anyhow::Result<Vec<u8>> {
        let [panel, method, setting, campaign] = LABELS;
        let labels = [panel, method, setting].map(Column::text);
        let values = self.columns.iter().map(Column::number);
        let columns = labels
            .into_iter()
            .chain([Column::whole(campaign)])
            .chain(values);
        let mut table = results::table::Table::new(columns.collect());
        for row in &self.rows {
            let labels = row![&*row.panel, &*row.method, &*row.setting, row.is_campaign];
            let values = row.values.iter().map(|value| match value.is_nan() {
                true => Cell::Missing,
                false => Cell::Number(*value),
            });
            table.rows.push(labels.into_iter().chain(values).collect());
        }
        table.csv()
    }

    /// Reads a table from CSV.
    ///
    /// # Errors
    ///
    /// The text is not the CSV of a table; the error names the line and the reason.
    pub fn from_csv(csv: &[u8]) -> anyhow::Result<Self> {
        let mut reader = csv::Reader::from_reader(csv);
        let header = reader.headers()?.clone();
        if !header.iter().take(LABELS.len()).eq(LABELS) {
            bail!("line 1 must begin with {}", LABELS.join(","));
        }
        let columns = header.iter().skip(LABELS.len()).map(str::to_owned);
        let mut rows = Vec::new();
        for (record, line) in reader.records().zip(2..) {
            let record = record?;
            let value = |text: &str| match text {
                "" => Ok(f64::NAN),
                text => text
                    .parse()
                    .with_context(|| format!("line {line}: {text:?} is not a number")),
            };
            let values = record.iter().skip(LABELS.len()).map(value);
            rows.push(Row {
                panel: record[0].to_owned(),
                method: record[1].to_owned(),
                setting: record[2].to_owned(),
                is_campaign: &record[3] == "1",
                values: values.collect::<anyhow::Result<_>>()?,
            });
        }
        Ok(Self {
            columns: columns.collect(),
            rows,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_reads_back_as_it_was_written() {
        let mut table = Table::new(&["time (µs)", "error, \"95 %\" (%)"]);
        let row = |panel: &str, is_campaign, values: [f64; 2]| Row {
            panel: panel.to_owned(),
            method: "m + z s, unbiased".to_owned(),
            setting: "64 × 32".to_owned(),
            is_campaign,
            values: values.to_vec(),
        };
        table.rows.push(row("hertz-beam", true, [0.1 + 0.2, 1e-17]));
        table
            .rows
            .push(row("weber-banaschek", false, [3.0, f64::INFINITY]));
        assert_eq!(Table::from_csv(&table.csv().unwrap()).unwrap(), table);
        assert_eq!(table.panels(), ["hertz-beam", "weber-banaschek"]);
        // This row has no value in one column.
        table.rows.push(row("hertz-beam", false, [f64::NAN, 1.0]));
        let again = Table::from_csv(&table.csv().unwrap()).unwrap();
        assert!(again.rows[2].values[0].is_nan() && again.rows[2].values[1] == 1.0);
        assert_eq!(table.panels().len(), 2);
    }

    #[test]
    fn another_file_is_refused() {
        assert!(Table::from_csv(b"a,b\n1,2\n").is_err());
        let torn = b"measured_for,method,setting,campaign,x\na,b,c,0,2\na,b,c,0,x\n";
        let error = Table::from_csv(torn).unwrap_err();
        assert!(error.to_string().contains("line 3"), "{error}");
        assert!(Table::from_csv(b"measured_for,method,setting,campaign,x\na,b\n").is_err());
    }
}
