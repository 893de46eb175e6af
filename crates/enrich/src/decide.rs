//! One round: from rows to infill points, a recommendation and perhaps a reason to stop.

use kriging::Warning;
use rand::RngExt as _;
use stats::streams::{Purpose, stream};

use crate::infill::{Exact, Objective, Pick, distance, fill_space, is_same, search};
use crate::state::Rows;
use crate::surrogate::Surrogate;
use crate::{
    Decision, Error, Infill, Known, Note, Options, Reason, Recommendation, State, Stop, Z95,
};

/// Names the random streams of the enrichment among those of the optimisers.
const STREAM: u64 = 5;
/// By how much the trust region is wider than the designs it spans, each way, and its least
/// half-width, as shares of its own and of the whole range.
const WIDER: f64 = 0.1;
const LEAST: f64 = 0.005;
/// How far apart, as a share of the ranges, the centres of two trust regions are.
const APART: f64 = 0.15;
/// An observation is made if it is expected to be worth this share of δ: several small gains add up.
const WORTHWHILE: f64 = 0.25;
/// The fewest turns at the recommended design in a round that only confirms it: a few, since the
/// model learns less from them than their number says.
const CONFIRMING: f64 = 6.0;
/// Rounds in a row that must be below δ, and that may fail altogether.
const IN_A_ROW: usize = 2;

/// Decides the next round from what the rows say.
///
/// `exact` evaluates the cheap deterministic criteria of a design: how far the constraints are missed
/// (in the caller's units), 0 or less if it is feasible, and a [baseline](Known::baseline_um) of the
/// response if there is one; none if the design cannot be evaluated. No surrogate stands in for it.
///
/// The models: one of all designs; and one around each of the [`Options::basins`] best designs that
/// are at least 15 % of a range apart, of the [`Options::local_points`] nearest designs with a
/// covariance of its own, which replaces the first there if its leave-one-out residuals are smaller.
/// With baselines there are two of each, of the response above its baseline and of the response
/// itself. The one with the smaller residuals recommends; both search, each as a basin of its own.
/// Infill points are sought in the basins' trust regions in turn, boxes around the
/// [`Options::region_points`] nearest designs, which shrink by themselves as designs gather; every
/// [`Options::global_every`]-th in the whole box. A basin is improved on its own best design, until
/// less than a quarter of δ is expected in it; so a basin that was sampled badly at first gets its chance. What
/// is left when all are exhausted goes to the recommended design, as far as its interval needs it.
///
/// The batch is built point by point, each believed to come out as predicted (D. Ginsbourger,
/// R. Le Riche, L. Carraro, *Kriging is well-suited to parallelize optimization*, 2010). Each time,
/// the best new design competes with more samples at the existing ones, by expected improvement of
/// the quantile **per sample**: that rule divides the effort.
///
/// The result is a function of the arguments alone, whatever the number of threads.
///
/// # Errors
///
/// [`Error::Design`], [`Error::Variance`] and [`Error::Setting`] for unusable rows and settings. A
/// model that cannot be fitted is a note, not an error.
pub fn decide<F, K>(state: &State, options: &Options, exact: &F) -> Result<Decision, Error>
where
    F: Fn(&[f64]) -> Option<K>,
    K: Into<Known>,
{
    let constraints = &|x: &[f64]| exact(x).map(Into::into);
    options.check()?;
    let rows = Rows::new(state, options)?;
    let round = Round {
        state,
        options,
        exact: Exact {
            constraints,
            evaluations: 0,
        },
        notes: Vec::new(),
        infill: Vec::new(),
        left: options.samples_left,
        rows,
    };
    round.run()
}

struct Round<'a, F> {
    state: &'a State,
    options: &'a Options,
    rows: Rows,
    exact: Exact<'a, F>,
    notes: Vec<Note>,
    infill: Vec<Infill>,
    left: u32,
}

/// The models of a round.
struct Models {
    /// Of all designs, the best one first.
    global: Vec<Surrogate>,
    /// By their best designs, the best one first, each followed by its rivals.
    basins: Vec<Basin>,
}

/// The surroundings of a good design.
struct Basin {
    model: Surrogate,
    region: Vec<(f64, f64)>,
    /// Its best row.
    best: usize,
    /// The rows in its region that may be improved on.
    incumbents: Vec<usize>,
    /// Whether nothing worth the effort is left to expect in it.
    is_exhausted: bool,
}

