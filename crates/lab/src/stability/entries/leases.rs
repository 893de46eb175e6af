//! Leases under pauses, steps of the clock and restarts.

use ledger::{Generation, Grant, LeaseId, Ledger, Options, StreamId, Verdict, WorkerId};
use rand::RngExt as _;
use results::report::Scale;
use stats::streams::{Purpose, StreamRng, stream};

use super::lease_scene::{
    LEASE, all_of, at, beat, crashed, is_settled, lease, ledger, names, units, wanted,
};
use crate::stability::outcome::{EntryError, Outcome, variant};
use crate::stability::{Entry, Method};

pub(super) const ENTRIES: [Entry; 6] = [
    Entry {
        id: "lease-paused-worker",
        title: "A worker that pauses longer than its lease",
        input: "A worker that begins 10 samples and is silent for two lease times while no other worker asks",
        instead: "The lease expires and its samples are free. The worker’s next heartbeat renews the lease, and its results \
                  remove the crash from the count. A released lease is not renewed.",
        check: paused_worker,
        ..Entry::blank(Method::Leases)
    },
    Entry {
        id: "lease-replaced-worker",
        title: "A worker that wakes while another has its samples",
        input: "The same, but a second worker begins with the samples before the first one wakes",
        instead: "Both continue, but never more than two at a time. The first report counts, and the other worker is told \
                  that its lease is no longer needed.",
        check: replaced_worker,
        ..Entry::blank(Method::Leases)
    },
    Entry {
        id: "lease-clock-forward",
        title: "The clock steps forward",
        input: "50 workers that have begun, and a clock that jumps by an hour, for example because the coordinator’s \
                machine was suspended",
        instead: "All leases expire at once. The next heartbeats renew all of them, so that no sample is computed twice and \
                  nothing is quarantined. The coordinator waits half a lease for the heartbeats after such a jump.",
        check: clock_forward,
        ..Entry::blank(Method::Leases)
    },
    Entry {
        id: "lease-clock-back",
        title: "The clock steps back",
        input: "A lease of 30 s granted at 1000 s, then a heartbeat and a check for expired leases at 100 s",
        instead: "The heartbeat does not shorten the lease. It expires at the time set by the grant.",
        check: clock_back,
        ..Entry::blank(Method::Leases)
    },
    Entry {
        id: "lease-pauses",
        title: "Many workers that pause at random",
        input: "20 workers, 300 designs of 10 samples of 0.5 s, leases of 30 s, a pause of 5 to 240 s in one lease of five",
        instead: "Every sample arrives. Pauses longer than a lease cost some samples that are computed twice.",
        check: pauses,
        ..Entry::blank(Method::Leases)
    },
    Entry {
        id: "lease-stale",
        title: "Results of an earlier generation",
        input: "Samples of an optimum that was replaced meanwhile; samples leased before a restart of the coordinator",
        instead: "Results of the old optimum are dropped and counted. A lease from before the restart continues under its \
                  old name, and its samples are not computed again.",
        check: stale,
        ..Entry::blank(Method::Leases)
    },
];

/// Time of a sample in the simulated campaign, in seconds.
const SAMPLE_SECONDS: f64 = 0.5;

#[derive(Clone, Default)]
struct PausingWorker {
    grant: Option<Grant<()>>,
    done_at: f64,
    silent_until: f64,
}

