//! Readings of the details that the paper leaves open, scored by the values that it prints.
//!
//! A reading is a law of wear, a tooth model and a tip rule. Its score compares every printed value
//! that is a ΔSTE: the nine statistics of Table 3 over the design of experiments, and
//! [`Place::values`] of the printed designs. The law's one free number, the depth or the coefficient,
//! is fitted to the printed designs with wear, without Table 3.

use std::fmt::Write as _;

use stats::streams::{Purpose, stream};

use super::printed::{self, ACCURATE_SAMPLES, Place, Quantity, SAMPLES};
use super::{WEAR, design, full_design};
use crate::input::{Discretisation, TipRule, ToothModel, Wear, WearLaw};
use crate::pair::Pair;
use crate::root_stress::stress_correction;
use crate::unloaded::UnloadedPair;

/// One way to read the paper.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// The law of wear with its depth or coefficient.
    pub law: WearLaw,
    /// The model of the deformation of teeth.
    pub tooth_model: ToothModel,
    /// The treatment of tips without clearance.
    pub tip_rule: TipRule,
}

/// A group of printed values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Group {
    /// Figures 6 and 7, without wear.
    Unworn,
    /// Printed designs with wear: Archard's ΔSTE, means and percentiles.
    Worn,
    /// The standard deviations of Table 1.
    Scatter,
    /// Statistics of the design of experiments.
    Table3,
}

/// One printed value beside ours, µm.
#[derive(Debug, Clone, PartialEq)]
pub struct Value {
    /// Name of the printed value, as in `Table 4 #3, P90`.
    pub name: String,
    /// Group of the value.
    pub group: Group,
    /// Whether it is a percentile of a printed design, to be ranked.
    pub ranked: bool,
    /// The paper's value.
    pub paper: f64,
    /// The value of the reading; NaN for a design that it refuses.
    pub ours: f64,
}

/// The comparison of a reading with the paper.
#[derive(Debug, Clone, PartialEq)]
pub struct Score {
    /// The reading.
    pub reading: Reading,
    /// Share of the design of experiments that cannot be simulated; 0.275 in the paper.
    pub refused: f64,
    /// Every printed value.
    pub values: Vec<Value>,
}

/// Each law of wear with each tooth model and tip rule; depth and coefficient are first guesses.
pub fn readings() -> impl Iterator<Item = Reading> {
    let laws = [
        WearLaw::Archard { max_depth_um: 3.5 },
        WearLaw::Signed {
            coefficient: 3.5e-7,
        },
    ];
    laws.into_iter().flat_map(|law| {
        TipRule::ALL.iter().flat_map(move |&tip_rule| {
            ToothModel::ALL.iter().map(move |&tooth_model| Reading {
                law,
                tooth_model,
                tip_rule,
            })
        })
    })
}

impl std::fmt::Display for Reading {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.law {
            WearLaw::Archard { max_depth_um } => {
                write!(f, "Archard's law with {max_depth_um:.1} µm per flank")?;
            }
            WearLaw::Signed { coefficient } => {
                write!(f, "Signed law with {:.1}e-7/MPa", 1e7 * coefficient)?;
            }
            WearLaw::LocalArchard { amount } => write!(f, "Local Archard's law, {amount:?}")?,
        }
        write!(f, ", {}, tips {}", self.tooth_model, self.tip_rule)
    }
}

impl Reading {
    /// Scores the reading as it is on the printed designs and on the design of experiments `doe`,
    /// whose points are those of [`design`]. `seed` names the random numbers.
    #[must_use]
    pub fn score(self, doe: &[[f64; 6]], seed: u64) -> Score {
        let mut values = self.printed_designs(seed);
        let (refused, table_3) = self.table_3(doe, seed);
        values.extend(table_3);
        Score {
            reading: self,
            refused,
            values,
        }
    }

    /// The reading with the depth or coefficient that fits the printed designs with wear best, to
    /// 1 %: golden-section search on its logarithm, three times either way.
    #[must_use]
    pub fn fitted(self, seed: u64) -> Self {
        let at = |log: f64| Self {
            law: self.law.scaled(log.exp()),
            ..self
        };
        let rms = |log: f64| {
            let values = at(log).printed_designs(seed);
            rms(values.iter().filter(|value| value.group != Group::Unworn))
        };
        let ratio = 0.5 * (5_f64.sqrt() - 1.0);
        let (mut low, mut high) = (-(3_f64.ln()), 3_f64.ln());
        let mut inner = [high - ratio * (high - low), low + ratio * (high - low)];
        let mut values = inner.map(rms);
        while high - low > 0.01 {
            if values[0] < values[1] {
                (high, inner[1], values[1]) = (inner[1], inner[0], values[0]);
                inner[0] = high - ratio * (high - low);
                values[0] = rms(inner[0]);
            } else {
                (low, inner[0], values[0]) = (inner[0], inner[1], values[1]);
                inner[1] = low + ratio * (high - low);
                values[1] = rms(inner[1]);
            }
        }
        at(0.5 * (low + high))
    }

    fn wear(self) -> Wear {
        Wear {
            law: self.law,
            ..WEAR
        }
    }

