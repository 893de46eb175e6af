//! The current stage, and how long each stage takes.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use stages::stage::Stage;
use store::{StageTimeRow, Store};

/// Interval at which the time of the current stage is stored. A coordinator that is killed loses at most this time.
const STORED_EVERY: Duration = Duration::from_secs(60);

/// Measures the stages of a campaign, on top of what earlier coordinators measured.
pub(crate) struct Stopwatch {
    store: Store,
    /// Seconds by stage, as stored.
    stored: BTreeMap<String, f64>,
    /// The current stage, as stored.
    current: Option<Stage>,
    /// The stage that is measured, and when its time was stored last.
    running: Option<(Stage, Instant)>,
    /// [`STORED_EVERY`].
    every: Duration,
}

impl Stopwatch {
    /// Creates a stopped stopwatch.
    pub(crate) async fn new(store: &Store) -> Result<Self, store::Error> {
        let rows = store.stage_times().await?.into_iter();
        let current = store.stage().await?;
        Ok(Self {
            store: store.clone(),
            stored: rows.map(|row| (row.stage, row.wall_seconds)).collect(),
            current: current.and_then(|name| Stage::named(&name)),
            running: None,
            every: STORED_EVERY,
        })
    }

    /// Stores the stage that the campaign waits for from now on.
    pub(crate) async fn enter(&mut self, stage: Stage) -> Result<(), store::Error> {
        if self.current != Some(stage) {
            self.store.put_stage(&stage.to_string()).await?;
            self.current = Some(stage);
        }
        self.measure(Some(stage).filter(|stage| *stage != Stage::Done))
            .await
    }

    /// Stores the time of the current stage, and measures none from now on.
    pub(crate) async fn stop(&mut self) -> Result<(), store::Error> {
        self.measure(None).await
    }

    /// Stores the time of the current stage again and again, and returns only with an error.
    pub(crate) async fn keep(&mut self) -> store::Error {
        loop {
            tokio::time::sleep(self.every).await;
            if let Err(error) = self.measure(self.running.map(|(stage, _)| stage)).await {
                return error;
            }
        }
    }

    async fn measure(&mut self, stage: Option<Stage>) -> Result<(), store::Error> {
        let now = Instant::now();
        if let Some((last, since)) = self.running {
            let elapsed = now - since;
            if stage == Some(last) && elapsed < self.every {
                return Ok(());
            }
            // Before the store is awaited: a caller may stop waiting, and no time counts twice.
            self.running = stage.map(|stage| (stage, now));
            let seconds = self.stored.entry(last.to_string()).or_default();
            *seconds += elapsed.as_secs_f64();
            let row = StageTimeRow {
                stage: last.to_string(),
                wall_seconds: *seconds,
            };
            return self.store.put_stage_time(&row).await;
        }
        self.running = stage.map(|stage| (stage, now));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use problem::Campaign;
    use store::CampaignRow;

    use super::*;

    async fn store(folder: &std::path::Path) -> Store {
        let campaign = CampaignRow {
            name: "paper".to_owned(),
            file_text: Campaign::PAPER.to_owned(),
            digest: "0".to_owned(),
            seed: 1,
            program_version: "0".to_owned(),
            model_digest: None,
        };
        Store::create_or_open(&folder.join("s.db"), &campaign)
            .await
            .unwrap()
    }

    /// A coordinator that is killed while a stage takes hours has stored all but the last interval.
    #[tokio::test]
    async fn the_time_of_a_long_stage_is_stored_while_it_runs() {
        let folder = tempfile::tempdir().unwrap();
        let store = store(folder.path()).await;
        let mut watch = Stopwatch::new(&store).await.unwrap();
        watch.every = Duration::from_millis(20);
        watch.enter(Stage::Sample).await.unwrap();
        let stored = async {
            loop {
                let times = store.stage_times().await.unwrap();
                if times.iter().any(|row| row.wall_seconds >= 0.1) {
                    return times;
                }
                tokio::time::sleep(Duration::from_millis(10)).await;
            }
        };
        let times = tokio::select! {
            times = stored => times,
            error = watch.keep() => panic!("{error}"),
        };
        assert_eq!(times.len(), 1, "{times:?}");
        store.close().await.unwrap();
    }

    #[tokio::test]
    async fn stages_add_up_over_coordinators() {
        let folder = tempfile::tempdir().unwrap();
        let store = store(folder.path()).await;
        let held = StageTimeRow {
            stage: "sample".to_owned(),
            wall_seconds: 5.0,
        };
        store.put_stage_time(&held).await.unwrap();
        let mut watch = Stopwatch::new(&store).await.unwrap();
        for stage in [
            Stage::Doe,
            Stage::Sample,
            Stage::Sample,
            Stage::Done,
            Stage::Done,
        ] {
            watch.enter(stage).await.unwrap();
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
        assert_eq!(store.stage().await.unwrap().as_deref(), Some("done"));
        let times = store.stage_times().await.unwrap();
        let [doe, sample] = &times[..] else {
            panic!("{times:?}");
        };
        assert_eq!((&*doe.stage, &*sample.stage), ("doe", "sample"));
        // Twenty milliseconds each at least; sleeping may take longer on a machine that is busy.
        assert!(doe.wall_seconds >= 0.02, "{times:?}");
        assert!(sample.wall_seconds >= 5.04, "{times:?}");
        store.close().await.unwrap();
    }
}
