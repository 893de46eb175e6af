//! The gears of a campaign file: many designs at once.

use std::sync::Arc;

use ::problem::Campaign;
use ::problem::formulation::{Design, Problem as Formulation, State};
use ::problem::simulator::{NoAnswer, PreparedDesign, Simulator as _};
use numpy::{IntoPyArray as _, PyArray2, PyArray3, PyArrayMethods as _};
use pyo3::prelude::*;
use rayon::prelude::*;
use stats::streams::{Purpose, stream};

use crate::arrays::{Matrix, rows, shape};
use crate::error::{PitchlineError, raised};
use crate::interrupt::{Stopping, interruptible};

/// The sections of a file as TOML, from JSON.
#[pyfunction]
pub(crate) fn toml_of(json: &str) -> PyResult<String> {
    let sections: toml::Table = serde_json::from_str(json).map_err(raised)?;
    toml::to_string(&sections).map_err(raised)
}

/// The name of the campaign in a file with this text.
#[pyfunction]
pub(crate) fn name_of(file: &str, text: &str) -> PyResult<String> {
    Ok(Campaign::parse(file, text).map_err(raised)?.name)
}

/// The problem of a campaign file of `kind = "gear"`.
#[pyclass(module = "pitchline._pitchline", frozen)]
pub(crate) struct Problem(Arc<Formulation>);

/// A name and a unit.
type Named = (String, String);

/// The numbers of all designs, one design after another, and for each design the reason why it has none.
type Found = (Vec<f64>, Vec<Option<String>>);

