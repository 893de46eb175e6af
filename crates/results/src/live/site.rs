//! Reading the store for the views, with a cache.
//!
//! The status has a lock of its own, and all other views share one, so a site holds at most two of
//! the store's reading connections, however many pages are open. A view is cached for half a
//! second at least, and for twenty times as long as it took to make, so that each view takes at most a twentieth of a
//! processor.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use crate::optima::Optima;
use crate::report::{self, OptimiserRun};
use crate::running::CoordinatorState;
use crate::status::{self, Status};
use crate::table::{SCHEMA_VERSION, VersionedObject};
use axum::body::Bytes;
use problem::formulation::Problem;
use problem::{Approach, Campaign};
use serde::Serialize;
use stages::names;
use store::Store;
use tokio::sync::watch;
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;

use crate::live::designs::Designs;
use crate::live::views::{self, Responses};

/// Interval at which changes of the status are sent.
const SENT: Duration = Duration::from_secs(1);
/// Minimum time that a view is cached: less than [`SENT`], so that every status sent is new.
const KEPT: Duration = Duration::from_millis(500);
/// A view is cached for at least this many times the duration of making it.
const IDLE_SHARE: u32 = 20;

/// A function that queries a running coordinator.
pub type Ask = Box<dyn Fn() -> CoordinatorState + Send + Sync>;

/// A view of the campaign.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum View {
    /// The object that `coordinator status --json` prints.
    Status,
    /// The workers with their rates.
    Workers,
    /// The failures, by cause.
    Failures,
    /// The best design so far.
    Best,
    /// The measure of each design.
    Responses,
    /// The optimiser's runs.
    Convergence,
    /// The rounds of an enrichment.
    Rounds,
}

impl View {
    pub const ALL: [Self; 7] = [
        Self::Status,
        Self::Workers,
        Self::Failures,
        Self::Best,
        Self::Responses,
        Self::Convergence,
        Self::Rounds,
    ];
}

/// The name in the view's address, as in `/api/v1/status`.
impl fmt::Display for View {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

/// A view as JSON, or an error in its place.
#[derive(Debug, Clone)]
pub struct Body {
    pub json: Bytes,
    /// Whether it is the view and not an error.
    pub is_ok: bool,
    /// A tag that is equal for equal JSON.
    pub tag: String,
}

/// A cached value with the time at which it expires.
#[derive(Debug)]
struct Cache<T>(Mutex<Option<(Arc<T>, Instant)>>);

impl<T> Default for Cache<T> {
    fn default() -> Self {
        Self(Mutex::new(None))
    }
}

impl<T> Cache<T> {
    /// The cached value, and whether it is still valid.
    fn get(&self) -> Option<(Arc<T>, bool)> {
        // A poisoned lock is harmless, because the pair is replaced as a whole.
        let held = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let held = held.as_ref()?;
        Some((Arc::clone(&held.0), Instant::now() < held.1))
    }

    fn forget(&self) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }

    fn keep(&self, made: T, began: Instant) -> Arc<T> {
        let (made, now) = (Arc::new(made), Instant::now());
        let until = now + (IDLE_SHARE * (now - began)).max(KEPT);
        let mut held = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        *held = Some((Arc::clone(&made), until));
        made
    }
}

/// The data of a campaign's page.
pub struct Site {
    store: Store,
    running: Option<Ask>,
    status: Cache<Result<Status, String>>,
    reading_status: tokio::sync::Mutex<()>,
    bodies: [Cache<Body>; View::ALL.len()],
    responses: Cache<Responses>,
    work: tokio::sync::Mutex<Work>,
    /// The last status sent to the listening pages.
    sent: watch::Sender<Broadcast>,
    /// Number of requests for views that are being answered.
    visits: watch::Sender<usize>,
}

/// A request for a view, while it is being answered.
pub(crate) struct Visit<'a>(&'a watch::Sender<usize>);

impl Drop for Visit<'_> {
    fn drop(&mut self) {
        self.0.send_modify(|visits| *visits -= 1);
    }
}

/// An event for the listening pages.
#[derive(Debug, Clone, Default)]
pub(crate) struct Broadcast {
    /// The status; `None` before the first one.
    pub(crate) status: Option<Arc<Body>>,
    /// Whether the server ends and this is the last event.
    pub(crate) is_last: bool,
}

/// State kept between two readings.
#[derive(Debug, Default)]
struct Work {
    /// The digest of the campaign, with its problem.
    problem: Option<(String, Arc<Problem>)>,
    designs: Designs,
}

impl Site {
    /// Makes the site of a store. `running` queries the coordinator that fills the store, if there
    /// is one.
    #[must_use]
    pub fn new(store: Store, running: Option<Ask>) -> Arc<Self> {
        Arc::new(Self {
            store,
            running,
            status: Cache::default(),
            reading_status: tokio::sync::Mutex::default(),
            bodies: std::array::from_fn(|_| Cache::default()),
            responses: Cache::default(),
            work: tokio::sync::Mutex::default(),
            sent: watch::Sender::default(),
            visits: watch::Sender::default(),
        })
    }