impl<F: Fn(&[f64]) -> Option<Known>> Round<'_, F> {
    fn run(mut self) -> Result<Decision, Error> {
        if self.rows.merged > 0 {
            let entries = self.rows.merged;
            self.notes.push(Note::Merged { entries });
        }
        if self.rows.not_numbers > 0 {
            let entries = self.rows.not_numbers;
            self.notes.push(Note::NotNumbers { entries });
        }
        let rounds = &self.state.rounds;
        let failed = |r: &&crate::RoundRecord| r.asked > 0 && r.failed >= r.asked;
        let failures = rounds.iter().rev().take_while(failed).count();
        if failures > 0 {
            self.notes.push(Note::RoundFailed);
        }

        let models = self.models()?;
        let recommendation = models.as_ref().and_then(|m| self.recommendation(m));
        if failures >= IN_A_ROW {
            return Ok(self.decision(recommendation, None, Some(Stop::OnlyFailures)));
        }
        let cheapest = self.options.samples_new.min(self.options.samples_more);
        if self.left < cheapest {
            let samples = self.left;
            return Ok(self.decision(recommendation, None, Some(Stop::Budget { samples })));
        }

        if rounds.len() >= self.options.rounds {
            let rounds = rounds.len();
            return Ok(self.decision(recommendation, None, Some(Stop::Rounds { rounds })));
        }

        let has_model = models.is_some();
        let expected = match models {
            Some(models) => Some(self.by_criterion(models)?),
            None => None,
        };
        if let Some(best) = &recommendation {
            self.confirm(best);
        } else if !has_model || self.infill.is_empty() {
            self.fill();
        }
        let before = rounds.last().and_then(|r| r.expected_improvement_um);
        let delta = self.options.delta_um;
        let stop = match (&recommendation, expected.zip(before)) {
            (Some(best), Some((expected, before)))
                if expected < delta && before < delta && best.half_width_um() < delta =>
            {
                Some(Stop::Converged {
                    expected_improvement_um: expected.max(before),
                    half_width_um: best.half_width_um(),
                })
            }
            (None, _) if self.infill.is_empty() => Some(Stop::NothingFeasible),
            _ => None,
        };
        Ok(self.decision(recommendation, expected, stop))
    }

    fn decision(
        self,
        recommendation: Option<Recommendation>,
        expected_improvement_um: Option<f64>,
        stop: Option<Stop>,
    ) -> Decision {
        Decision {
            round: self.state.rounds.len(),
            infill: if stop.is_some() {
                Vec::new()
            } else {
                self.infill
            },
            recommendation,
            expected_improvement_um,
            stop,
            notes: self.notes,
            constraint_evaluations: self.exact.evaluations,
        }
    }

    /// The rows that may be improved on: the feasible ones, or all if there are none.
    fn incumbents(&self, among: &[usize]) -> Vec<usize> {
        let feasible = |i: &&usize| self.rows.sampled[**i].violation <= 0.0;
        let some: Vec<usize> = among.iter().filter(feasible).copied().collect();
        if some.is_empty() {
            among.to_vec()
        } else {
            some
        }
    }

    /// Fits the models; none if there is nothing to learn from.
    fn models(&mut self) -> Result<Option<Models>, Error> {
        let all: Vec<usize> = (0..self.rows.sampled.len()).collect();
        let global = match Surrogate::fit(&self.rows, &all, self.options) {
            Ok(models) => models,
            Err(error) => {
                let reason = error.to_string();
                self.notes.push(Note::NoModel { reason });
                return Ok(None);
            }
        };
        for warning in global[0].warnings() {
            match warning {
                Warning::ConstantResponse => {
                    self.notes.push(Note::Plateau);
                    return Ok(None);
                }
                Warning::NoStructure { .. } => self.notes.push(Note::NoStructure),
                _ => {}
            }
        }
        let incumbents = self.incumbents(&all);
        if self.rows.sampled[incumbents[0]].violation > 0.0 {
            self.notes.push(Note::NoFeasibleDesign);
        }
        let mut ordered: Vec<(f64, usize)> = incumbents
            .iter()
            .map(|&i| (self.upper_quantile(&global[0], i), i))
            .collect();
        ordered.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut centres: Vec<usize> = Vec::new();
        for (_, i) in ordered {
            let x = |i: usize| &self.rows.sampled[i].x;
            let apart = |&c: &usize| distance(x(c), x(i), self.options) >= APART;
            if centres.len() < self.options.basins && centres.iter().all(apart) {
                centres.push(i);
            }
        }
        let mut basins: Vec<Vec<Basin>> = Vec::new();
        for centre in centres {
            basins.push(self.basin(&global, centre));
        }
        // The local models may know better which is best.
        let quantile = |b: &Vec<Basin>| self.upper_quantile(&b[0].model, b[0].best);
        basins.sort_by(|a, b| quantile(a).total_cmp(&quantile(b)));
        let basins = basins.into_iter().flatten().collect();
        Ok(Some(Models { global, basins }))
    }

    /// The basin around a row, once for each model, the best model first. A model is one of its
    /// surroundings if those of all designs are coarser there.
    fn basin(&mut self, global: &[Surrogate], centre: usize) -> Vec<Basin> {
        let x = self.rows.sampled[centre].x.clone();
        let mut near: Vec<usize> = (0..self.rows.sampled.len()).collect();
        near.sort_by(|&a, &b| {
            let to = |i: usize| distance(&x, &self.rows.sampled[i].x, self.options);
            to(a).total_cmp(&to(b)).then(a.cmp(&b))
        });
        let region = self.region(&x, &near);
        near.truncate(self.options.local_points);
        let is_local = near.len() < self.rows.sampled.len();
        let refits = if is_local {
            Surrogate::fit(&self.rows, &near, self.options).unwrap_or_default()
        } else {
            Vec::new()
        };
        let mut models = Vec::new();
        for model in global {
            let global_rmse = model.error_at(&self.rows, &near);
            let plain = |w: &Warning| matches!(w, Warning::NoStructure { .. });
            let refit = refits.iter().find(|refit| refit.is_like(model));
            let local = refit.map(|refit| (refit, refit.error_at(&self.rows, &near)));
            match local {
                Some((refit, local_rmse))
                    if local_rmse < global_rmse && !refit.warnings().iter().any(plain) =>
                {
                    self.notes.push(Note::LocalRefit {
                        design: self.rows.index[centre],
                        global_rmse,
                        local_rmse,
                    });
                    models.push((local_rmse, refit.clone()));
                }
                _ => models.push((global_rmse, model.clone())),
            }
        }
        models.sort_by(|a, b| a.0.total_cmp(&b.0));
        let basins = models.into_iter().map(|(_, model)| {
            let inside = |i: &usize| {
                let row = &self.rows.sampled[*i].x;
                let mut sides = region.iter().zip(row);
                sides.all(|((low, high), v)| (*low..=*high).contains(v))
            };
            let within: Vec<usize> = model.rows.iter().filter(|i| inside(i)).copied().collect();
            let incumbents = if within.is_empty() {
                vec![centre]
            } else {
                self.incumbents(&within)
            };
            let best = incumbents
                .iter()
                .map(|&i| (self.upper_quantile(&model, i), i))
                .min_by(|a, b| a.0.total_cmp(&b.0))
                .map_or(centre, |(_, i)| i);
            Basin {
                model,
                region: region.clone(),
                best,
                incumbents,
                is_exhausted: false,
            }
        });
        basins.collect()
    }

    fn upper_quantile(&self, model: &Surrogate, row: usize) -> f64 {
        let row = &self.rows.sampled[row];
        let belief = model.belief(&row.x, row.baseline_um);
        belief.quantile_um(self.options.quantile_z)
    }

    /// The box around the nearest designs.
    fn region(&self, centre: &[f64], nearest: &[usize]) -> Vec<(f64, f64)> {
        let spanned = &nearest[..self.options.region_points.min(nearest.len())];
        let intervals = self.options.bounds.intervals().iter().enumerate();
        intervals
            .map(|(j, &(low, high))| {
                let reach = spanned
                    .iter()
                    .map(|&i| (self.rows.sampled[i].x[j] - centre[j]).abs())
                    .fold(0.0, f64::max);
                let half = ((1.0 + WIDER) * reach).max(LEAST * (high - low));
                ((centre[j] - half).max(low), (centre[j] + half).min(high))
            })
            .collect()
    }

    fn recommendation(&self, models: &Models) -> Option<Recommendation> {
        let basin = models.basins.first()?;
        let row = &self.rows.sampled[basin.best];
        if row.violation > 0.0 {
            return None;
        }
        let belief = basin.model.belief(&row.x, row.baseline_um);
        Some(Recommendation {
            design: self.rows.index[basin.best],
            x: row.x.clone(),
            predicted_um: belief.quantile_um(0.0),
            interval_um: (belief.quantile_um(-Z95), belief.quantile_um(Z95)),
            sd_of_sample_um: basin.model.noise(1).sqrt()
                * if belief.logarithm {
                    belief.quantile_um(0.0)
                } else {
                    1.0
                },
        })
    }

    /// Chooses observations by the criterion until the batch is full or nothing is worth the effort;
    /// returns the most that is expected of any.
    fn by_criterion(&mut self, mut models: Models) -> Result<f64, Error> {
        let options = self.options;
        let whole = options.bounds.intervals().to_vec();
        let all = self.incumbents(&models.global[0].rows);
        let mut expected: f64 = 0.0;
        let mut global_is_exhausted = false;
        let mut next = 0;
        for turn in 0..options.batch {
            let mut rng = self.rng(turn);
            let is_turn = turn % options.global_every == options.global_every - 1;
            let basin = if is_turn && !global_is_exhausted {
                None
            } else {
                let count = models.basins.len();
                let open = (next..next + count)
                    .map(|i| i % count)
                    .find(|&i| !models.basins[i].is_exhausted);
                if let Some(open) = open {
                    next = open + 1;
                }
                open
            };
            if basin.is_none() && global_is_exhausted {
                break;
            }
            let (model, region, incumbents, best) = match basin {
                Some(i) => {
                    let basin = &models.basins[i];
                    (&basin.model, &basin.region, &basin.incumbents, basin.best)
                }
                None => (&models.global[0], &whole, &all, models.basins[0].best),
            };
            let objective = Objective::new(model, &self.rows, incumbents, options)?;
            let centre = self.rows.sampled[best].x.clone();
            let new = if self.left >= options.samples_new {
                let exact = &mut self.exact;
                search(&objective, region, &centre, &self.rows, exact, &mut rng)?
            } else {
                None
            };
            let feasible = |i: &&usize| self.rows.sampled[**i].violation <= 0.0;
            let promising: Vec<usize> = incumbents.iter().filter(feasible).copied().collect();
            let more = if self.left >= options.samples_more {
                self.most_promising(model, &promising)
            } else {
                None
            };
            let promised = new.as_ref().map_or(0.0, |pick| pick.value_um);
            let promised = promised.max(more.map_or(0.0, |(_, value)| value));
            expected = expected.max(promised);
            let chosen = if promised < WORTHWHILE * options.delta_um {
                None
            } else {
                self.choose(new, more, basin.is_none()).0
            };
            let Some((x, samples)) = chosen else {
                match basin {
                    Some(i) => models.basins[i].is_exhausted = true,
                    None => global_is_exhausted = true,
                }
                continue;
            };
            self.left -= samples;
            // A point too near to another for the model adds nothing to believe.
            let of_basins = models.basins.iter_mut().map(|basin| &mut basin.model);
            for model in models.global.iter_mut().chain(of_basins) {
                if let Ok(after) = model.believing(&x, samples) {
                    *model = after;
                }
            }
        }
        Ok(expected)
    }

    /// Where no improvement is expected but the recommendation is not known well enough, it gets
    /// more samples: as many as bring its interval to δ, within a batch.
    fn confirm(&mut self, best: &Recommendation) {
        let options = self.options;
        let half = best.half_width_um();
        if !self.infill.is_empty() || half < options.delta_um {
            return;
        }
        let sd = half / Z95;
        let wanted = options.delta_um / Z95;
        // Precisions add up: 1/s² now, k/v of k samples more.
        let lacking = (1.0 / (wanted * wanted) - 1.0 / (sd * sd)).max(0.0);
        let turns = (lacking * best.sd_of_sample_um.powi(2) / f64::from(options.samples_more))
            .ceil()
            .max(CONFIRMING)
            .min(options.batch as f64);
        // At most a batch, at least 1.
        let samples = (turns as u32)
            .saturating_mul(options.samples_more)
            .min(self.left);
        self.left -= samples;
        self.infill.push(Infill::More {
            design: best.design,
            samples,
            value_um: 0.0,
        });
    }

    /// The existing design where more samples improve the quantile most: (row, µm).
    fn most_promising(&self, model: &Surrogate, among: &[usize]) -> Option<(usize, f64)> {
        let z = self.options.quantile_z;
        let beliefs: Vec<_> = among
            .iter()
            .map(|&i| &self.rows.sampled[i])
            .map(|row| model.belief(&row.x, row.baseline_um))
            .collect();
        let lowest = beliefs
            .iter()
            .map(|b| b.mean + z * b.sd)
            .fold(f64::INFINITY, f64::min);
        let noise = model.noise(self.options.samples_more);
        among
            .iter()
            .zip(&beliefs)
            .map(|(&i, b)| (i, b.quantile_improvement(lowest, noise, z)))
            .max_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// Takes the observation that is worth more per sample. Returns it and its worth.
    fn choose(
        &mut self,
        new: Option<Pick>,
        more: Option<(usize, f64)>,
        is_global: bool,
    ) -> (Option<(Vec<f64>, u32)>, f64) {
        let options = self.options;
        let (of_new, of_more) = (options.samples_new, options.samples_more);
        let rate = |value: f64, samples: u32| value / f64::from(samples);
        let taken = |x: &[f64], rows: &Rows| {
            let same = |row: &crate::Sampled| is_same(&row.x, x, options);
            rows.sampled.iter().position(same)
        };
        let prefers_more = match (&new, more) {
            (Some(pick), Some((_, value))) => rate(value, of_more) > rate(pick.value_um, of_new),
            (None, more) => more.is_some_and(|(_, value)| value > 0.0),
            (Some(_), None) => false,
        };
        let repeated = new.as_ref().and_then(|p| taken(&p.x, &self.rows));
        let (row, value_um) = match (new, more, repeated) {
            (_, Some((row, value)), _) if prefers_more => (row, value),
            (Some(pick), _, Some(row)) => {
                let design = self.rows.index[row];
                self.notes.push(Note::Repeated { design });
                (row, pick.value_um)
            }
            (Some(pick), _, None) => {
                let reason = if is_global {
                    Reason::Global
                } else {
                    Reason::Local
                };
                let again = self.infill.iter().any(
                    |infill| matches!(infill, Infill::New { x, .. } if is_same(x, &pick.x, options)),
                );
                if again || pick.value_um <= 0.0 {
                    return (None, 0.0);
                }
                self.infill.push(Infill::New {
                    x: pick.x.clone(),
                    samples: of_new,
                    value_um: pick.value_um,
                    reason,
                });
                return (Some((pick.x, of_new)), pick.value_um);
            }
            _ => return (None, 0.0),
        };
        if self.left < of_more {
            return (None, 0.0);
        }
        let design = self.rows.index[row];
        let earlier = self.infill.iter_mut().find_map(|infill| match infill {
            Infill::More {
                design: d, samples, ..
            } if *d == design => Some(samples),
            _ => None,
        });
        match earlier {
            Some(samples) => *samples += of_more,
            None => self.infill.push(Infill::More {
                design,
                samples: of_more,
                value_um,
            }),
        }
        (Some((self.rows.sampled[row].x.clone(), of_more)), value_um)
    }

    /// Fills the batch where no model could choose.
    fn fill(&mut self) {
        let mut chosen: Vec<Vec<f64>> = Vec::new();
        for turn in 0..self.options.batch {
            if self.left < self.options.samples_new {
                break;
            }
            let mut rng = self.rng(self.options.batch + turn);
            let taken: Vec<&[f64]> = self
                .rows
                .sampled
                .iter()
                .map(|s| s.x.as_slice())
                .chain(self.rows.failed.iter().map(Vec::as_slice))
                .chain(chosen.iter().map(Vec::as_slice))
                .collect();
            let exact = &mut self.exact;
            let found = fill_space(&taken, &self.rows, self.options, exact, &mut rng);
            let Some(x) = found.or_else(|| self.by_violation(turn)) else {
                break;
            };
            self.left -= self.options.samples_new;
            self.infill.push(Infill::New {
                x: x.clone(),
                samples: self.options.samples_new,
                value_um: 0.0,
                reason: Reason::SpaceFilling,
            });
            chosen.push(x);
        }
    }

    /// A feasible design found by minimising the violation, where random ones hit none.
    fn by_violation(&mut self, turn: usize) -> Option<Vec<f64>> {
        let mut rng = self.rng(2 * self.options.batch + turn);
        let intervals = self.options.bounds.intervals();
        let start: Vec<f64> = intervals
            .iter()
            .map(|(low, high)| low + (high - low) * rng.random::<f64>())
            .collect();
        let run = cmaes::RunOptions {
            search: cmaes::Options::new(self.options.bounds.clone()),
            evaluations: self.options.search_evaluations,
            restarts: cmaes::Restarts::FromBest { planned: 0 },
        };
        let constraints = self.exact.constraints;
        let exact_evaluations = &mut self.exact.evaluations;
        let mut violation = |x: &[f64]| {
            *exact_evaluations += 1;
            cmaes::Evaluation {
                value: 0.0,
                violation: constraints(x).map_or(f64::NAN, |known| known.violation),
            }
        };
        let found = cmaes::minimise_run(&start, run, &mut rng, &mut violation).ok()?;
        let infill = self.infill.iter();
        let again = infill
            .clone()
            .any(|i| matches!(i, Infill::New { x, .. } if is_same(x, &found.x, self.options)));
        (found.violation <= 0.0 && !again).then_some(found.x)
    }

    fn rng(&self, turn: usize) -> stats::streams::StreamRng {
        let round = self.state.rounds.len() as u64;
        let sample = (round << 16) | turn as u64;
        stream(self.options.seed, Purpose::Optimise, STREAM, sample)
    }
}