    fn pair(self, input: crate::PairInput) -> Option<Pair> {
        let input = crate::PairInput {
            tooth_model: self.tooth_model,
            tip_rule: self.tip_rule,
            ..input
        };
        Pair::new(&input, &Discretisation::default()).ok()
    }

    /// Mean and standard deviation of `samples` randomly worn pairs, NaN where there are none.
    fn sampled(self, pair: &Pair, purpose: Purpose, name: [u64; 2], samples: usize) -> [f64; 2] {
        let mut sampler = pair.sampler(&self.wear());
        let draws: Vec<f64> = (0..samples as u64)
            .map(|k| sampler.draw(&mut stream(name[0], purpose, name[1], k)))
            .collect();
        stats::mean_sd(&draws).map_or([f64::NAN; 2], |(mean, sd)| [mean, sd])
    }

    fn printed_designs(self, seed: u64) -> Vec<Value> {
        let mut values = Vec::new();
        for place in Place::all() {
            let pair = self.pair(full_design(place.variables()));
            let wanted = place.values();
            let random = |(quantity, _): &(Quantity, f64)| {
                !matches!(quantity, Quantity::Unworn | Quantity::Archard)
            };
            let samples = if wanted.iter().any(random) {
                ACCURATE_SAMPLES
            } else {
                0
            };
            let name = [seed, place.number()];
            let moments = pair
                .as_ref()
                .map(|pair| self.sampled(pair, Purpose::Verify, name, samples));
            let [mean, sd] = moments.unwrap_or([f64::NAN; 2]);
            for (quantity, paper) in wanted {
                let of_pair = |f: &dyn Fn(&Pair) -> f64| pair.as_ref().map_or(f64::NAN, f);
                let (what, ours, group) = match quantity {
                    Quantity::Unworn => (
                        "without wear",
                        of_pair(&|pair| pair.unworn().delta_ste_um),
                        Group::Unworn,
                    ),
                    Quantity::Archard => (
                        "Archard's wear",
                        of_pair(&|pair| pair.archard(&self.wear()).analysis.delta_ste_um),
                        Group::Worn,
                    ),
                    Quantity::Mean => ("mean", mean, Group::Worn),
                    Quantity::Sd => ("SD", sd, Group::Scatter),
                    Quantity::P90 => ("P90", mean + stats::PAPER_Z90 * sd, Group::Worn),
                };
                values.push(Value {
                    name: format!("{place}, {what}"),
                    group,
                    ranked: quantity == Quantity::P90,
                    paper,
                    ours,
                });
            }
        }
        values
    }

    fn table_3(self, doe: &[[f64; 6]], seed: u64) -> (f64, Vec<Value>) {
        let mut responses = [Vec::new(), Vec::new(), Vec::new()];
        for (number, &variables) in (0..).zip(doe) {
            let Some(pair) = self.pair(design(variables)) else {
                continue;
            };
            let [mean, sd] = self.sampled(&pair, Purpose::Wear, [seed, number], SAMPLES);
            responses[0].push(pair.unworn().delta_ste_um);
            responses[1].push(pair.archard(&self.wear()).analysis.delta_ste_um);
            responses[2].push(mean + stats::PAPER_Z90 * sd);
        }
        let refused = 1.0 - responses[0].len() as f64 / doe.len() as f64;
        let names = ["without wear", "Archard's wear", "P90"];
        let mut values = Vec::new();
        for ((name, ours), paper) in names.iter().zip(&responses).zip(&printed::RESPONSES) {
            let mean = ours.iter().sum::<f64>() / ours.len() as f64;
            let least = ours.iter().copied().fold(f64::INFINITY, f64::min);
            let most = ours.iter().copied().fold(0.0, f64::max);
            for (what, paper, ours) in [
                ("mean", paper.mean_um, mean),
                ("least", paper.min_um, least),
                ("greatest", paper.max_um, most),
            ] {
                values.push(Value {
                    name: format!("Table 3, {what} {name}"),
                    group: Group::Table3,
                    ranked: false,
                    paper,
                    ours,
                });
            }
        }
        (refused, values)
    }
}

/// The root stress in the reading that comes nearest to the paper's σ_vm, MPa: the pinion's alone, with the fillet
/// radius of its tool in Y_S in the place of the fillet's own.
#[must_use]
pub fn pinion_root_stress(pair: &UnloadedPair) -> f64 {
    let [root, _] = pair.root_stress();
    let [tool, _] = pair.input().root_radius;
    root.nominal_mpa * stress_correction(root.chord, root.arm, tool)
}

/// Root mean square of ln(ours/paper); NaN where a value is.
fn rms<'a>(values: impl Iterator<Item = &'a Value>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| {
        let log = (value.ours / value.paper).ln();
        (sum + log * log, count + 1.0)
    });
    f64::sqrt(sum / count)
}

impl Score {
    /// Root mean square of ln(ours/paper) over all printed values.
    #[must_use]
    pub fn rms(&self) -> f64 {
        rms(self.values.iter())
    }

    /// Root mean square of ln(ours/paper) over one group.
    #[must_use]
    pub fn rms_of(&self, group: Group) -> f64 {
        rms(self.values.iter().filter(|value| value.group == group))
    }

