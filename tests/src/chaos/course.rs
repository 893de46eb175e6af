//! The turn that some campaigns take in the middle: the campaign is extended, or quarantined jobs
//! are retried. Optima are then chosen again while samples of the old ones are in flight.

use std::path::PathBuf;
use std::time::Duration;

use rand::RngExt as _;
use serde_json::Value;

use super::Violation;
use super::cluster::Cluster;
use super::kinds::{Kind, Reference};
use super::plan::{Act, Purpose, RELIEF, WORKERS, Who, random};
use super::proxy::Fault;

/// Time after which a campaign is ended that stays finished with other results than the undisturbed
/// run.
const SETTLED: Duration = Duration::from_secs(8);

/// How the workers are disconnected while another worker's results change the optima.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Cut {
    /// They stay connected.
    Not,
    /// SIGSTOP.
    Stopped,
    /// A fault of their networks. Their messages arrive when it is over.
    Network(Fault),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    /// The turn is still to come.
    Before,
    /// The workers are disconnected, and the turn is taken at this time.
    Cut(Duration),
    /// The turn was taken. The workers return at this time, or sooner if a new optimum is chosen.
    Away(Duration),
    /// The workers have returned.
    After,
}

/// The course of a campaign as a whole.
#[derive(Debug)]
pub(crate) struct Course {
    kind: Kind,
    phase: Phase,
    /// Whether the turn is taken by `coordinator retry`, without ending the coordinator.
    is_live: bool,
    /// Whether the coordinator gets SIGTERM before it is started with the extended campaign.
    is_gentle: bool,
    cut: Cut,
    /// Time from the disconnection to the turn.
    lead: Duration,
    /// Time from the turn to the workers' return.
    away: Duration,
    /// Time from the choice of a new optimum to the workers' return, in the middle of its
    /// verification.
    lag: Option<Duration>,
    /// The criterion of the optimum that was being verified.
    chosen: Option<Value>,
    /// Time since which the campaign has been reported finished.
    finished_since: Option<Duration>,
}

impl Course {
    pub(crate) fn new(kind: Kind, seed: u64, round: u64) -> Self {
        let mut rng = random(seed, round, Purpose::Course);
        // The other kinds of campaign take no turn.
        let takes_turn = matches!(kind, Kind::Grown | Kind::Licence);
        Self {
            kind,
            phase: if takes_turn {
                Phase::Before
            } else {
                Phase::After
            },
            is_live: kind == Kind::Licence && rng.random_bool(0.75),
            is_gentle: rng.random_bool(0.5),
            cut: match rng.random_range(0..10) {
                0 => Cut::Not,
                1..4 => Cut::Stopped,
                4..8 => Cut::Network(Fault::Mute),
                _ => Cut::Network(Fault::Partition),
            },
            lead: Duration::from_millis(rng.random_range(0..1000)),
            away: Duration::from_millis(rng.random_range(2000..6000)),
            lag: Some(Duration::from_millis(rng.random_range(20..400))),
            chosen: None,
            finished_since: None,
        }
    }

    /// Whether coordinators keep serving when the campaign is finished.
    pub(crate) const fn stays(&self) -> bool {
        self.is_live
    }

    /// Whether the course waits for a certain moment of the campaign.
    pub(crate) fn is_waiting(&self) -> bool {
        self.phase != Phase::After
    }

    /// Whether optima may be chosen again.
    pub(crate) const fn takes_turn(&self) -> bool {
        matches!(self.kind, Kind::Grown) || self.kind.has_outages()
    }

    /// Advances the course according to the status.
    pub(crate) fn look(
        &mut self,
        now: Duration,
        status: &Value,
        cluster: &mut Cluster,
        reference: &Reference,
    ) -> Result<(), Violation> {
        match self.phase {
            Phase::Before if self.is_time(status) => {
                self.cut_off(cluster)?;
                self.chosen = kriging(status).map(|optimum| optimum["criterion"].clone());
                self.phase = Phase::Cut(now + self.lead);
            }
            Phase::Cut(until) if now >= until => self.turn(now, cluster, reference)?,
            Phase::Away(until) if now < until => {
                if self.is_chosen_anew(status)
                    && let Some(lag) = self.lag.take()
                {
                    self.phase = Phase::Away(until.min(now + lag));
                }
            }
            Phase::Away(_) => {
                cluster.is_cut_off = false;
                for worker in 0..WORKERS {
                    cluster.act(Act::Continue(Who::Worker(worker)))?;
                }
                network(cluster, Fault::None)?;
                self.phase = Phase::After;
            }
            Phase::After if self.is_live => self.end(now, status, cluster, reference)?,
            _ => {}
        }
        Ok(())
    }