    /// The status, taken from the cache if it is recent.
    ///
    /// # Errors
    ///
    /// The store cannot be read; the error is a message.
    pub async fn status(&self) -> Arc<Result<Status, String>> {
        if let Some((status, true)) = self.status.get() {
            return status;
        }
        let _reading = self.reading_status.lock().await;
        if let Some((status, true)) = self.status.get() {
            return status;
        }
        let began = Instant::now();
        let read = status::read(&self.store).await;
        let read = read.map(|status| match &self.running {
            Some(ask) => status.with(ask()),
            None => status,
        });
        self.status
            .keep(read.map_err(|error| format!("{error:#}")), began)
    }

    /// A view as JSON, taken from the cache if it is recent, or while another caller renews it.
    pub async fn body(&self, view: View) -> Arc<Body> {
        if let Some(make) = of_status(view) {
            return Arc::new(match &*self.status().await {
                Ok(status) => make(status),
                Err(error) => Body::error(error),
            });
        }
        let kept = &self.bodies[view as usize];
        let stale = match kept.get() {
            Some((body, true)) => return body,
            stale => stale.map(|(body, _)| body),
        };
        let work = self.work.try_lock();
        let mut work = match (work, stale) {
            (Ok(work), _) => work,
            (Err(_), Some(stale)) => return stale,
            (Err(_), None) => self.work.lock().await,
        };
        if let Some((body, true)) = kept.get() {
            return body;
        }
        let began = Instant::now();
        let made = self.make(view, &mut work).await;
        let body = made.unwrap_or_else(|error| Body::error(&format!("{error:#}")));
        kept.keep(body, began)
    }

    /// The map over two coordinates; `None` if a coordinate does not exist.
    pub async fn map(&self, x: usize, y: usize) -> Option<Body> {
        let body = self.body(View::Responses).await;
        if !body.is_ok {
            return Some(Body::clone(&body));
        }
        let (responses, _) = self.responses.get()?;
        views::map(&responses, x, y).map(Body::of_view)
    }

    /// A receiver of the changes of the status.
    pub(crate) fn listen(&self) -> watch::Receiver<Broadcast> {
        self.sent.subscribe()
    }

