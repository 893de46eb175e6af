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

    async fn measure(&mut self, stage: Option<Stage>) -> Result<(), store::Error> {
        let now = Instant::now();
        if let Some((last, since)) = self.running {
            let elapsed = now - since;
            if stage == Some(last) && elapsed < STORED_EVERY {
                return Ok(());
            }
            let seconds = self.stored.entry(last.to_string()).or_default();
            *seconds += elapsed.as_secs_f64();
            let row = StageTimeRow {
                stage: last.to_string(),
                wall_seconds: *seconds,
            };
            self.store.put_stage_time(&row).await?;
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

    #[tokio::test]
    async fn stages_add_up_over_coordinators() {
        let folder = tempfile::tempdir().unwrap();
        let campaign = CampaignRow {
            name: "paper".to_owned(),
            file_text: Campaign::PAPER.to_owned(),
            digest: "0".to_owned(),
            seed: 1,
            program_version: "0".to_owned(),
            model_digest: None,
        };
        let path = folder.path().join("s.db");
        let store = Store::create_or_open(&path, &campaign).await.unwrap();
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
