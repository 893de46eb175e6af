//! One gear pair.

use ::problem::PairFile;
use ::problem::formulation::gears::LoadedCases;
use gear::{Discretisation, Geometry};
use numpy::{IntoPyArray as _, PyArray1, PyArray2, PyArrayMethods as _};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;
use stats::streams::{Purpose, stream};
use studies::simulate::{self, Request, WearChoice};

use crate::error::{PitchlineError, raised};
use crate::interrupt::{detached, interruptible};

/// Samples that are drawn one after another by one copy of the sampler.
const RUN: usize = 64;

/// The pair of a pair file.
#[pyclass(module = "pitchline._pitchline", frozen)]
pub(crate) struct Pair {
    file: PairFile,
    pair: gear::Pair,
}

impl Pair {
    fn of(file: PairFile) -> PyResult<Self> {
        let pair = gear::Pair::with_corrections(
            &file.to_gear(),
            &file.corrections(),
            &Discretisation::of(file.pair.tooth_model),
        );
        let pair = pair.map_err(|error| match error {
            gear::Error::Infeasible(infeasible) => {
                PitchlineError::new_err(format!("{}: {infeasible}", infeasible.code()))
            }
            error => raised(error),
        })?;
        Ok(Self { file, pair })
    }
}

#[pymethods]
impl Pair {
    /// The pair of a pair file with this text; `file` names it in errors.
    #[new]
    fn new(file: &str, text: &str) -> PyResult<Self> {
        Self::of(PairFile::parse(file, text).map_err(raised)?)
    }

    fn to_toml(&self) -> String {
        self.file.to_toml()
    }

    /// The JSON object of `coordinator simulate`.
    fn simulate(&self, py: Python<'_>, wear: &str, samples: u32, seed: u64) -> PyResult<String> {
        let wear = match wear {
            "none" => WearChoice::None,
            "archard" => WearChoice::Archard,
            "random" => WearChoice::Random,
            _ => {
                let text =
                    format!("wear is {wear:?}, it must be \"none\", \"archard\" or \"random\"");
                return Err(PitchlineError::new_err(text));
            }
        };
        let request = Request {
            wear,
            seed,
            samples,
        };
        let file = self.file.clone();
        let found = interruptible(py, move |_| {
            simulate::to_json(&simulate::run(&file, request)?)
        })?;
        Ok(found.map_err(raised)?.to_string())
    }

    /// The mesh phases, fractions of a base pitch, and the transmission error at each, µm.
    fn transmission_error<'py>(
        &self,
        py: Python<'py>,
        is_worn: bool,
    ) -> PyResult<(Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>)> {
        let analysis = detached(py, || match is_worn {
            true => self.pair.archard(&self.file.wear).analysis,
            false => self.pair.unworn(),
        })?;
        Ok((
            analysis.phases.into_pyarray(py),
            analysis.ste_um.into_pyarray(py),
        ))
    }

    /// ΔSTE of random pairs in µm, shape (samples, load cases).
    fn sample<'py>(
        &self,
        py: Python<'py>,
        samples: usize,
        seed: u64,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let file = &self.file;
        let cases = LoadedCases::new(self.pair.clone(), &file.load, &file.wear, file.scatter())
            .map_err(raised)?;
        let width = file.load.all_cases().len();
        let values = interruptible(py, move |stopping| {
            let sampler = cases.sampler();
            let run = |start: usize| {
                let mut sampler = sampler.clone();
                let drawn = (start..samples.min(start + RUN)).flat_map(move |sample| {
                    sampler.draw(&mut stream(seed, Purpose::Wear, 0, sample as u64))
                });
                drawn.collect::<Vec<f64>>()
            };
            let runs: Vec<usize> = (0..samples).step_by(RUN).collect();
            let wanted = |start: &usize| (!stopping.is_asked()).then(|| run(*start));
            runs.par_iter()
                .filter_map(wanted)
                .flatten_iter()
                .collect::<Vec<f64>>()
        })?;
        values.into_pyarray(py).reshape([samples, width])
    }

    /// The names of the load cases.
    fn load_cases(&self) -> Vec<String> {
        self.file.load.case_names()
    }

    /// The geometry by the symbols of ISO 21771, in mm and degrees.
    fn geometry<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let geometry: &Geometry = self.pair.geometry();
        let diameters = |radii: [f64; 2]| radii.map(|radius| 2.0 * radius);
        let of = PyDict::new(py);
        of.set_item("z", geometry.teeth)?;
        for (symbol, value) in [
            ("m_n", geometry.normal_module),
            ("a", geometry.centre_distance),
            ("alpha_n", geometry.alpha_n.to_degrees()),
            ("alpha_t", geometry.alpha_t.to_degrees()),
            ("alpha_wt", geometry.alpha_wt.to_degrees()),
            ("beta", geometry.beta.to_degrees()),
            ("beta_b", geometry.beta_b.to_degrees()),
            ("b", geometry.face_width),
            ("p_bt", geometry.base_pitch),
            ("epsilon_alpha", geometry.eps_alpha),
            ("epsilon_beta", geometry.eps_beta),
            ("epsilon_gamma", geometry.contact_ratio),
            ("j_wt", geometry.backlash),
        ] {
            of.set_item(symbol, value)?;
        }
        for (symbol, values) in [
            ("x", self.file.to_gear().profile_shift),
            ("d", diameters(geometry.r)),
            ("d_b", diameters(geometry.r_b)),
            ("d_a", diameters(geometry.r_a)),
            ("d_f", diameters(geometry.r_f)),
            ("d_Na", diameters(geometry.r_na)),
            ("c", geometry.clearance),
        ] {
            of.set_item(symbol, values)?;
        }
        Ok(of)
    }
}