    /// Whether samples of an optimum that is about to be replaced are in flight.
    fn is_time(&self, status: &Value) -> bool {
        let number = |value: &Value| value.as_u64().unwrap_or(0);
        let is_verified = kriging(status).is_some_and(|optimum| {
            let verified = &optimum["verified"];
            number(&verified["done"]) < number(&verified["wanted"])
        });
        if self.kind == Kind::Grown {
            return is_verified;
        }
        let groups = status["failure_groups"].as_array();
        let is_quarantined =
            groups.is_some_and(|groups| groups.iter().any(|group| group["kind"] == "quarantine"));
        self.is_live && is_quarantined && (is_verified || status["finished"] == true)
    }

    /// Whether the optimum has changed since the workers were disconnected.
    fn is_chosen_anew(&self, status: &Value) -> bool {
        kriging(status).is_some_and(|optimum| Some(&optimum["criterion"]) != self.chosen.as_ref())
    }

    fn cut_off(&self, cluster: &mut Cluster) -> Result<(), Violation> {
        match self.cut {
            Cut::Not => return Ok(()),
            Cut::Stopped => {
                for worker in 0..WORKERS {
                    cluster.act(Act::Stop(Who::Worker(worker)))?;
                }
            }
            Cut::Network(fault) => network(cluster, fault)?,
        }
        cluster.is_cut_off = true;
        cluster.act(Act::Start(Who::Worker(RELIEF)))
    }

    fn turn(
        &mut self,
        now: Duration,
        cluster: &mut Cluster,
        reference: &Reference,
    ) -> Result<(), Violation> {
        if self.kind == Kind::Grown {
            let coordinator = Who::Coordinator;
            cluster.act(if self.is_gentle {
                Act::Terminate(coordinator)
            } else {
                Act::Kill(coordinator)
            })?;
            // The campaign is extended, however far it was.
            cluster.ended = None;
            cluster.setup.file = grown(reference);
            cluster.act(Act::Start(coordinator))?;
        } else {
            pay(cluster)?;
            cluster.act(Act::Continue(Who::Coordinator))?;
            if !cluster.retry()? {
                // The retry is repeated at the next look.
                return Ok(());
            }
        }
        self.phase = Phase::Away(now + self.away);
        Ok(())
    }

    /// Ends a coordinator that would serve for ever.
    fn end(
        &mut self,
        now: Duration,
        status: &Value,
        cluster: &mut Cluster,
        reference: &Reference,
    ) -> Result<(), Violation> {
        if status["finished"] != true {
            self.finished_since = None;
            return Ok(());
        }
        let since = *self.finished_since.get_or_insert(now);
        let is_same = |key| status[key] == reference.outcome.status[key];
        let is_equal = ["samples", "samples_digest", "optima"]
            .into_iter()
            .all(is_same);
        if is_equal || now > since + SETTLED {
            cluster.act(Act::Terminate(Who::Coordinator))?;
        }
        Ok(())
    }

    /// Whether the campaign is over after a coordinator has ended by itself.
    pub(crate) fn is_over(
        &mut self,
        code: i32,
        cluster: &mut Cluster,
        reference: &Reference,
    ) -> Result<bool, Violation> {
        match (self.kind, self.phase, code) {
            // The campaign was finished before the moment came.
            (Kind::Grown, Phase::Before | Phase::Cut(_), 0) => {
                cluster.setup.file = grown(reference);
                self.phase = Phase::Away(Duration::ZERO);
                Ok(false)
            }
            (Kind::Licence, Phase::Before | Phase::Cut(_), 13) => {
                pay(cluster)?;
                self.phase = Phase::Away(Duration::ZERO);
                Ok(false)
            }
            // A failure in an outage is a result there, until it is computed again.
            (Kind::Problem | Kind::Files, _, 0) if cluster.has_failed => {
                cluster.outage(None)?;
                cluster.retries_failed = true;
                Ok(false)
            }
            (_, _, 0) => Ok(true),
            // The same command repairs the effects of an outage.
            (kind, _, 13) if kind.has_outages() => {
                cluster.outage(None)?;
                Ok(false)
            }
            _ => Err(Violation(format!(
                "a coordinator ended with code {code}: something was quarantined"
            ))),
        }
    }
}

/// The optimum found with kriging.
fn kriging(status: &Value) -> Option<&Value> {
    let optima = status["optima"].as_array()?;
    optima
        .iter()
        .find(|optimum| optimum["approach"] == "kriging")
}

fn network(cluster: &mut Cluster, fault: Fault) -> Result<(), Violation> {
    for worker in 0..WORKERS {
        let cut = false;
        cluster.act(Act::Network { worker, fault, cut })?;
    }
    Ok(())
}

fn grown(reference: &Reference) -> PathBuf {
    reference.files.last().cloned().unwrap_or_default()
}

/// Unlocks the design without a licence: none of its samples fails from now on.
fn pay(cluster: &Cluster) -> Result<(), Violation> {
    let licence = cluster.setup.folder.join("licence");
    std::fs::write(licence, "paid").map_err(|error| Violation(error.to_string()))
}