/// The result of `numbers` for each design, `width` numbers; NaN and the reason for a refused design.
fn of_each(
    problem: &Formulation,
    designs: &[Design],
    width: usize,
    stopping: &Stopping,
    numbers: impl Fn(usize, Box<dyn PreparedDesign + '_>) -> Result<Vec<f64>, NoAnswer> + Sync,
) -> Result<Found, String> {
    let one = |(index, design): (usize, &Design)| {
        if stopping.is_asked() {
            // The result is no longer wanted.
            return Ok((Vec::new(), None));
        }
        match problem.prepare(design).and_then(|one| numbers(index, one)) {
            Ok(values) => Ok((values, None)),
            Err(NoAnswer::Refused(reason)) => Ok((vec![f64::NAN; width], Some(reason))),
            Err(NoAnswer::Failed(error) | NoAnswer::Machine(error)) => Err(error),
        }
    };
    let found: Result<Vec<_>, String> = designs.par_iter().enumerate().map(one).collect();
    let (values, reasons): (Vec<Vec<f64>>, Vec<_>) = found?.into_iter().unzip();
    Ok((values.concat(), reasons))
}

fn named(name: &str, unit: &str) -> Named {
    let quantity = ::results::modelling::Quantity::of_problem(name, unit);
    (quantity.name, quantity.unit.unwrap_or_default())
}

impl Problem {
    /// The designs of the rows of `x`, whose columns are the free variables.
    fn designs(&self, x: &Matrix<'_>) -> PyResult<Vec<Design>> {
        let ([_, got], expected) = (shape(x), self.0.dimension());
        if got != expected {
            let names: Vec<&str> = self.0.free_names().collect();
            return Err(PitchlineError::new_err(format!(
                "a row of x has {got} numbers, it must have {expected}: {}",
                names.join(", ")
            )));
        }
        let rows = rows(x);
        let design = |row| self.0.design(row, self.0.base());
        Ok(rows.chunks(expected).map(design).collect())
    }

    /// [`of_each`] design, until the user interrupts.
    fn compute(
        &self,
        py: Python<'_>,
        x: &Matrix<'_>,
        width: usize,
        numbers: impl Fn(
            &Formulation,
            usize,
            Box<dyn PreparedDesign + '_>,
        ) -> Result<Vec<f64>, NoAnswer>
        + Send
        + Sync
        + 'static,
    ) -> PyResult<Found> {
        let designs = self.designs(x)?;
        let problem = Arc::clone(&self.0);
        let found = interruptible(py, move |stopping| {
            let numbers = |index, one: Box<dyn PreparedDesign + '_>| numbers(&problem, index, one);
            of_each(&problem, &designs, width, stopping, numbers)
        })?;
        found.map_err(PitchlineError::new_err)
    }
}

#[pymethods]
impl Problem {
    /// The problem of a campaign file with this text; `file` names it in errors.
    #[new]
    fn new(file: &str, text: &str) -> PyResult<Self> {
        let problem = Formulation::new(Campaign::parse(file, text).map_err(raised)?);
        if problem.gears().is_none() {
            return Err(PitchlineError::new_err(format!(
                "{file}: kind is \"external\", it must be \"gear\": an external problem is simulated by a program, \
                 in a campaign"
            )));
        }
        Ok(Self(Arc::new(problem)))
    }

    fn warnings(&self) -> Vec<String> {
        self.0.campaign().warnings()
    }

    /// Names and units of the free variables, in the order of a design's columns.
    fn variables(&self) -> Vec<Named> {
        let all = self.0.coordinates().iter();
        all.map(|one| named(&one.name, &one.unit)).collect()
    }

    /// Lowest and highest values of the free variables, shape (d, 2).
    fn bounds<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let ranges: Vec<[f64; 2]> = self.0.free_ranges().collect();
        let shape = [ranges.len(), 2];
        ranges.concat().into_pyarray(py).reshape(shape)
    }

    /// The designs of points in the unit box, discrete variables at their values.
    fn at_unit<'py>(
        &self,
        py: Python<'py>,
        unit: Matrix<'py>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let shape = shape(&unit);
        let rows = rows(&unit);
        let points = rows.chunks(shape[1].max(1));
        let found: Vec<f64> = points.flat_map(|unit| self.0.free_point(unit)).collect();
        found.into_pyarray(py).reshape(shape)
    }

    /// Names and units of the deterministic responses.
    fn responses(&self) -> Vec<Named> {
        let all = self.0.responses().iter();
        all.map(|one| named(&one.name, &one.unit)).collect()
    }

    /// Names and units of the sampled responses.
    fn sampled(&self) -> Vec<Named> {
        let all = self.0.sampled().iter();
        all.map(|one| named(&one.name, &one.unit)).collect()
    }

    /// The deterministic responses of designs, shape (n, responses), and why a design has none.
    fn evaluate<'py>(
        &self,
        py: Python<'py>,
        x: Matrix<'py>,
    ) -> PyResult<(Bound<'py, PyArray2<f64>>, Vec<Option<String>>)> {
        let width = self.0.responses().len();
        let (values, reasons) = self.compute(py, &x, width, |problem, _, mut one| {
            let nominal = one.analyse(State::Nominal)?;
            let baseline = one.analyse(State::Baseline)?;
            Ok(problem.responses_of(&nominal, &baseline))
        })?;
        let values = values.into_pyarray(py).reshape([reasons.len(), width])?;
        Ok((values, reasons))
    }

    /// Random responses of designs, shape (n, samples, sampled responses), and why a design has none. Design i has
    /// the random numbers of design `first` + i of a campaign with this seed and independent samples.
    fn sample<'py>(
        &self,
        py: Python<'py>,
        x: Matrix<'py>,
        samples: usize,
        seed: u64,
        first: u64,
    ) -> PyResult<(Bound<'py, PyArray3<f64>>, Vec<Option<String>>)> {
        let width = self.0.sampled().len();
        let (values, reasons) =
            self.compute(py, &x, samples * width, move |_, index, mut one| {
                let design = first + index as u64;
                let mut all = Vec::new();
                for sample in 0..samples as u64 {
                    let mut rng = stream(seed, Purpose::Wear, design, sample);
                    all.extend(one.sample(&mut rng)?);
                }
                Ok(all)
            })?;
        let values = values.into_pyarray(py);
        let values = values.reshape([reasons.len(), samples, width])?;
        Ok((values, reasons))
    }
}
