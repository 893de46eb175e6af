//! The contents of a store, read only.

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;

use ::problem::Approach;
use ::results::cell::Column;
use ::results::columnar::{Columns, Values};
use ::results::optima::{Optima, VerifiedOptimum};
use ::results::report::OptimiserRun;
use ::results::snapshot::Snapshot;
use ::results::table::Format;
use ::results::{describing, export, model, pair_file, report, snapshot, status};
use anyhow::Context as _;
use arrow_array::ffi_stream::FFI_ArrowArrayStream;
use arrow_array::{
    Array as _, ArrayRef, Float64Array, Int64Array, RecordBatch, RecordBatchIterator,
    RecordBatchReader, StringArray,
};
use arrow_schema::{DataType, Field, Schema};
use clap::ValueEnum as _;
use numpy::{IntoPyArray as _, PyArray1};
use pyo3::prelude::*;
use pyo3::types::PyCapsule;
use stages::names;

use crate::error::{PitchlineError, raised};
use crate::interrupt::interruptible;
use crate::kriging::Model;

/// The store of a campaign.
#[pyclass(module = "pitchline._pitchline", frozen)]
pub(crate) struct Store {
    path: PathBuf,
}

impl Store {
    /// The result of `read` on the store, which is open meanwhile.
    fn read<T: Send + 'static>(
        &self,
        py: Python<'_>,
        read: impl AsyncFnOnce(&::store::Store) -> anyhow::Result<T> + Send + 'static,
    ) -> PyResult<T> {
        let path = self.path.clone();
        let found = interruptible(py, move |_| {
            let runtime = tokio::runtime::Builder::new_current_thread()
                .enable_all()
                .build()?;
            runtime.block_on(async {
                let store = ::store::Store::open_read_only(&path).await?;
                let found = read(&store).await;
                store.close().await?;
                found
            })
        })?;
        found.map_err(raised)
    }
}

/// The table of this name. The model is not a table.
fn table_of(name: &str) -> PyResult<export::Table> {
    let tables = export::Table::value_variants().iter();
    let tables = tables.filter(|&&table| table != export::Table::Model);
    let tables: Vec<_> = tables
        .filter_map(|one| Some((*one, one.to_possible_value()?)))
        .collect();
    if let Some((table, _)) = tables.iter().find(|(_, value)| value.matches(name, false)) {
        return Ok(*table);
    }
    let names: Vec<&str> = tables.iter().map(|(_, value)| value.get_name()).collect();
    Err(PitchlineError::new_err(format!(
        "unknown table {name:?}; available: {}",
        names.join(", ")
    )))
}

/// Approach, start, and evaluations with the best objective so far.
type OptimiserHistory = (String, u32, Vec<(u64, f64)>);

/// An input of a model: name, unit, lowest and highest value.
type Input = (String, Option<String>, f64, f64);

#[pymethods]
impl Store {
    #[new]
    fn new(path: PathBuf) -> Self {
        Self { path }
    }

    /// The JSON object of `coordinator status`.
    fn status(&self, py: Python<'_>) -> PyResult<String> {
        self.read(py, async |store| {
            Ok(serde_json::to_string(&status::read(store).await?)?)
        })
    }

    /// The text of `coordinator status`.
    fn describe(&self, py: Python<'_>) -> PyResult<String> {
        self.read(py, async |store| {
            Ok(describing::describe(&status::read(store).await?))
        })
    }

    /// The approach whose optimum is recommended.
    fn recommended(&self, py: Python<'_>) -> PyResult<Option<String>> {
        self.read(py, async |store| {
            let problem = snapshot::problem(store).await?;
            let optima = Optima::read(store, &problem).await?;
            let best = optima.recommended();
            Ok(best.map(|best| problem.approach_name(best.optimum.approach).to_owned()))
        })
    }

    /// The optimum of an approach as the text of a pair file.
    fn pair(&self, py: Python<'_>, approach: String) -> PyResult<String> {
        self.read(py, async move |store| {
            let problem = snapshot::problem(store).await?;
            let named = |one: &Approach| problem.approach_name(*one) == approach;
            let found = Approach::ALL.into_iter().find(named);
            let found = found.with_context(|| format!("there is no approach {approach:?}"))?;
            Ok(pair_file::of_optimum(store, found).await?.to_toml())
        })
    }

    /// The text of the campaign file.
    fn campaign(&self, py: Python<'_>) -> PyResult<String> {
        self.read(py, async |store| Ok(store.campaign().await?.file_text))
    }

    /// The table of this name.
    fn table(&self, py: Python<'_>, name: &str) -> PyResult<Table> {
        let table = table_of(name)?;
        let columns = self.read(py, async move |store| export::columns(store, table).await)?;
        Table::new(columns)
    }

    /// The values of each optimum's verification samples from which the measure is estimated, by approach.
    fn verification<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<Vec<(String, Bound<'py, PyArray1<f64>>)>> {
        let found = self.read(py, async |store| {
            let problem = snapshot::problem(store).await?;
            let optima = Optima::read(store, &problem).await?;
            let of = |one: &VerifiedOptimum| {
                let name = problem.approach_name(one.optimum.approach).to_owned();
                (name, one.values(&problem))
            };
            Ok(optima.iter().map(of).collect::<Vec<_>>())
        })?;
        let of = |(name, values): (String, Vec<f64>)| (name, values.into_pyarray(py));
        Ok(found.into_iter().map(of).collect())
    }

