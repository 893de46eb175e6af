//! The content of a campaign file.

use kriging::Noise;
use sha2::{Digest, Sha256};

use super::validate::{InvalidValue, Source};
use super::{
    Budget, ConstraintSection, ControlVariate, Doe, Enrichment, ExternalSections, FileError,
    FrozenFrom, GearSections, Kriging, Optimise, Sampling, SimulatorKind, SimulatorSection, Verify,
    WearCoefficients,
};
use crate::approach::Approach;
use crate::quantity::Quantity;

/// A validated campaign file: one problem, one DoE, one seed.
#[derive(Debug, Clone, PartialEq)]
pub struct Campaign {
    /// The name, from which the default store and report are named.
    pub name: String,
    /// The seed of all random numbers of the campaign.
    pub seed: u64,
    /// The kind of problem, with its sections.
    pub kind: Kind,
    /// `approaches`: the requested approaches; `None` requests all that the other sections allow.
    pub approaches: Option<Vec<Approach>>,
    /// `[doe]`
    pub doe: Doe,
    /// `[sampling]`
    pub sampling: Sampling,
    /// `[kriging]`
    pub kriging: Kriging,
    /// `[optimise]`
    pub optimise: Optimise,
    /// `[verify]`
    pub verify: Verify,
    /// `[simulator]`
    pub simulator: SimulatorSection,
    /// `[budget]`
    pub budget: Budget,
    /// `[enrichment]`
    pub enrichment: Option<Enrichment>,
}

/// The object that a campaign designs, the file's `kind`.
#[derive(Debug, Clone, PartialEq)]
pub enum Kind {
    /// A gear pair, simulated by the built-in model or a program.
    Gears(Box<GearSections>),
    /// A problem whose variables and responses are named in the file and simulated by a program.
    External(ExternalSections),
}

impl Campaign {
    /// The version of the file format that this program reads.
    pub const FORMAT: u32 = 1;

    /// The shipped campaign file that users start from.
    pub const PAIR: &'static str = include_str!("../../../../campaigns/pair.toml");

    /// [`Self::PAIR`] with this name, if the name is valid.
    #[must_use]
    pub fn pair_named(name: &str) -> String {
        let name = if is_name(name) { name } else { "pair" };
        Self::PAIR.replacen("name = \"pair\"", &format!("name = {name:?}"), 1)
    }

    /// The shipped example of an external problem, with its program.
    pub const EXTERNAL: [&'static str; 2] = [
        include_str!("../../../../campaigns/bracket/campaign.toml"),
        include_str!("../../../../campaigns/bracket/bracket.py"),
    ];

    /// [`Self::EXTERNAL`] with this name, if the name is valid, and the name.
    #[must_use]
    pub fn external_named(name: &str) -> (String, [String; 2]) {
        let name = if is_name(name) { name } else { "bracket" };
        (
            name.to_owned(),
            Self::EXTERNAL.map(|text| {
                text.replace("name = \"bracket\"", &format!("name = {name:?}"))
                    .replace("bracket.toml", &format!("{name}.toml"))
                    .replace("bracket.py", &format!("{name}.py"))
            }),
        )
    }

    /// The shipped file of the paper's campaign with Archard's law of wear.
    pub const WEAR: &'static str = include_str!("../../../../campaigns/wear.toml");

    /// The shipped file of the paper's campaign.
    pub const PAPER: &'static str = include_str!("../../../../campaigns/paper.toml");

    /// Whether an external program is the simulator.
    #[must_use]
    pub fn is_external(&self) -> bool {
        self.simulator.kind == SimulatorKind::External
    }

    /// The sections of a gear campaign; `None` for another kind.
    #[must_use]
    pub fn gears(&self) -> Option<&GearSections> {
        match &self.kind {
            Kind::Gears(sections) => Some(sections),
            Kind::External(_) => None,
        }
    }

    /// The source of the noise variances of measures that constraints limit: smoothed if all designs have the same
    /// number of samples. The models of these measures would be drawn towards designs that seem safe by chance if each
    /// design had its own variance, most of all at levels near 0 or 1.
    #[must_use]
    pub fn limit_noise(&self) -> Noise {
        let are_equal = self.sampling.precision.is_none();
        let smoothed = if are_equal {
            Noise::Smoothed
        } else {
            Noise::Own
        };
        self.kriging.noise.unwrap_or(smoothed)
    }

    /// Whether the campaign itself draws the random numbers of a sample; otherwise the program draws them.
    pub(crate) fn has_scores(&self) -> bool {
        match &self.kind {
            Kind::Gears(_) => !self.is_external(),
            Kind::External(sections) => !sections.random.is_empty(),
        }
    }