/// Returns the duration in seconds, the percentage of samples computed twice, and the number of quarantined designs
/// of a campaign whose workers pause for `pause` seconds now and then.
fn campaign_with_pauses(pause: f64) -> Result<[f64; 3], EntryError> {
    let ids: Vec<WorkerId> = (0..20)
        .map(|i| WorkerId::from(format!("w{i}").as_str()))
        .collect();
    let (designs, samples) = (300, 10);
    let mut ledger = ledger(designs, samples, &ids);
    let mut rng: StreamRng = stream(26, Purpose::Test, pause as u64, 0);
    let mut workers = vec![PausingWorker::default(); ids.len()];
    let mut computed = 0;
    for second in 0..20_000 {
        let now = f64::from(second);
        for (id, worker) in ids.iter().zip(&mut workers) {
            if now < worker.silent_until {
                continue;
            }
            if let Some(grant) = &worker.grant {
                let is_needed = beat(&mut ledger, id, grant.lease, at(now)).is_empty();
                if is_needed && now < worker.done_at {
                    continue;
                }
                // The samples of a lease that is no longer needed are computed, but not reported.
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
            worker.grant = ledger.lease(id, at(now));
            if let Some(grant) = &worker.grant {
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
        "the campaign with pauses of {pause} s does not end: {:?}",
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

fn paused_worker(outcome: &mut Outcome) -> Result<(), EntryError> {
    let [a, b] = names(["a", "b"]);
    let mut ledger = ledger(1, 10, &[a.clone(), b.clone()]);
    let grant = lease(&mut ledger, &a, at(0.0))?;
    beat(&mut ledger, &a, grant.lease, at(1.0));
    let now = at(1.0) + 2 * LEASE;
    crashed(outcome, &ledger.expire(now));
    outcome.figure(
        "designs free after the lease expired",
        ledger.counts().free as f64,
        "",
    );
    let cancelled = beat(&mut ledger, &a, grant.lease, now);
    outcome.holds("the next heartbeat renews the lease", cancelled.is_empty());
    outcome.at_most(
        "designs free after that",
        ledger.counts().free as f64,
        "",
        0.0,
    );
    outcome.holds(
        "another worker gets nothing",
        ledger.lease(&b, now).is_none(),
    );

    let mut released = ledger.clone();
    released.release(&a, &[grant.lease], now);
    let cancelled = beat(&mut released, &a, grant.lease, now + at(1.0));
    outcome.holds(
        "a released lease is not renewed, and another worker gets its samples",
        cancelled == [grant.lease] && released.lease(&b, now + at(1.0)).is_some(),
    );

    ledger.deliver(&a, grant.lease, &all_of(&grant), now);
    outcome.holds("the late samples settle the design", is_settled(&ledger));
    Ok(())
}

fn replaced_worker(outcome: &mut Outcome) -> Result<(), EntryError> {
    let [a, b, c] = names(["a", "b", "c"]);
    let mut ledger = ledger(1, 10, &[a.clone(), b.clone(), c.clone()]);
    let first = lease(&mut ledger, &a, at(0.0))?;
    beat(&mut ledger, &a, first.lease, at(1.0));
    let now = at(1.0) + 2 * LEASE;
    crashed(outcome, &ledger.expire(now));
    let second = lease(&mut ledger, &b, now)?;
    beat(&mut ledger, &b, second.lease, now);
    let continues = beat(&mut ledger, &a, first.lease, now).is_empty();
    outcome.holds(
        "the worker that wakes continues beside the other one",
        continues,
    );
    for later in [now, now + at(540.0)] {
        let third = ledger.lease(&c, later);
        outcome.holds("a third worker gets nothing", third.is_none());
    }
    let late = now + at(5.0);
    ledger.deliver(&a, first.lease, &all_of(&first), late);
    let cancelled = beat(&mut ledger, &b, second.lease, late);
    outcome.holds(
        "the other worker is told to stop",
        cancelled == [second.lease],
    );
    // Its samples are compared with the stored ones.
    let verdict = ledger.accept(&units(&second)[0]);
    outcome.holds("a copy is accepted for comparison", verdict == Verdict::Yes);
    Ok(())
}

fn clock_forward(outcome: &mut Outcome) -> Result<(), EntryError> {
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
    outcome.at_least("leases that expire at once", gone.len() as f64, "", 50.0);
    crashed(outcome, &gone);
    let mut cancelled = 0;
    for (worker, grant) in workers.iter().zip(&grants) {
        cancelled += beat(&mut ledger, worker, grant.lease, now).len();
    }
    outcome.at_most("leases that are not renewed", cancelled as f64, "", 0.0);
    outcome.at_most(
        "designs free for others",
        ledger.counts().free as f64,
        "",
        0.0,
    );
    for (worker, grant) in workers.iter().zip(&grants) {
        ledger.deliver(worker, grant.lease, &all_of(grant), now);
    }
    outcome.holds("every design is settled", is_settled(&ledger));
    outcome.at_most(
        "designs quarantined",
        ledger.quarantined().count() as f64,
        "",
        0.0,
    );
    Ok(())
}

fn clock_back(outcome: &mut Outcome) -> Result<(), EntryError> {
    let [a] = names(["a"]);
    let mut ledger = ledger(1, 10, std::slice::from_ref(&a));
    let grant = lease(&mut ledger, &a, at(1000.0))?;
    beat(&mut ledger, &a, grant.lease, at(1000.0));
    let is_kept = beat(&mut ledger, &a, grant.lease, at(100.0)).is_empty();
    outcome.holds("the heartbeat at 100 s keeps the lease", is_kept);
    let early = ledger.expire(at(100.0)).len() + ledger.expire(at(1029.0)).len();
    outcome.at_most("leases that expire before 1030 s", early as f64, "", 0.0);
    let due = ledger.expire(at(1031.0));
    outcome.at_least("leases that expire after 1030 s", due.len() as f64, "", 1.0);
    crashed(outcome, &due);
    Ok(())
}

fn pauses(outcome: &mut Outcome) -> Result<(), EntryError> {
    let (mut twice, mut seconds) = (Vec::new(), Vec::new());
    for pause in [
        5.0, 10.0, 20.0, 29.0, 35.0, 45.0, 60.0, 90.0, 120.0, 180.0, 240.0,
    ] {
        let [needed, share, quarantined] = campaign_with_pauses(pause)?;
        twice.push([pause, share]);
        seconds.push([pause, needed]);
        outcome.holds("nothing is quarantined", quarantined == 0.0);
    }
    outcome.at_most(
        "samples computed twice, pauses below a lease",
        twice[3][1],
        "%",
        5.0,
    );
    outcome.at_most(
        "samples computed twice, pauses of 240 s",
        twice[10][1],
        "%",
        40.0,
    );
    outcome.figure("time of the campaign, pauses of 5 s", seconds[0][1], "s");
    outcome.figure("time of the campaign, pauses of 240 s", seconds[10][1], "s");
    outcome.chart(
        "Samples computed twice",
        ("length of a pause (s)", Scale::Linear),
        ("computed twice (%)", Scale::Linear),
        vec![("one lease in five pauses", twice)],
    );
    Ok(())
}

fn stale(outcome: &mut Outcome) -> Result<(), EntryError> {
    let [a, b] = names(["a", "b"]);
    let point = StreamId::point(3);
    let mut current = ledger(0, 1, std::slice::from_ref(&a));
    current.want(wanted(point, 1, 8));
    let old = lease(&mut current, &a, at(0.0))?;
    let mut is_stale = |ledger: &mut Ledger<()>, grant: &Grant<()>| {
        let verdict = ledger.accept(&units(grant)[0]);
        outcome.named(variant(&verdict));
        outcome.holds(
            "samples of a replaced optimum are stale",
            verdict == Verdict::Stale,
        );
    };
    // The optimum is chosen again while the worker is disconnected.
    current.forget(|id| id == point);
    is_stale(&mut current, &old);
    current.want(wanted(point, 2, 8));
    is_stale(&mut current, &old);
    current.deliver(&a, old.lease, &all_of(&old), at(9.0));
    let new = lease(&mut current, &a, at(9.0))?;
    current.want(wanted(point, 3, 8));
    is_stale(&mut current, &new);
    let needs_all = units(&new)[0].samples == (0..8);
    outcome.holds("stale samples do not count for the new optimum", needs_all);
    outcome.at_least(
        "results counted as stale",
        current.counts().stale as f64,
        "",
        3.0,
    );
    let cancelled = beat(&mut current, &a, new.lease, at(10.0));
    outcome.holds(
        "the lease of a replaced optimum is cancelled",
        cancelled == [new.lease],
    );

    let mut before = ledger(2, 10, std::slice::from_ref(&a));
    let held = lease(&mut before, &a, at(0.0))?;
    let mut after = Ledger::new(Options::default(), 2);
    after.close_until(at(30.0));
    for design in 0..2 {
        after.want(wanted(StreamId::design(design), 7, 10));
    }
    after.register(&b, "here", 1, at(0.0));
    let is_closed =
        after.lease(&b, at(1.0)).is_none() && after.next_due(&b, at(1.0)) == Some(at(30.0));
    outcome.holds("a restarted coordinator leases nothing for 30 s", is_closed);
    after.register(&a, "here", 1, at(1.0));
    let is_adopted = after.adopt(&a, held.lease, &units(&held), at(1.0));
    outcome.holds("a lease from before the restart continues", is_adopted);
    let other = lease(&mut after, &b, at(30.0))?;
    let is_other = units(&other)[0].stream != units(&held)[0].stream;
    outcome.holds("other workers get other samples", is_other);
    after.deliver(&a, held.lease, &all_of(&held), at(31.0));
    let is_adopted = after.adopt(&a, held.lease, &units(&held), at(32.0));
    outcome.holds("a settled lease is not adopted again", !is_adopted);
    let mut foreign = units(&other);
    foreign[0].generation = Generation(8);
    let id = LeaseId {
        epoch: 1,
        number: 99,
    };
    let is_adopted = after.adopt(&a, id, &foreign, at(32.0));
    outcome.holds("a lease of another generation is not adopted", !is_adopted);
    Ok(())
}