    /// Counts a request until the answer is dropped.
    pub(crate) fn visit(&self) -> Visit<'_> {
        self.visits.send_modify(|visits| *visits += 1);
        Visit(&self.visits)
    }

    /// Waits until no request has come or is being answered for `time`.
    pub(crate) async fn quiet(&self, time: Duration) {
        let mut visits = self.visits.subscribe();
        loop {
            let change = tokio::time::timeout(time, visits.changed()).await;
            if change.is_err() && *visits.borrow() == 0 {
                return;
            }
        }
    }

    /// Sends the status to the listening pages whenever it has changed, at most once a second, and
    /// a last time at `stop`. Returns whether any page listens then.
    pub(crate) async fn send_changes(&self, stop: &CancellationToken) -> bool {
        let mut period = tokio::time::interval(SENT);
        period.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
        let mut was_finished = false;
        while stop.run_until_cancelled(period.tick()).await.is_some() {
            if self.sent.receiver_count() == 0 {
                continue;
            }
            let is_finished = matches!(&*self.status().await, Ok(status) if status.finished);
            if is_finished && !was_finished {
                self.forget_views().await;
            }
            was_finished = is_finished;
            let body = self.body(View::Status).await;
            self.sent.send_if_modified(|sent| {
                let is_news = sent.status.as_ref().is_none_or(|old| old.tag != body.tag);
                if is_news {
                    sent.status = Some(Arc::clone(&body));
                }
                is_news
            });
        }
        self.forget_views().await;
        self.sent.send_replace(Broadcast {
            status: Some(self.body(View::Status).await),
            is_last: true,
        });
        self.sent.receiver_count() > 0
    }

    /// Clears the cached views, so that views requested after the last status are up to date. The locks wait for a view
    /// that is being made, which would otherwise be cached afterwards.
    async fn forget_views(&self) {
        {
            let _reading = self.reading_status.lock().await;
            self.status.forget();
        }
        let _work = self.work.lock().await;
        self.bodies.iter().for_each(Cache::forget);
    }

    async fn make(&self, view: View, work: &mut Work) -> anyhow::Result<Body> {
        let problem = self.problem(work).await?;
        match view {
            View::Best => self.best(&problem, work).await,
            View::Responses => self.all_responses(&problem, work).await,
            View::Convergence => self.convergence(problem).await,
            _ => self.rounds(&problem).await,
        }
    }

    /// The problem of the campaign in the store, which may have been extended.
    async fn problem(&self, work: &mut Work) -> anyhow::Result<Arc<Problem>> {
        let row = self.store.campaign().await?;
        if let Some((digest, problem)) = &work.problem
            && *digest == row.digest
        {
            return Ok(Arc::clone(problem));
        }
        let campaign = Campaign::stored(&row.file_text)?;
        let problem = Arc::new(Problem::new(campaign));
        *work = Work {
            problem: Some((row.digest, Arc::clone(&problem))),
            ..Work::default()
        };
        Ok(problem)
    }

    async fn best(&self, problem: &Arc<Problem>, work: &mut Work) -> anyhow::Result<Body> {
        work.designs.refresh(&self.store, problem).await?;
        let finished = matches!(&*self.status().await, Ok(status) if status.finished);
        let optima = Optima::read(&self.store, problem).await?;
        let of_doe = work.designs.best(problem, &optima);
        let estimates = work.designs.responses().len();
        let problem = Arc::clone(problem);
        in_background(move || {
            let recommended = optima.recommended();
            views::best(&problem, finished, recommended, of_doe.as_ref(), estimates)
        })
        .await
    }

    async fn all_responses(&self, problem: &Problem, work: &mut Work) -> anyhow::Result<Body> {
        let began = Instant::now();
        work.designs.refresh(&self.store, problem).await?;
        let optima = Optima::read(&self.store, problem).await?;
        let best = work.designs.best(problem, &optima);
        let best = best.map(|best| best.number);
        let points = work.designs.points().into_iter();
        let is_preliminary = work.designs.is_preliminary();
        let responses = views::responses(problem, points, best, is_preliminary);
        let responses = self.responses.keep(responses, began);
        in_background(move || responses).await
    }

    async fn convergence(&self, problem: Arc<Problem>) -> anyhow::Result<Body> {
        // Queried before the rows are read: a search that ends in between is shown as unfinished.
        let searches = self.running.as_ref().map(|ask| ask().searches);
        let rows = self.store.optimiser_runs().await?;
        let mut runs = BTreeMap::new();
        for search in searches.into_iter().flatten() {
            let Some((approach, start)) = names::approach_and_start(search.stream) else {
                continue;
            };
            let run = OptimiserRun {
                start,
                finished: false,
                history: search.history,
                restarts: Vec::new(),
            };
            runs.insert((approach, run.start), run);
        }
        for row in rows {
            let run = OptimiserRun::read(&problem, &row)?;
            if let Some((approach, _)) = names::approach_and_start(row.stream) {
                runs.insert((approach, run.start), run);
            }
        }
        in_background(move || views::convergence(&problem, runs)).await
    }

    async fn rounds(&self, problem: &Problem) -> anyhow::Result<Body> {
        let rows = self.store.rounds().await?;
        let infill = self.store.infill().await?;
        let point = names::verification(Approach::EnrichedKriging);
        let samples = self.store.first_samples_of(point, problem.sampled().len());
        let verified = problem.objective().values(&samples.await?);
        let enrichment = report::rounds(problem, &rows, &infill, &verified)?;
        let measure = problem.measured().name.to_string();
        in_background(move || views::rounds(enrichment.as_ref(), &measure)).await
    }
}

/// Makes and serialises a view on a blocking thread, so that it does not delay workers' calls.
async fn in_background<V: Serialize>(
    make: impl FnOnce() -> V + Send + 'static,
) -> anyhow::Result<Body> {
    let made = tokio::task::spawn_blocking(move || Body::of_view(make())).await;
    Ok(made?)
}

/// The function that makes a view from the status, for views that need only the status.
fn of_status(view: View) -> Option<fn(&Status) -> Body> {
    match view {
        View::Status => Some(Body::of),
        View::Workers => Some(|status| Body::of_view(views::workers(status))),
        View::Failures => Some(|status| Body::of_view(views::failures(status))),
        View::Best | View::Responses | View::Convergence | View::Rounds => None,
    }
}

impl Body {
    /// A view other than the status, with the schema version added. The status has a version of its own.
    fn of_view(view: impl Serialize) -> Self {
        Self::of(&VersionedObject::new(view))
    }

    pub(crate) fn of(view: &impl Serialize) -> Self {
        match serde_json::to_string(view) {
            Ok(json) => Self::new(json, true),
            Err(error) => Self::error(&error.to_string()),
        }
    }

    fn error(error: &str) -> Self {
        let json = serde_json::json!({ "schema_version": SCHEMA_VERSION, "error": error });
        Self::new(json.to_string(), false)
    }

    fn new(json: String, is_ok: bool) -> Self {
        use std::hash::{DefaultHasher, Hasher as _};
        let mut hasher = DefaultHasher::new();
        hasher.write(json.as_bytes());
        Self {
            tag: format!("\"{:016x}\"", hasher.finish()),
            json: json.into(),
            is_ok,
        }
    }
}