    /// Like [`gears`](Self::gears), but mutable.
    pub fn gears_mut(&mut self) -> Option<&mut GearSections> {
        match &mut self.kind {
            Kind::Gears(sections) => Some(sections),
            Kind::External(_) => None,
        }
    }

    /// Whether the report shows the paper's figures beside the campaign's.
    #[must_use]
    pub fn compares_with_paper(&self) -> bool {
        self.gears()
            .is_some_and(|sections| sections.report.compare_with_paper)
    }

    /// SHA-256 of the campaign's content as hex. It does not depend on comments, layout and key order, nor on
    /// `[budget]`, nor on the keys of `[simulator]` besides `kind` and `probe_designs`.
    #[must_use]
    pub fn digest(&self) -> String {
        let mut content = self.clone();
        content.simulator = content.simulator.of_values();
        content.budget = Budget::default();
        hex::encode(Sha256::digest(content.to_json()))
    }

    /// [`Self::values_digest`] in hex: the identity of a campaign and of those that extend it.
    #[must_use]
    pub fn lineage(&self) -> String {
        hex::encode(self.values_digest())
    }

    /// SHA-256 of everything that the values of a design's samples may depend on. It is the same
    /// for a campaign and one that [extends](Self::extends) it.
    #[must_use]
    pub fn values_digest(&self) -> [u8; 32] {
        let mut values = self.clone();
        values.doe.designs = 0;
        values.sampling.samples_per_design = 0;
        values.verify = Verify::default();
        values.budget = Budget::default();
        values.enrichment = None;
        values.approaches = None;
        if !self.samples_follow_measure() {
            values.sampling.objective = values.sampling.objective.of_aim();
            values.set_sampled_constraints(Vec::new());
        }
        values.kriging = self.kriging.without_choices();
        values.simulator = self.simulator.of_values();
        values.set_limits(&[]);
        Sha256::digest(values.to_json().as_bytes()).into()
    }

    /// Whether this campaign is a larger version of `held`: more designs, more samples per design or more verification
    /// samples, more approaches, an enrichment or a larger budget for it, other limits of the response, another measure
    /// of it, or another model with the same kernel, and everything else that the [digest](Self::digest) depends on
    /// the same. The samples taken for `held` are then part of this campaign.
    #[must_use]
    pub fn extends(&self, held: &Self) -> bool {
        let sizes = |campaign: &Self| [campaign.doe.designs, campaign.sampling.samples_per_design];
        let grows = sizes(self).iter().zip(sizes(held)).all(|(a, b)| *a >= b)
            && self.verify.extends(&held.verify);
        let enriches = match (&self.enrichment, &held.enrichment) {
            (Some(section), Some(held)) => section.extends(held),
            (section, held) => held.is_none() || section == held,
        };
        let has_all = match (&self.approaches, &held.approaches) {
            (Some(ours), Some(held)) => held.iter().all(|approach| ours.contains(approach)),
            (ours, _) => ours.is_none(),
        };
        let mut same = self.clone();
        same.approaches.clone_from(&held.approaches);
        let aims = [self, held].map(|campaign| campaign.sampling.objective.aim);
        if aims[0] == aims[1] && !self.samples_follow_measure() && !held.samples_follow_measure() {
            same.sampling.objective = held.sampling.objective.clone();
            same.set_sampled_constraints(held.sampled_constraints());
        }
        same.budget = held.budget;
        same.doe.designs = held.doe.designs;
        same.sampling.samples_per_design = held.sampling.samples_per_design;
        same.verify = held.verify;
        same.enrichment = held.enrichment;
        same.set_limits(&held.limits());
        if same.simulator.of_values() == held.simulator.of_values() {
            same.simulator = held.simulator.clone();
        }
        if self.kriging.kernel == held.kriging.kernel {
            same.kriging = held.kriging.clone();
        }
        let mut held = held.clone();
        held.set_sampled_constraints(held.sampled_constraints());
        grows && enriches && has_all && same == held
    }

    /// Whether samples depend on the measure: a direct search takes them where the measure is good.
    const fn samples_follow_measure(&self) -> bool {
        self.optimise.direct
    }

    /// `min` and `max` of the responses. They decide which samples are accepted, not their values.
    fn limits(&self) -> Vec<[Option<f64>; 2]> {
        match &self.kind {
            Kind::Gears(_) => Vec::new(),
            Kind::External(sections) => {
                let responses = sections.responses.iter();
                responses.map(|one| [one.min, one.max]).collect()
            }
        }
    }