    /// The finished runs of the optimisers: approach, start, and evaluations with the best objective so far.
    fn runs(&self, py: Python<'_>) -> PyResult<Vec<OptimiserHistory>> {
        self.read(py, async |store| {
            let snapshot = Snapshot::read(store).await?;
            let mut runs = Vec::new();
            for row in &snapshot.runs {
                if let Some((approach, _)) = names::approach_and_start(row.stream) {
                    let run = OptimiserRun::read(&snapshot.problem, row)?;
                    let name = snapshot.problem.approach_name(approach).to_owned();
                    runs.push((name, run.start, run.history));
                }
            }
            Ok(runs)
        })
    }

    /// Writes the report into a folder, and returns the path of its page.
    fn report(&self, py: Python<'_>, out: PathBuf) -> PyResult<PathBuf> {
        self.read(py, async move |store| {
            report::write(store, &out, &runner::coordinator::provenance::labels()).await
        })
    }

    /// Writes a table into a new file of this format.
    fn write(&self, py: Python<'_>, name: &str, format: &str, file: PathBuf) -> PyResult<()> {
        let table = table_of(name)?;
        let format = Format::from_str(format, false).map_err(PitchlineError::new_err)?;
        self.read(py, async move |store| {
            export::write_new(store, table, format, &file).await
        })
    }

    /// The kriging model, its inputs, the name and unit of its response, and the noise variance of an observation.
    fn model(
        &self,
        py: Python<'_>,
    ) -> PyResult<(Model, Vec<Input>, (String, Option<String>), f64)> {
        let file = self.read(py, async |store| model::stored(store).await)?;
        let inputs = file.inputs.into_iter();
        Ok((
            Model::new(file.surrogate),
            inputs
                .map(|one| (one.name, one.unit, one.low, one.high))
                .collect(),
            (file.response.name, file.response.unit),
            file.noise_variance,
        ))
    }
}

/// A table in Arrow's format.
#[pyclass(module = "pitchline._pitchline", frozen)]
pub(crate) struct Table {
    columns: Vec<Column>,
    rows: RecordBatch,
}

impl Table {
    fn new(Columns { columns, values }: Columns) -> PyResult<Self> {
        let arrays = values.iter().map(array).collect();
        let fields: Vec<Field> = columns.iter().map(field).collect();
        let schema = Arc::new(Schema::new(fields));
        Ok(Self {
            columns,
            rows: RecordBatch::try_new(schema, arrays).map_err(raised)?,
        })
    }
}

fn array(values: &Values) -> ArrayRef {
    match values {
        Values::Text(values) => Arc::new(StringArray::from_iter_values(values)),
        Values::Whole(values) => Arc::new(Int64Array::from(values.clone())),
        Values::Number(values) => Arc::new(Float64Array::from(values.clone())),
    }
}

/// The field of a column, with its unit as metadata.
fn field(column: &Column) -> Field {
    use ::results::cell::Kind;
    let kind = match column.kind {
        Kind::Text => DataType::Utf8,
        Kind::Whole => DataType::Int64,
        Kind::Number => DataType::Float64,
    };
    let field = Field::new(&column.name, kind, true);
    match &*column.unit {
        "" => field,
        unit => field.with_metadata(HashMap::from([("unit".to_owned(), unit.to_owned())])),
    }
}

#[pymethods]
impl Table {
    /// Arrow's PyCapsule interface.
    #[pyo3(signature = (requested_schema = None))]
    fn __arrow_c_stream__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyCapsule>> {
        // The interface allows a producer to ignore the requested schema.
        let _ = requested_schema;
        let schema = self.rows.schema();
        let rows = RecordBatchIterator::new([Ok(self.rows.clone())], schema);
        let rows: Box<dyn RecordBatchReader + Send> = Box::new(rows);
        PyCapsule::new_with_value(py, FFI_ArrowArrayStream::new(rows), c"arrow_array_stream")
    }

    /// Names and units of the columns; a unit is empty where there is none.
    fn columns(&self) -> Vec<(&str, &str)> {
        self.columns
            .iter()
            .map(|one| (&*one.name, &*one.unit))
            .collect()
    }

    fn __len__(&self) -> usize {
        self.rows.num_rows()
    }

    /// The values of the column at this place: an array of numbers, NaN where one is missing, or a list of texts. Whole
    /// numbers stay whole if none is missing.
    fn column<'py>(&self, py: Python<'py>, place: usize) -> PyResult<Bound<'py, PyAny>> {
        let values = self.rows.column(place).as_any();
        if let Some(numbers) = values.downcast_ref::<Float64Array>() {
            let numbers: Vec<f64> = numbers.iter().map(|one| one.unwrap_or(f64::NAN)).collect();
            return Ok(numbers.into_pyarray(py).into_any());
        }
        if let Some(numbers) = values.downcast_ref::<Int64Array>() {
            return Ok(if numbers.null_count() == 0 {
                numbers.values().to_vec().into_pyarray(py).into_any()
            } else {
                let numbers = numbers.iter();
                let numbers = numbers.map(|one| one.map_or(f64::NAN, |one| one as f64));
                numbers.collect::<Vec<f64>>().into_pyarray(py).into_any()
            });
        }
        let texts = values.downcast_ref::<StringArray>().into_iter().flatten();
        let texts: Vec<&str> = texts.flatten().collect();
        Ok(texts.into_pyobject(py)?.into_any())
    }
}