    /// Spearman's rank correlation of the printed designs' percentiles; NaN where there is none.
    #[must_use]
    pub fn rank_correlation(&self) -> f64 {
        let ranked = self.values.iter().filter(|value| value.ranked);
        let (ours, paper): (Vec<f64>, Vec<f64>) = ranked.map(|v| (v.ours, v.paper)).unzip();
        stats::spearman(&ours, &paper).unwrap_or(f64::NAN)
    }
}

/// Agreement of fitted readings with the paper, and the changes that the better ones make, as
/// Markdown.
#[must_use]
pub fn markdown(scores: &[Score]) -> String {
    let mut text = String::from(
        "## Readings of the paper\n\n\
         The paper does not state its law of wear, its tooth model, or its treatment of tips without \
         clearance. A reading is one choice of the three, and has a row in the table. Its score, in the \
         column “all”, is the root mean square of ln(ours/paper) over the 39 printed values of ΔSTE; 0 would \
         be perfect agreement. The next four columns are the same over a part of the values: 24 of printed \
         designs with wear, the 4 SDs of Table 1, 2 of designs without wear, and the 9 statistics of Table 3. \
         The column “fitted” is the depth of wear (µm per flank) of Archard's law, or the coefficient \
         (10⁻⁷/MPa) of the signed law, that fits the printed designs with wear best. The last columns are \
         Spearman's rank correlation of the 13 printed P90, and the share of the designs of experiments that \
         cannot be simulated (27.5 % in the paper).\n\n\
         | law | tooth model | tips | fitted | all | worn | Table 1, SDs | unworn | Table 3 | rank | \
         refused |\n|---|---|---|---:|---:|---:|---:|---:|---:|---:|---:|\n",
    );
    for score in scores {
        let reading = &score.reading;
        let fitted = match reading.law {
            WearLaw::Archard { max_depth_um } => format!("{max_depth_um:.1} µm"),
            WearLaw::Signed { coefficient } => format!("{:.1}", 1e7 * coefficient),
            WearLaw::LocalArchard { .. } => "–".to_owned(),
        };
        let groups = [Group::Worn, Group::Scatter, Group::Unworn, Group::Table3];
        let groups = groups
            .map(|group| format!("{:.3}", score.rms_of(group)))
            .join(" | ");
        let _ = writeln!(
            text,
            "| {} | {} | {} | {fitted} | {:.3} | {groups} | {:.2} | {:.1} % |",
            law(reading),
            reading.tooth_model,
            reading.tip_rule,
            score.rms(),
            score.rank_correlation(),
            100.0 * score.refused,
        );
    }
    let Some((first, others)) = scores.split_first() else {
        return text;
    };
    let _ = writeln!(
        text,
        "\nThe readings with a better score than the first row are compared with that row. A reading fixes \
         the values that only it brings within 20 % of the printed value. It breaks the values that only the \
         first row brings within 20 %:\n"
    );
    let near = |value: &Value| (value.ours / value.paper - 1.0).abs() <= 0.2;
    for score in others.iter().filter(|score| score.rms() < first.rms()) {
        let changed = |to: bool| {
            let pairs = first.values.iter().zip(&score.values);
            let names = pairs.filter(|(old, new)| near(old) != near(new) && near(new) == to);
            let names: Vec<&str> = names.map(|(_, new)| new.name.as_str()).collect();
            if names.is_empty() {
                "nothing".to_owned()
            } else {
                names.join("; ")
            }
        };
        let within = score.values.iter().filter(|value| near(value)).count();
        let _ = writeln!(
            text,
            "- **{}, {}, {}** ({within} of {} within 20 %): fixes {}. Breaks {}.",
            law(&score.reading),
            score.reading.tooth_model,
            score.reading.tip_rule,
            score.values.len(),
            changed(true),
            changed(false),
        );
    }
    text
}

const fn law(reading: &Reading) -> &'static str {
    match reading.law {
        WearLaw::Archard { .. } => "Archard",
        WearLaw::Signed { .. } => "signed",
        WearLaw::LocalArchard { .. } => "local Archard",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Figures 6 to 10.
    #[test]
    fn the_pinions_root_stress_with_the_tools_radius_is_nearer_to_print() {
        let rms = |stress: &dyn Fn(&UnloadedPair) -> f64| {
            let logs = printed::PRINTED.iter().map(|design| {
                let input = full_design(design.variables);
                let grid = Discretisation::default();
                let pair = UnloadedPair::new(&input, &crate::Corrections::default(), &grid);
                (stress(&pair.unwrap()) / design.von_mises_mpa).ln().powi(2)
            });
            (logs.sum::<f64>() / printed::PRINTED.len() as f64).sqrt()
        };
        let plain = rms(&|pair| {
            let [pinion, gear] = pair.root_stress();
            pinion.stress_mpa.max(gear.stress_mpa)
        });
        let read = rms(&pinion_root_stress);
        assert!((plain - 0.52).abs() < 0.01, "{plain}");
        assert!((read - 0.14).abs() < 0.01, "{read}");
    }
}
