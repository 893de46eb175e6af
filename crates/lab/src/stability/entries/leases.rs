//! Leases under pauses, steps of the clock and restarts.

use ledger::{Grant, Ledger, Options, StreamId, Verdict, WorkerId};
use rand::RngExt as _;
use results::report::Scale;
use stats::streams::{Purpose, StreamRng, stream};

use super::lease_scene::{LEASE, all_of, at, beat, lease, ledger, names, units, vanished, wanted};
use crate::stability::outcome::{Failed, Outcome, variant};
use crate::stability::{Entry, Method};

pub(super) const ENTRIES: [Entry; 6] = [
    Entry {
        id: "lease-paused-worker",
        title: "A worker that sleeps past its lease",
        input: "A worker that begins 10 samples and is silent for two lease times, and is the only one",
        instead: "The lease runs out and its samples are free. The worker’s next heartbeat takes the lease up again, \
                  and what it delivers takes back the blame.",
        check: paused_worker,
        ..Entry::blank(Method::Leases)
    },
    Entry {
        id: "lease-replaced-worker",
        title: "A worker that wakes when another has its samples",
        input: "The same, and a second worker has begun with the samples before the first one wakes",
        instead: "Both may go on, at most two at a time; the first delivery counts, and the other is told that nobody \
                  needs its lease.",
        check: replaced_worker,
        ..Entry::blank(Method::Leases)
    },
    Entry {
        id: "lease-clock-forward",
        title: "The clock steps forward",
        input: "50 workers that have begun, and a clock that jumps by an hour, as when the coordinator was suspended",
        instead: "All leases run out at once. The heartbeats that follow take all of them up again, so that no sample is \
                  computed twice and nothing is quarantined. The coordinator waits half a lease for them after such a jump.",
        check: clock_forward,
        ..Entry::blank(Method::Leases)
    },
    Entry {
        id: "lease-clock-back",
        title: "The clock steps back",
        input: "A lease of 30 s granted at 1000 s, and a heartbeat and looks for expired leases at 100 s",
        instead: "The heartbeat shortens nothing and nothing runs out early; the lease ends when the first grant \
                  said.",
        check: clock_back,
        ..Entry::blank(Method::Leases)
    },
    Entry {
        id: "lease-pauses",
        title: "Many workers that pause at random",
        input: "20 workers, 300 designs of 10 samples of 0.5 s, a lease in five with a pause of 5 to 240 s, leases of 30 s",
        instead: "Every sample arrives. A pause longer than a lease costs samples that are computed twice.",
        check: pauses,
        ..Entry::blank(Method::Leases)
    },
    Entry {
        id: "lease-stale",
        title: "Results of an earlier generation",
        input: "Samples of an optimum that was chosen anew meanwhile, and samples that a restarted coordinator does not know \
                of",
        instead: "The first are dropped and counted. The second are taken over under the old lease, without computing \
                  them again.",
        check: stale,
        ..Entry::blank(Method::Leases)
    },
];

/// Time of a sample in the simulated campaign.
const SAMPLE_SECONDS: f64 = 0.5;

/// A worker of the simulation.
#[derive(Clone, Default)]
struct Pausing {
    held: Option<Grant<()>>,
    done_at: f64,
    silent_until: f64,
}

