//! The registration of a worker, through which it gets the campaign.

use std::sync::Arc;
use std::time::Instant;

use crate::gateway::link::cause;
use crate::protocol::v1::RegisterRequest;
use problem::Campaign;
use problem::formulation::Problem;
use tracing::{debug, info, warn};

use super::contact::SILENCE;
use super::{CALL_TIMEOUT, SharedState, ids};
use crate::worker::backoff::Backoff;
use crate::worker::error::Error;
use crate::worker::exec::Backend;

/// The result of a registration.
#[derive(Debug)]
pub(super) struct Registration {
    pub(super) epoch: u64,
    pub(super) problem: Problem,
    /// The simulator of the campaign.
    pub(super) backend: Arc<Backend>,
    campaign_json: String,
    pub(super) model_digest: String,
}

impl SharedState {
    /// Registers. Repeats the call until it succeeds, the `first` time for a limited time.
    pub(super) async fn register(&self, first: bool) -> Result<Arc<Registration>, Error> {
        let options = &self.options;
        let patience = options.connect_timeout;
        let mut since = Instant::now();
        let mut has_complained = false;
        let mut backoff = Backoff::new();
        let address = self.connection.address();
        loop {
            // The digest depends on the campaign, which only the coordinator knows: the first call
            // asks for the campaign, the second one brings the digest.
            let known = self.registered();
            let request = RegisterRequest {
                worker_id: self.worker_id.clone(),
                host: options.host.clone(),
                program_version: crate::identity::BUILD.to_owned(),
                model_digest: known
                    .as_ref()
                    .map_or_else(String::new, |k| k.model_digest.clone()),
                slots: u32::try_from(options.slots).unwrap_or(u32::MAX),
                held: if known.is_some() {
                    self.held.leases()
                } else {
                    Vec::new()
                },
                died: known.as_ref().map_or_else(Vec::new, |known| {
                    self.journal.crashed(&known.problem.campaign().digest())
                }),
            };
            let mut client = self.connection.client();
            let call = tokio::time::timeout(CALL_TIMEOUT, client.register(request));
            let reason = match call.await {
                Ok(answer) => match answer {
                    Ok(response) => {
                        let response = response.into_inner();
                        let confirmed = known
                            .as_ref()
                            .filter(|known| known.campaign_json == response.campaign_json);
                        let (problem, backend, model_digest) = match confirmed {
                            Some(known) => (
                                known.problem.clone(),
                                Arc::clone(&known.backend),
                                known.model_digest.clone(),
                            ),
                            None => self.learn(&response.campaign_json).await?,
                        };
                        let registered = Arc::new(Registration {
                            epoch: response.epoch,
                            model_digest,
                            problem,
                            backend,
                            campaign_json: response.campaign_json.clone(),
                        });
                        let done = confirmed.is_some();
                        self.contact.answered();
                        // The questions to a program may have taken longer than the time limit.
                        since = Instant::now();
                        if done {
                            self.journal.forget_crashed();
                            self.held.cancel(&ids(&response.cancelled));
                        } else {
                            // Any leases belong to another campaign, whose coordinator may want their results.
                            if known.is_some() {
                                self.held.release_all();
                                self.keep_undelivered();
                                self.files.leave();
                            }
                            self.held.cancel_all();
                            // If it is the same campaign, and has grown, they are results of this one, too.
                            if known.is_some() {
                                self.files.take_up(&registered, &self.held);
                            }
                        }
                        *self.problem.write().unwrap_or_else(|e| e.into_inner()) =
                            Some(Arc::clone(&registered));
                        if done {
                            self.set_heartbeat(response.heartbeat_ms);
                            return Ok(registered);
                        }
                        continue;
                    }
                    Err(status) => match self.connection.refusal(&status) {
                        Some(refusal) => return Err(refusal.into()),
                        None => cause(&status),
                    },
                },
                Err(_) => "no answer in time".to_owned(),
            };
            debug!(%reason, "registering failed");
            self.contact.missed();
            if first && since.elapsed() > SILENCE && !has_complained {
                has_complained = true;
                let leaving_in = patience.saturating_sub(since.elapsed()).as_secs();
                warn!(%address, leaving_in, "the coordinator does not answer");
            }
            if first && since.elapsed() > patience {
                return Err(crate::gateway::Error::Unreachable { address, reason }.into());
            }
            backoff.pause().await;
        }
    }

    /// Returns the problem of a new campaign, its simulator and the digest of its model.
    async fn learn(&self, campaign_json: &str) -> Result<(Problem, Arc<Backend>, String), Error> {
        let campaign = Campaign::from_json(campaign_json).map_err(|error| {
            crate::gateway::Error::InvalidAnswer {
                address: self.connection.address(),
                reason: error.to_string(),
            }
        })?;
        let problem = Problem::new(campaign);
        let backend = Arc::new(Backend::choose(
            &problem,
            self.options.exec.as_ref(),
            self.ability.clone(),
        )?);
        // An external program may take long to answer and must not block the runtime.
        let questions = {
            let (problem, backend) = (problem.clone(), Arc::clone(&backend));
            let slots = self.options.slots;
            tokio::task::spawn_blocking(move || backend.model_digest(&problem, slots))
        };
        // If the worker is asked to leave meanwhile, this wait is dropped. The guard then ends the
        // program.
        let guard = BackendGuard(Some(Arc::clone(&backend)));
        let model_digest = questions.await.map_err(|error| Error::Program {
            reason: error.to_string(),
        })??;
        guard.keep();
        Ok((problem, backend, model_digest))
    }

    pub(super) fn registered(&self) -> Option<Arc<Registration>> {
        self.problem
            .read()
            .unwrap_or_else(|e| e.into_inner())
            .clone()
    }

    /// Registers again after a coordinator did not know this worker, unless another task has done
    /// so.
    pub(super) async fn register_again(&self, epoch: u64) -> Result<(), Error> {
        let _one_at_a_time = self.registering.lock().await;
        if self
            .registered()
            .is_some_and(|registered| registered.epoch == epoch)
        {
            info!(coordinator = %self.connection.address(), "registering again");
            self.register(false).await?;
        }
        Ok(())
    }

    pub(super) fn epoch(&self) -> u64 {
        self.registered().map_or(0, |registered| registered.epoch)
    }
}

/// Ends an external program unless it is kept.
struct BackendGuard(Option<Arc<Backend>>);

impl BackendGuard {
    fn keep(mut self) {
        self.0 = None;
    }
}

impl Drop for BackendGuard {
    fn drop(&mut self) {
        if let Some(backend) = &self.0 {
            backend.stop();
        }
    }
}
