//! Metrics for Prometheus, for dashboards and alarms.
//!
//! This module counts nothing: a scrape reports the values of the status.

use crate::running::CoordinatorStatus;
use crate::status::Status;
use prometheus_client::collector::Collector;
use prometheus_client::encoding::text::encode;
use prometheus_client::encoding::{DescriptorEncoder, EncodeMetric};
use prometheus_client::metrics::counter::ConstCounter;
use prometheus_client::metrics::gauge::ConstGauge;
use prometheus_client::registry::Registry;

/// The media type of the text format.
pub(crate) const MEDIA_TYPE: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

/// The metrics of a campaign in the text format of OpenMetrics.
#[must_use]
pub fn render(status: Status) -> String {
    let mut registry = Registry::with_prefix("pitchline");
    registry.register_collector(Box::new(StatusCollector(status)));
    let mut text = String::new();
    // Writing to a string does not fail.
    let _ = encode(&mut text, &registry);
    text
}

#[derive(Debug)]
struct StatusCollector(Status);

impl Collector for StatusCollector {
    fn encode(&self, mut encoder: DescriptorEncoder<'_>) -> Result<(), std::fmt::Error> {
        let Status {
            designs,
            samples,
            optimiser_runs,
            finished,
            failures,
            live,
            ..
        } = &self.0;
        let mut put =
            |name: &str, help: &str, metric: &dyn Put| metric.put(&mut encoder, name, help);
        put(
            "samples",
            "Samples of the DoE in the store",
            &total(samples.done),
        )?;
        put(
            "designs",
            "Designs whose criteria are in the store",
            &total(designs.done),
        )?;
        put(
            "designs_wanted",
            "Designs of the DoE",
            &level(designs.wanted as f64),
        )?;
        put(
            "designs_simulable",
            "Designs that can be simulated",
            &level(designs.simulable as f64),
        )?;
        put(
            "optimiser_runs",
            "Finished runs of optimisers",
            &total(optimiser_runs.done),
        )?;
        put(
            "failures",
            "Crashes, failures and jobs quarantined on record",
            &total(*failures),
        )?;
        put(
            "finished",
            "1 when every stage is done",
            &level(f64::from(u8::from(*finished))),
        )?;
        let Some(CoordinatorStatus {
            jobs_queued,
            jobs_leased,
            jobs_done,
            jobs_quarantined,
            samples_per_second,
            draining,
            workers,
            ..
        }) = live
        else {
            return Ok(());
        };
        let here = workers.iter().filter(|worker| worker.silent_seconds < 15.0);
        let slots: u32 = here.clone().map(|worker| worker.slots).sum();
        put(
            "jobs_done",
            "Jobs done since the coordinator started",
            &total(*jobs_done),
        )?;
        put(
            "jobs_queued",
            "Jobs that wait for a worker",
            &level(*jobs_queued as f64),
        )?;
        put("jobs_leased", "Leased jobs", &level(*jobs_leased as f64))?;
        put(
            "jobs_quarantined",
            "Jobs that were quarantined",
            &level(*jobs_quarantined as f64),
        )?;
        put(
            "samples_per_second",
            "Recent rate of stored samples, per second",
            &level(*samples_per_second),
        )?;
        put(
            "workers",
            "Workers seen recently",
            &level(here.count() as f64),
        )?;
        put(
            "slots",
            "Jobs that the workers seen recently compute at once",
            &level(f64::from(slots)),
        )?;
        put(
            "draining",
            "1 when no more jobs are leased",
            &level(f64::from(u8::from(*draining))),
        )
    }
}

fn total(value: u64) -> ConstCounter<u64> {
    ConstCounter::new(value)
}

fn level(value: f64) -> ConstGauge<f64> {
    ConstGauge::new(value)
}

/// A metric of any type, as one argument.
trait Put {
    fn put(&self, encoder: &mut DescriptorEncoder<'_>, name: &str, help: &str) -> std::fmt::Result;
}

impl<M: EncodeMetric> Put for M {
    fn put(&self, encoder: &mut DescriptorEncoder<'_>, name: &str, help: &str) -> std::fmt::Result {
        let metric = encoder.encode_descriptor(name, help, None, self.metric_type())?;
        self.encode(metric)
    }
}