/// Seconds until all samples are there, share of samples computed twice, and designs quarantined at the end.
fn campaign_with_pauses(pause: f64) -> Result<[f64; 3], Failed> {
    let ids: Vec<WorkerId> = (0..20)
        .map(|i| WorkerId::from(format!("w{i}").as_str()))
        .collect();
    let (designs, samples) = (300, 10);
    let mut ledger = ledger(designs, samples, &ids);
    let mut rng: StreamRng = stream(26, Purpose::Test, pause as u64, 0);
    let mut workers = vec![Pausing::default(); ids.len()];
    let mut computed = 0;
    for second in 0..20_000 {
        let now = f64::from(second);
        for (id, worker) in ids.iter().zip(&mut workers) {
            if now < worker.silent_until {
                continue;
            }
            if let Some(grant) = &worker.held {
                let is_needed = beat(&mut ledger, id, grant.lease, at(now)).is_empty();
                if is_needed && now < worker.done_at {
                    continue;
                }
                // A lease that is no longer needed is dropped, with its computed samples.
                computed += samples_of(grant);
                if is_needed {
                    let mut delivery = all_of(grant);
                    delivery
                        .stored
                        .retain(|unit| ledger.accept(unit) == Verdict::Yes);
                    delivery.seconds = SAMPLE_SECONDS * samples_of(grant) as f64;
                    ledger.deliver(id, grant.lease, &delivery, at(now));
                }
            }
            worker.held = ledger.lease(id, at(now));
            if let Some(grant) = &worker.held {
                beat(&mut ledger, id, grant.lease, at(now));
                let pause = if rng.random::<f64>() < 0.2 {
                    pause
                } else {
                    0.0
                };
                worker.silent_until = now + pause;
                worker.done_at = now + pause + SAMPLE_SECONDS * samples_of(grant) as f64;
            }
        }
        ledger.expire(at(now));
        let counts = ledger.counts();
        if counts.free + counts.waiting + counts.leased + counts.quarantined == 0 {
            let needed = (designs * samples) as usize;
            let twice = 100.0 * (computed as f64 / needed as f64 - 1.0);
            return Ok([now, twice, counts.quarantined as f64]);
        }
    }
    Err(format!(
        "with pauses of {pause} s the campaign does not end: {:?}",
        ledger.counts()
    )
    .into())
}

fn samples_of(grant: &Grant<()>) -> usize {
    grant
        .units
        .iter()
        .map(|(unit, ())| unit.samples.len())
        .sum()
}

fn paused_worker(found: &mut Outcome) -> Result<(), Failed> {
    let [a] = names(["a"]);
    let mut ledger = ledger(1, 10, std::slice::from_ref(&a));
    let grant = lease(&mut ledger, &a, at(0.0))?;
    beat(&mut ledger, &a, grant.lease, at(1.0));
    let now = at(1.0) + 2 * LEASE;
    vanished(found, &ledger.expire(now));
    found.figure(
        "designs free after it ran out",
        ledger.counts().free as f64,
        "",
    );
    let cancelled = beat(&mut ledger, &a, grant.lease, now);
    found.holds(
        "its next heartbeat takes the lease up",
        cancelled.is_empty(),
    );
    found.at_most(
        "designs free after that",
        ledger.counts().free as f64,
        "",
        0.0,
    );
    ledger.deliver(&a, grant.lease, &all_of(&grant), now);
    found.holds(
        "its samples settle the design",
        ledger.is_idle() && !ledger.has_work(),
    );
    Ok(())
}

fn replaced_worker(found: &mut Outcome) -> Result<(), Failed> {
    let [a, b, c] = names(["a", "b", "c"]);
    let mut ledger = ledger(1, 10, &[a.clone(), b.clone(), c.clone()]);
    let first = lease(&mut ledger, &a, at(0.0))?;
    beat(&mut ledger, &a, first.lease, at(1.0));
    let now = at(1.0) + 2 * LEASE;
    vanished(found, &ledger.expire(now));
    let second = lease(&mut ledger, &b, now)?;
    beat(&mut ledger, &b, second.lease, now);
    let goes_on = beat(&mut ledger, &a, first.lease, now).is_empty();
    found.holds("the one that woke may go on beside the other", goes_on);
    found.holds("a third one gets nothing", ledger.lease(&c, now).is_none());
    let late = now + at(5.0);
    ledger.deliver(&a, first.lease, &all_of(&first), late);
    let cancelled = beat(&mut ledger, &b, second.lease, late);
    found.holds("the other is told to stop", cancelled == [second.lease]);
    // Its late samples are compared with those stored.
    found.holds(
        "a copy is accepted for comparison",
        ledger.accept(&units(&second)[0]) == Verdict::Yes,
    );
    Ok(())
}

