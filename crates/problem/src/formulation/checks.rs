//! Checks of the numbers that a simulator returns as samples and responses.

use super::{Analysis, Formulation, Problem, external, gears};

impl Problem {
    /// Whether these values stand for a failed sample of an external program.
    #[must_use]
    pub fn is_failed_sample(&self, values: &[f64]) -> bool {
        let sampling = &self.campaign.sampling;
        let is_failed = |value: &f64| *value == sampling.failed_sample();
        self.campaign.is_external() && sampling.tolerates_failures() && values.iter().all(is_failed)
    }

    /// The values of a failed sample.
    #[must_use]
    pub fn failed_sample(&self) -> Vec<f64> {
        vec![self.campaign.sampling.failed_sample(); self.sampled.len()]
    }

    /// The sample that a simulator's numbers stand for. If one is NaN or infinite, it is the failed sample if the
    /// campaign [tolerates failures](crate::file::Sampling::tolerates_failures), and unchanged otherwise.
    #[must_use]
    pub fn sample_of(&self, values: Vec<f64>) -> Vec<f64> {
        let sampling = &self.campaign.sampling;
        let is_result = self.campaign.is_external() && sampling.tolerates_failures();
        match values.iter().all(|value| value.is_finite()) || !is_result {
            true => values,
            false => self.failed_sample(),
        }
    }

    /// Checks that these numbers can be a sample: as many as there are sampled responses, each within the campaign's
    /// limits, and not so large that statistics overflow.
    ///
    /// # Errors
    ///
    /// The name of the response, and a sentence without its subject: the value and the valid range.
    pub fn check_sample(&self, values: &[f64]) -> Result<(), (&str, String)> {
        let (count, expected) = (values.len(), self.sampled.len());
        if count != expected {
            let why = format!("is one of {expected} sampled responses, and the sample has {count}");
            return Err((&self.sampled[0].name, why));
        }
        if self.is_failed_sample(values) {
            return Ok(());
        }
        let mut named = self.sampled.iter().zip(values).enumerate();
        named.try_for_each(|(place, (quantity, value))| {
            let checked = self.check_response(place, *value);
            checked.map_err(|why| (&*quantity.name, why))
        })
    }

    /// Checks one value of a sample.
    fn check_response(&self, place: usize, value: f64) -> Result<(), String> {
        match &self.kind {
            Formulation::Gears(_) => gears::check_delta_ste(value),
            Formulation::External(external) => external.check_sample(place, value),
        }
    }

    /// Checks the objective's response without random effects, as a sample's value is checked.
    ///
    /// # Errors
    ///
    /// A sentence without its subject: the value and the valid range.
    pub fn check_baseline(&self, value: f64) -> Result<(), String> {
        let name = &self.objective().response.name;
        let place = self.sampled.iter().position(|one| one.name == *name);
        self.check_response(place.unwrap_or_default(), value)
    }

    /// Checks the objective's response in an analysis by an external program, if it has one there.
    ///
    /// # Errors
    ///
    /// A sentence that names the response.
    pub fn check_analysis(&self, analysis: &Analysis) -> Result<(), String> {
        if !self.campaign.is_external() || !self.has_baseline() {
            return Ok(());
        }
        let name = &self.objective().response.name;
        let checked = self.check_baseline(analysis.value);
        checked.map_err(|why| format!("the simulator's {name} {why}"))
    }

    /// Checks that these numbers can be the responses of a design.
    ///
    /// # Errors
    ///
    /// A sentence that names the invalid response.
    pub fn check_responses(&self, responses: &[f64]) -> Result<(), String> {
        let expected = self.responses().len();
        if responses.len() != expected {
            let found = responses.len();
            return Err(format!("has {found} responses of a design, not {expected}"));
        }
        match &self.kind {
            Formulation::Gears(_) => gears::check(|name| self.response(responses, name)),
            Formulation::External(_) => {
                let mut named = self.responses.iter().zip(responses);
                named.try_for_each(|(quantity, &value)| {
                    let checked = match quantity.name == self.objective().response.name {
                        true => self.check_baseline(value),
                        false => external::check_number(value),
                    };
                    checked.map_err(|why| format!("{} {why}", quantity.name))
                })
            }
        }
    }
}
