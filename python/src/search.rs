//! CMA-ES searches with an ask-and-tell interface.

use cmaes::{Bounds, CmaEs, Evaluation, Options, RunOptions};
use numpy::{IntoPyArray as _, PyArray1, PyArray2, PyArrayMethods as _};
use pyo3::prelude::*;
use stats::streams::{Purpose, StreamRng, stream};

use crate::arrays::{Matrix, Vector, numbers, rows, shape};
use crate::error::{PitchlineError, raised};

fn options(
    bounds: &Matrix<'_>,
    population: Option<usize>,
    parents: Option<usize>,
    step: f64,
) -> PyResult<Options> {
    let [_, ends] = shape(bounds);
    if ends != 2 {
        let text = format!("bounds have {ends} columns, they must have two: lower, upper");
        return Err(PitchlineError::new_err(text));
    }
    let pairs: Vec<(f64, f64)> = rows(bounds).chunks(2).map(|b| (b[0], b[1])).collect();
    let mut options = Options::new(Bounds::new(pairs).map_err(raised)?);
    options.step = step;
    if let Some(population) = population {
        options.population = population;
        options.parents = population / 2;
    }
    options.parents = parents.unwrap_or(options.parents);
    Ok(options)
}

fn evaluations(values: &Vector<'_>, violations: Option<&Vector<'_>>) -> PyResult<Vec<Evaluation>> {
    let values = numbers(values);
    let Some(violations) = violations else {
        return Ok(values.iter().map(|&value| value.into()).collect());
    };
    let violations = numbers(violations);
    if violations.len() != values.len() {
        let text = format!(
            "{} violations given for {} values; give one per value",
            violations.len(),
            values.len()
        );
        return Err(PitchlineError::new_err(text));
    }
    let pairs = values.iter().zip(violations.iter());
    Ok(pairs
        .map(|(&value, &violation)| Evaluation { value, violation })
        .collect())
}

fn candidates(
    py: Python<'_>,
    asked: Vec<Vec<f64>>,
    d: usize,
) -> PyResult<Bound<'_, PyArray2<f64>>> {
    let n = asked.len();
    asked.concat().into_pyarray(py).reshape([n, d])
}

/// A search without restarts.
#[pyclass(module = "pitchline._pitchline")]
pub(crate) struct Search {
    search: CmaEs,
    rng: StreamRng,
    dimension: usize,
}

#[pymethods]
impl Search {
    #[new]
    fn new(
        start: Vector<'_>,
        bounds: Matrix<'_>,
        population: Option<usize>,
        parents: Option<usize>,
        step: f64,
        seed: u64,
    ) -> PyResult<Self> {
        let options = options(&bounds, population, parents, step)?;
        let dimension = options.bounds.dimension();
        Ok(Self {
            search: CmaEs::new(&numbers(&start), options).map_err(raised)?,
            rng: stream(seed, Purpose::Optimise, 0, 0),
            dimension,
        })
    }

    fn ask<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let asked = self.search.ask(&mut self.rng);
        candidates(py, asked, self.dimension)
    }

    fn tell(&mut self, values: Vector<'_>, violations: Option<Vector<'_>>) -> PyResult<()> {
        let told = evaluations(&values, violations.as_ref())?;
        self.search.tell(&told).map_err(raised)
    }

    fn stop(&self) -> Option<String> {
        self.search.stop().map(|stop| stop.to_string())
    }

    fn best<'py>(&self, py: Python<'py>) -> Option<(Bound<'py, PyArray1<f64>>, f64, f64)> {
        let best = self.search.best();
        best.map(|(x, told)| (PyArray1::from_slice(py, x), told.value, told.violation))
    }

    fn mean<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.search.mean().into_pyarray(py)
    }

    fn step(&self) -> f64 {
        self.search.step()
    }

    fn evaluations(&self) -> usize {
        self.search.evaluations()
    }
}

type Outcome<'py> = (
    Bound<'py, PyArray1<f64>>,
    f64,
    f64,
    usize,
    Vec<(usize, f64, f64)>,
    Vec<(usize, String)>,
);

/// A search with restarts within a budget.
#[pyclass(module = "pitchline._pitchline")]
pub(crate) struct Run {
    run: cmaes::Run,
    rng: StreamRng,
    dimension: usize,
}

#[pymethods]
impl Run {
    #[new]
    #[expect(
        clippy::too_many_arguments,
        reason = "the settings of a run, all named in Python"
    )]
    fn new(
        start: Vector<'_>,
        bounds: Matrix<'_>,
        population: Option<usize>,
        parents: Option<usize>,
        step: f64,
        evaluations: usize,
        restarts: &str,
        seed: u64,
    ) -> PyResult<Self> {
        let search = options(&bounds, population, parents, step)?;
        let dimension = search.bounds.dimension();
        let options = RunOptions {
            tolerance: 0.0,
            search,
            evaluations,
            restarts: serde_json::from_value(restarts.into()).map_err(raised)?,
            restart_at: None,
        };
        Ok(Self {
            run: cmaes::Run::new(&numbers(&start), options).map_err(raised)?,
            rng: stream(seed, Purpose::Optimise, 0, 0),
            dimension,
        })
    }

    fn ask<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let asked = self.run.ask(&mut self.rng);
        candidates(py, asked, self.dimension)
    }

    fn tell(&mut self, values: Vector<'_>, violations: Option<Vector<'_>>) -> PyResult<()> {
        let told = evaluations(&values, violations.as_ref())?;
        self.run.tell(&told, &mut self.rng).map_err(raised)
    }

    fn is_finished(&self) -> bool {
        self.run.is_finished()
    }

    fn outcome<'py>(&self, py: Python<'py>) -> PyResult<Outcome<'py>> {
        let found = self.run.clone().outcome().map_err(raised)?;
        let history = found.history.iter();
        let restarts = found.restarts.iter();
        Ok((
            found.x.clone().into_pyarray(py),
            found.value,
            found.violation,
            found.evaluations,
            history
                .map(|(at, told)| (*at, told.value, told.violation))
                .collect(),
            restarts
                .map(|one| (one.evaluations, one.cause.to_string()))
                .collect(),
        ))
    }
}