fn clock_forward(found: &mut Outcome) -> Result<(), Failed> {
    let workers: Vec<WorkerId> = (0..50)
        .map(|i| WorkerId::from(format!("w{i}").as_str()))
        .collect();
    let mut ledger = ledger(50, 10, &workers);
    let mut grants = Vec::new();
    for worker in &workers {
        let grant = lease(&mut ledger, worker, at(0.0))?;
        beat(&mut ledger, worker, grant.lease, at(1.0));
        grants.push(grant);
    }
    let now = at(3600.0);
    let gone = ledger.expire(now);
    found.at_least("leases that ran out at once", gone.len() as f64, "", 50.0);
    vanished(found, &gone);
    let mut cancelled = 0;
    for (worker, grant) in workers.iter().zip(&grants) {
        cancelled += beat(&mut ledger, worker, grant.lease, now).len();
    }
    found.at_most(
        "leases that are not taken up again",
        cancelled as f64,
        "",
        0.0,
    );
    found.at_most(
        "designs free for others",
        ledger.counts().free as f64,
        "",
        0.0,
    );
    for (worker, grant) in workers.iter().zip(&grants) {
        ledger.deliver(worker, grant.lease, &all_of(grant), now);
    }
    found.holds(
        "everything is settled",
        ledger.is_idle() && !ledger.has_work(),
    );
    found.at_most(
        "designs quarantined",
        ledger.quarantined().count() as f64,
        "",
        0.0,
    );
    Ok(())
}

fn clock_back(found: &mut Outcome) -> Result<(), Failed> {
    let [a] = names(["a"]);
    let mut ledger = ledger(1, 10, std::slice::from_ref(&a));
    let grant = lease(&mut ledger, &a, at(1000.0))?;
    beat(&mut ledger, &a, grant.lease, at(1000.0));
    let is_kept = beat(&mut ledger, &a, grant.lease, at(100.0)).is_empty();
    found.holds("the heartbeat at 100 s keeps the lease", is_kept);
    let early = ledger.expire(at(100.0)).len() + ledger.expire(at(1029.0)).len();
    found.at_most("leases that run out before 1030 s", early as f64, "", 0.0);
    let due = ledger.expire(at(1031.0));
    found.at_least("leases that run out after it", due.len() as f64, "", 1.0);
    vanished(found, &due);
    Ok(())
}

fn pauses(found: &mut Outcome) -> Result<(), Failed> {
    let (mut twice, mut seconds) = (Vec::new(), Vec::new());
    for pause in [
        5.0, 10.0, 20.0, 29.0, 35.0, 45.0, 60.0, 90.0, 120.0, 180.0, 240.0,
    ] {
        let [needed, share, quarantined] = campaign_with_pauses(pause)?;
        twice.push([pause, share]);
        seconds.push([pause, needed]);
        found.holds("nothing is quarantined", quarantined == 0.0);
    }
    found.at_most(
        "samples computed twice, pauses below a lease",
        twice[3][1],
        "%",
        5.0,
    );
    found.at_most(
        "samples computed twice, pauses of 240 s",
        twice[10][1],
        "%",
        40.0,
    );
    found.figure("time of the campaign, pauses of 5 s", seconds[0][1], "s");
    found.figure("time of the campaign, pauses of 240 s", seconds[10][1], "s");
    found.chart(
        "Samples computed twice",
        ("length of a pause (s)", Scale::Linear),
        ("computed twice (%)", Scale::Linear),
        vec![("one lease in five pauses", twice)],
    );
    Ok(())
}

fn stale(found: &mut Outcome) -> Result<(), Failed> {
    let [a] = names(["a"]);
    let point = StreamId::point(3);
    let mut before = ledger(0, 1, std::slice::from_ref(&a));
    before.want(wanted(point, 1, 8));
    let old = lease(&mut before, &a, at(0.0))?;
    before.want(wanted(point, 2, 8));
    let answer = before.accept(&units(&old)[0]);
    found.named(variant(&answer));
    found.holds(
        "the samples of the earlier optimum are stale",
        answer == Verdict::Stale,
    );
    found.at_least(
        "results counted as stale",
        before.counts().stale as f64,
        "",
        1.0,
    );

    let held = lease(&mut before, &a, at(1.0))?;
    let mut restarted = Ledger::new(Options::default(), 2);
    restarted.want(wanted(point, 2, 8));
    restarted.register(&a, "here", 1, at(0.0));
    restarted.close_until(at(30.0));
    found.holds(
        "after a restart nothing is leased at first",
        restarted.lease(&a, at(1.0)).is_none(),
    );
    let is_taken = restarted.adopt(&a, held.lease, &units(&held), at(1.0));
    found.holds("what a worker holds is taken over", is_taken);
    restarted.deliver(&a, held.lease, &all_of(&held), at(2.0));
    found.holds(
        "and settles the point",
        restarted.is_idle() && !restarted.has_work(),
    );
    Ok(())
}
