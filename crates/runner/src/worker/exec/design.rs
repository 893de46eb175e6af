//! A design that an external simulator evaluates and samples.

use problem::formulation::{Design, RandomInputs};
use problem::simulator::{Analysis, NoAnswer, PreparedDesign, State};
use problem::task::NOT_A_NUMBER;
use rand::Rng as _;
use serde_json::Value;
use stats::streams::StreamRng;

use super::requests::Randomness;
use super::{Session, requests};

/// A design that a program simulates.
pub(super) struct ExternalDesign<'a> {
    session: &'a Session<'a>,
    design: Design,
    told: Value,
    /// The responses known so far; the others are NaN.
    responses: Vec<f64>,
    was_evaluated: bool,
}

impl<'a> ExternalDesign<'a> {
    /// Creates the design. `told` holds the values that the program gets.
    pub(super) fn new(session: &'a Session<'a>, design: &Design, told: &[(&str, f64)]) -> Self {
        Self {
            session,
            told: requests::numbers(told),
            design: design.clone(),
            responses: vec![f64::NAN; session.problem.responses().len()],
            was_evaluated: false,
        }
    }

    /// Requests the responses at `places` that are not known yet.
    fn evaluate(&mut self, places: &[usize]) -> Result<(), NoAnswer> {
        let problem = self.session.problem;
        let known = problem.responses();
        let asked = |place: usize| &*known[place].name;
        let missing = places
            .iter()
            .filter(|place| self.responses[**place].is_nan());
        let wanted: Vec<&str> = missing.map(|place| asked(*place)).collect();
        // If nothing is wanted, the program is still asked once: it may refuse the design.
        if wanted.is_empty() && self.was_evaluated {
            return Ok(());
        }
        let others: Vec<&str> = (0..known.len()).map(asked).collect();
        let random = match problem.random() {
            Some(inputs) => {
                let means = inputs.means(&self.design).map_err(NoAnswer::Refused)?;
                Some(named(inputs, &means))
            }
            None => None,
        };
        let question = requests::evaluate(&self.told, random, &wanted);
        let numbers = self.session.ask(question, &wanted, &others)?;
        let odd = numbers.iter().find(|(_, value)| !value.is_finite());
        if let Some((name, value)) = odd {
            return Err(NoAnswer::Refused(format!(
                "{NOT_A_NUMBER}: the simulator's {name} is {value}"
            )));
        }
        for (response, quantity) in self.responses.iter_mut().zip(known) {
            if let Some(number) = numbers.get(&*quantity.name) {
                *response = *number;
            }
        }
        self.was_evaluated = true;
        Ok(())
    }
}

impl PreparedDesign for ExternalDesign<'_> {
    fn analyse(&mut self, state: State) -> Result<Analysis, NoAnswer> {
        let problem = self.session.problem;
        let wanted: Vec<usize> = problem.wanted(state).collect();
        self.evaluate(&wanted)?;
        let analysis = problem.analysis(&self.design, &self.responses, state);
        analysis.ok_or_else(|| {
            NoAnswer::Failed("the responses are not those of the campaign".to_owned())
        })
    }

    fn sample(&mut self, rng: &mut StreamRng) -> Result<Vec<f64>, NoAnswer> {
        let modes = self.modes();
        if modes > 0 {
            return self.sample_at(&stats::normal_scores(rng, modes));
        }
        // 128 bits of the stream, in words of 32 bits, which every program can represent.
        let [low, high] = [rng.next_u64(), rng.next_u64()];
        let seed = [low, low >> 32, high, high >> 32].map(|word| word as u32);
        self.sample_from(Randomness::Seed(seed))
    }

    fn modes(&mut self) -> usize {
        let random = self.session.problem.random();
        random.map_or(0, |inputs| inputs.quantities().len())
    }

    fn sample_at(&mut self, coefficients: &[f64]) -> Result<Vec<f64>, NoAnswer> {
        let Some(inputs) = self.session.problem.random() else {
            return Err(NoAnswer::Failed(
                "the campaign has no random inputs".to_owned(),
            ));
        };
        let values = inputs.values(&self.design, coefficients);
        let values = values.map_err(NoAnswer::Failed)?;
        self.sample_from(Randomness::Values(named(inputs, &values)))
    }
}

/// Values of random inputs in the form of the requests.
fn named(inputs: &RandomInputs, values: &[f64]) -> Value {
    let names = inputs.quantities().iter().map(|one| &*one.name);
    let named: Vec<(&str, f64)> = names.zip(values.iter().copied()).collect();
    requests::numbers(&named)
}

impl ExternalDesign<'_> {
    fn sample_from(&self, from: Randomness) -> Result<Vec<f64>, NoAnswer> {
        let problem = self.session.problem;
        let names = requests::sampled(problem);
        let question = requests::sample(&self.told, from);
        match self.session.ask(question, &names, &names) {
            Ok(numbers) => Ok(names.iter().map(|name| numbers[*name]).collect()),
            Err(NoAnswer::Refused(_)) => Ok(vec![f64::NAN; names.len()]),
            Err(why) => Err(why),
        }
    }
}