    /// Sets the limits; a response beyond the list gets none.
    fn set_limits(&mut self, limits: &[[Option<f64>; 2]]) {
        if let Kind::External(sections) = &mut self.kind {
            let limits = limits.iter().copied().chain(std::iter::repeat([None; 2]));
            for (response, limits) in sections.responses.iter_mut().zip(limits) {
                [response.min, response.max] = limits;
            }
        }
    }

    /// Sets the constraints on measures of samples. Like the measure that is optimised, they decide how samples are
    /// interpreted and not their values, so that a campaign keeps its samples when they change.
    fn set_sampled_constraints(&mut self, constraints: Vec<ConstraintSection>) {
        if let Kind::External(sections) = &mut self.kind {
            let is_deterministic = |one: &ConstraintSection| one.measure.is_none();
            sections.constraints.retain(is_deterministic);
            sections.constraints.extend(constraints);
        }
    }

    fn sampled_constraints(&self) -> Vec<ConstraintSection> {
        match &self.kind {
            Kind::Gears(_) => Vec::new(),
            Kind::External(sections) => {
                let constraints = sections.constraints.iter();
                let sampled = constraints.filter(|one| one.measure.is_some());
                sampled.cloned().collect()
            }
        }
    }

    /// Advice about settings that are valid but doubtful.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        let samples = self.sampling.samples_per_design;
        if samples < 25 {
            warnings.push(format!(
                "sampling.samples_per_design is {samples}: below 25 samples their normality, on \
                 which the percentile rests, cannot be trusted"
            ));
        }
        let most = self.sampling.samples_max();
        let unused = self
            .doe
            .samples
            .iter()
            .filter(|of| of.len() > most as usize)
            .count();
        if unused > 0 {
            warnings.push(format!(
                "doe.samples has more than {most} samples for {unused} designs: only the first {most} of each are used"
            ));
        }
        if let Some(sections) = self.gears()
            && !sections.constraints.limit_roots()
        {
            warnings.push(
                "[constraints] limits no stress of the roots: root_safety_min is the smallest S_F of ISO 6336"
                    .to_owned(),
            );
        }
        warnings.extend(self.sampling.doubt(&self.measure_name()));
        warnings.extend(self.warning_of_normality());
        let (verified, needed) = (self.verify.first(), self.sampling.verified_min_samples());
        if (verified as usize) < needed {
            warnings.push(format!(
                "verify.samples is {verified}: a 95 % interval of {} takes at least {needed}, so the report \
                 will have none",
                self.measure_name()
            ));
        }
        if let Some(enrichment) = &self.enrichment {
            let first = u64::from(self.doe.designs) * u64::from(samples);
            let budget = u64::from(enrichment.samples);
            if budget < first {
                warnings.push(format!(
                    "enrichment.samples is {budget}: the DoE alone can take {first}, which leaves \
                     little or nothing for infill{}",
                    match self.sampling.skip_violation() {
                        Some(_) => ", unless sampling.skip_violation leaves many designs out",
                        None => "",
                    }
                ));
            }
        }
        match &self.kind {
            Kind::Gears(sections) => warnings.extend(sections.warnings()),
            Kind::External(sections) => {
                warnings.extend(sections.warnings(&self.sampling, &self.verify));
            }
        }
        warnings
    }

    /// The name of the measure that is optimised: P90, mean, P(y > 5 mm).
    #[must_use]
    pub fn measure_name(&self) -> String {
        let response = match &self.kind {
            Kind::Gears(_) => Quantity::of("ΔSTE", "µm"),
            Kind::External(sections) => {
                sections.response_of(self.sampling.objective.response.as_ref())
            }
        };
        self.sampling
            .objective
            .name([&response.name, &response.unit])
    }

    /// A warning about the normal estimator with random slope deviations. ΔSTE then has a long tail, and the normal
    /// formula gives half to three quarters of the percentile's true standard error (`stages::responses` has the test).
    fn warning_of_normality(&self) -> Option<String> {
        self.gears()?.manufacture?;
        let key = if self.sampling.control == ControlVariate::Linearised {
            "sampling.control = \"linearised\""
        } else if self.sampling.estimator_rule().harrell_davis().is_none()
            && self.sampling.coefficients == WearCoefficients::Independent
        {
            "a normal percentile"
        } else {
            return None;
        };
        Some(format!(
            "{key} with [manufacture] underestimates the standard error of the percentile, because random slope \
             deviations make ΔSTE non-normal: use sampling.estimator = \"chosen\", which tests for normality and \
             excludes a control variate"
        ))
    }

    pub(crate) fn validate(&self, source: Source<'_>) -> Result<(), FileError> {
        source.require(
            is_name(&self.name),
            "name",
            &self.name,
            "1 to 64 letters, digits, hyphens or underscores",
        )?;
        // TOML's integers are signed, so a larger seed could not be written to a file.
        source.require(
            i64::try_from(self.seed).is_ok(),
            "seed",
            self.seed,
            "a whole number below 2^63",
        )?;
        self.simulator.validate(source)?;
        match &self.kind {
            Kind::Gears(sections) => sections.validate(source, self.is_external())?,
            Kind::External(sections) => {
                sections.validate(source, &self.sampling.objective)?;
                sections.validate_read(source, &self.simulator.read)?;
            }
        }
        self.validate_approaches(source)?;
        if let Some(enrichment) = &self.enrichment {
            enrichment.validate(source)?;
            self.infill_is_possible(source)?;
        }
        self.doe.validate(source)?;
        let is_gears = self.gears().is_some();
        self.sampling.objective.validate(source, is_gears)?;
        self.sampling
            .validate(source, self.is_external(), self.has_scores())?;
        let has_cases = self.gears().is_some_and(|one| !one.load.cases.is_empty());
        source.require(
            !has_cases || self.sampling.control == ControlVariate::None,
            "sampling.control",
            self.sampling.control,
            "absent beside [[load.cases]]: the control variate is linear in the wear, and the greatest of several \
             responses is not",
        )?;
        source.require(
            self.sampling.objective.is_papers() || !self.compares_with_paper(),
            "objective",
            self.measure_name(),
            "absent beside report.compare_with_paper: the paper prints 90th percentiles",
        )?;
        self.verify.validate(source)?;
        self.budget.validate(source)?;
        self.kriging
            .validate(source, self.doe.designs, &self.sampling)?;
        self.optimise.validate(source)
    }

    /// Requires that the listed approaches are possible, and that no key asks for an approach outside the list.
    fn validate_approaches(&self, source: Source<'_>) -> Result<(), FileError> {
        let Some(listed) = &self.approaches else {
            return Ok(());
        };
        let refuse = |expected: &str| Err(source.refuse("approaches", listed, expected));
        let has = |approach| listed.contains(&approach);
        let has_baseline = match &self.kind {
            Kind::Gears(_) => true,
            Kind::External(sections) => sections.responses.iter().any(|one| one.baseline),
        };
        let base = self.gears().and_then(|sections| sections.frozen);
        let needs_base = base.is_some_and(|frozen| frozen.from == FrozenFrom::Deterministic);
        let is_double = (1..listed.len()).any(|place| listed[..place].contains(&listed[place]));
        if listed.is_empty() || is_double {
            return refuse("a list of one or more different approaches");
        }
        if has(Approach::Nominal) && self.gears().is_none() {
            return refuse("without \"no-wear\", which is for gears");
        }
        if has(Approach::Baseline) && !has_baseline {
            return refuse(
                "without \"baseline\", unless the objective's response has baseline = true",
            );
        }
        if needs_base && !has(Approach::Nominal) {
            return refuse(
                "with \"no-wear\" beside frozen.from = \"deterministic\", which takes its optimum",
            );
        }
        if has(Approach::EnrichedKriging) != self.enrichment.is_some() {
            return refuse(
                "with \"enriched-kriging\" beside a section [enrichment], and only then",
            );
        }
        if has(Approach::Direct) != self.optimise.direct {
            return refuse("with \"direct\" beside optimise.direct = true, and only then");
        }
        Ok(())
    }

    /// Requires that the coordinator can decide rounds of infill.
    fn infill_is_possible(&self, source: Source<'_>) -> Result<(), FileError> {
        if self.gears().is_some() && self.is_external() {
            let expected = "absent when simulator.kind is \"external\": the coordinator evaluates the \
                            constraints of thousands of candidates itself, with the built-in model";
            return Err(source.error(InvalidValue::in_words("enrichment", "present", expected)));
        }
        source.require(
            self.sampling.coefficients == WearCoefficients::Independent,
            "sampling.coefficients",
            self.sampling.coefficients,
            "\"independent\" beside [enrichment], whose designs get more samples a few at a time",
        )
    }
}

/// Whether this is a valid name of a campaign.
fn is_name(name: &str) -> bool {
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    (1..=64).contains(&name.len()) && name.chars().all(plain)
}

#[cfg(test)]
mod tests;
