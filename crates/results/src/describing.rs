//! The status as text for people.

use std::fmt::Write as _;

use stages::optima::NoOptimum;

use crate::number::{estimate, rate, with_unit};
use crate::running::{CoordinatorStatus, Worker};
use crate::status::{EnrichmentStatus, FailureGroup, Progress, Status};

/// The status for people.
#[must_use]
pub fn describe(status: &Status) -> String {
    let mut text = String::new();
    let Status {
        designs,
        samples,
        optimiser_runs,
        ..
    } = status;
    // Writing to a string does not fail.
    let _ = writeln!(
        text,
        "campaign        {} ({})",
        status.campaign,
        &status.campaign_digest[..12]
    );
    let _ = writeln!(text, "stage           {}", status.stage_name());
    let _ = writeln!(
        text,
        "designs         {} of {} done, {} simulable{}",
        designs.done,
        designs.wanted,
        designs.simulable,
        match designs.ruled_out {
            0 => String::new(),
            count => format!(", {count} of them ruled out by constraints"),
        }
    );
    let _ = writeln!(
        text,
        "samples         {} ({}{} per design)",
        samples.done,
        // With a precision, designs get more.
        match samples.done
            > samples.per_design * designs.simulable.saturating_sub(designs.ruled_out)
        {
            true => "at least ",
            false => "",
        },
        samples.per_design
    );
    let _ = writeln!(text, "samples digest  {}", status.samples_digest);
    let _ = writeln!(text, "verify digest   {}", status.point_samples_digest);
    if !status.digests_checked {
        let _ = writeln!(
            text,
            "                as recorded; coordinator status --db FILE --check compares them"
        );
    }
    let _ = writeln!(
        text,
        "optimiser runs  {} of {}",
        optimiser_runs.done, optimiser_runs.wanted
    );
    for run in &status.unfinished_runs {
        let Progress { done, wanted } = run.evaluations;
        let _ = writeln!(
            text,
            "                {}: {done} of {wanted} evaluations",
            run.name
        );
    }
    if let Some(enrichment) = &status.enrichment {
        let EnrichmentStatus {
            round,
            samples,
            points,
            failed,
            ruled_out,
            ended,
        } = enrichment;
        let state = if *ended {
            "ended".to_owned()
        } else {
            format!("{} of {} samples", samples.done, samples.wanted)
        };
        let of_them = |count: &u64, what: &str| match count {
            0 => String::new(),
            count => format!(", {count} of them {what}"),
        };
        let unsampled = of_them(failed, "failed") + &of_them(ruled_out, "ruled out by constraints");
        let _ = writeln!(
            text,
            "enrichment      round {round}: {state}; {points} infill points{unsampled}"
        );
    }
    for optimum in &status.optima {
        let found = match (optimum.none, optimum.criterion) {
            (Some(NoOptimum::NoModel), _) => format!("no model ({})", optimum.note),
            (Some(none), _) => none.to_string(),
            (None, None) => "no feasible design".to_owned(),
            (None, Some(value)) => with_unit(value, 4, &status.unit),
        };
        let Progress { done, wanted } = &optimum.verified;
        let verified = match &optimum.measure {
            Some(found) => {
                let ends = found.low.zip(found.high);
                let measure = estimate(found.value, ends, "");
                let interval = match ends {
                    Some(_) => "",
                    None => " without an interval (too few)",
                };
                let difference = optimum
                    .behind
                    .as_ref()
                    .and_then(|behind| Some((behind.value, behind.low.zip(behind.high)?)));
                let behind = match difference {
                    Some((value, ends)) => {
                        let worse = estimate(value, Some(ends), "");
                        match ends {
                            (low, _) if low <= 0.0 => {
                                format!(", not significantly worse than the best: {worse} worse")
                            }
                            _ => format!(", {worse} worse than the best"),
                        }
                    }
                    None => String::new(),
                };
                let name = &status.measure;
                format!(", {name} {measure}{interval} by {done} verification samples{behind}")
            }
            None if *wanted == 0 => String::new(),
            None => format!(", {done} of {wanted} verification samples"),
        };
        let _ = writeln!(
            text,
            "optimum         {:<16} {found}{verified}",
            optimum.approach
        );
        for limit in &optimum.limits {
            let ends = limit.value.low.zip(limit.value.high);
            let value = estimate(limit.value.value, ends, &limit.unit);
            let _ = writeln!(
                text,
                "                {}: {value} where {}; {}",
                limit.constraint,
                limit.statement(),
                limit.confidence_in_words()
            );
        }
    }
    for warning in &status.warnings {
        let _ = writeln!(text, "warning         {warning}");
    }
    let _ = writeln!(text, "failures        {}", status.failures);
    for group in &status.failure_groups {
        let FailureGroup {
            kind,
            cause,
            count,
            last_job,
            ..
        } = group;
        let _ = writeln!(text, "  {count:>6} x {kind}: {cause} (last: {last_job})");
    }
    if let Some(live) = &status.live {
        describe_live(live, &mut text);
    }
    text
}

fn describe_live(live: &CoordinatorStatus, text: &mut String) {
    let CoordinatorStatus {
        jobs_queued,
        jobs_leased,
        jobs_done,
        jobs_quarantined,
        ..
    } = live;
    let _ = writeln!(
        text,
        "jobs            {jobs_leased} leased, {jobs_queued} queued, {jobs_done} done, \
         {jobs_quarantined} quarantined{}",
        if live.draining { "; draining" } else { "" }
    );
    let eta = live
        .time_to_go()
        .map_or_else(String::new, |time| format!(", to go: {time}"));
    let _ = writeln!(
        text,
        "rate            {}{eta}",
        rate(live.samples_per_second)
    );
    for worker in &live.workers {
        let Worker {
            host,
            slots,
            leased,
            completed,
            failed,
            silent_seconds,
            is_suspended,
            samples_per_second,
        } = worker;
        let aside = if *is_suspended { ", suspended" } else { "" };
        let _ = writeln!(
            text,
            "worker          {host}: {slots} slots, {leased} jobs, {completed} done, {failed} \
             failed, {}, last seen {silent_seconds:.1} s ago{aside}",
            rate(*samples_per_second)
        );
    }
}
