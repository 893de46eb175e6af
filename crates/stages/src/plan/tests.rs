mod world;

use std::ops::Range;

use problem::file::FrozenFrom;

use super::*;
use crate::names;
use world::World;

fn campaign() -> Campaign {
    let mut campaign = Campaign::parse("paper.toml", Campaign::PAPER).unwrap();
    campaign.doe.designs = 12;
    campaign.verify.samples = Some(4);
    campaign.verify.half_width = None;
    campaign
}

fn enriched() -> Campaign {
    let text = include_str!("../../../../campaigns/enriched.toml");
    let mut campaign = Campaign::parse("enriched.toml", text).unwrap();
    campaign.doe.designs = 12;
    campaign.verify.samples = Some(4);
    campaign.verify.half_width = None;
    campaign
}

/// A campaign whose DoE is sampled with the values that its approach `nominal` finds.
fn own_base() -> Campaign {
    let mut campaign = enriched();
    let frozen = &mut campaign.gears_mut().unwrap().frozen;
    frozen.as_mut().unwrap().from = FrozenFrom::Deterministic;
    campaign
}

#[test]
fn an_empty_store_makes_the_doe_while_runs_without_samples_start() {
    let world = World::new(campaign());
    let next = world.next();
    assert_eq!(
        (next.local, next.stage()),
        (Some(LocalStep::Doe), Stage::Doe)
    );
    assert_eq!(next.runs.len(), 6);
}

#[test]
fn frozen_values_of_the_own_optimum_are_waited_for() {
    let mut world = World::new(own_base());
    world.pass();
    let first = world.next();
    assert_eq!((first.runs.len(), &first.sampling), (3, &None));
    assert!(!first.needs(StreamId::design(3)));
    world.pass_until(|next| next.sampling.is_some());
    let then = world.next();
    assert!(then.samples.is_some() && then.needs(StreamId::design(3)));
}

#[test]
fn the_stages_follow_each_other_to_the_end() {
    use LocalStep::{Choose, Doe, Enrich, Fit, Statistics};
    let mut world = World::new(campaign());
    world.finish();
    let next = world.next();
    assert!(next.is_finished() && next.stage() == Stage::Done);
    let mut steps = vec![
        Doe,
        Choose(Approach::Nominal),
        Choose(Approach::Baseline),
        Statistics,
        Choose(Approach::BestOfDoe),
        Fit,
        Choose(Approach::Kriging),
    ];
    assert_eq!(world.steps, steps);
    world.stages.dedup();
    let expected = [
        Stage::Doe,
        Stage::Sample,
        Stage::Optimise,
        Stage::Fit,
        Stage::Optimise,
        Stage::Verify,
    ];
    assert_eq!(world.stages, expected);

    let mut world = World::new(enriched());
    world.finish();
    let enrich = [
        Enrich,
        Enrich,
        Enrich,
        Enrich,
        Choose(Approach::EnrichedKriging),
    ];
    // The rounds wait neither for the runs on the model nor for their optimum.
    let of_kriging = steps.pop();
    world.steps.retain(|step| Some(*step) != of_kriging);
    assert_eq!(world.steps, [&steps[..], &enrich].concat());
}

#[test]
fn designs_that_were_quarantined_do_not_hold_up_the_campaign() {
    let mut world = World::new(campaign());
    world.down = |stream| stream.kind == Kind::Design && stream.index >= 10;
    world.pass_until(|next| next.local == Some(LocalStep::Statistics));
    assert_eq!(world.state.open.len(), 2);
    world.finish();
    assert_eq!(world.state.quarantined.len(), 2);
}

/// A fit that fails for lack of responses leaves approach 3 out, and is tried again when these come.
#[test]
fn a_failed_fit_is_tried_again_with_other_responses() {
    let mut world = World::new(enriched());
    world.down = |stream| stream.kind == Kind::Design && stream.index >= 2;
    world.finish();
    assert_eq!(world.state.optima[&Approach::Kriging], None);
    let failed = |world: &World| world.state.derivations["model"].failure.clone();
    assert!(failed(&world).is_some() && world.state.models.is_empty());
    let before = world.steps.len();
    world.retry(|_| false);
    world.finish();
    assert_eq!(failed(&world), None);
    assert!(world.steps[before..].contains(&LocalStep::Fit));
    assert!(world.state.optima[&Approach::Kriging].is_some());
    world.assert_undisturbed();
}

/// A quarantined run counts once it delivers.
#[test]
fn an_optimum_is_chosen_again_when_a_quarantined_run_delivers() {
    let mut world = World::new(campaign());
    let run = StreamId::run(Approach::Kriging.number() as u32, 1);
    world.down = |stream| stream == StreamId::run(Approach::Kriging.number() as u32, 1);
    world.finish();
    assert_eq!(world.state.quarantined, [run].into());
    let before = world.steps.len();
    world.retry(|_| false);
    world.finish();
    let again = &world.steps[before..];
    assert_eq!(again, [LocalStep::Choose(Approach::Kriging)]);
    world.assert_undisturbed();
}

/// A job that always fails costs no simulation at a restart: only optima are chosen again.
#[test]
fn a_design_that_fails_again_leaves_everything_but_optima_in_place() {
    let mut world = World::new(enriched());
    world.down = |stream| stream == StreamId::design(7);
    world.finish();
    let delivered = world.delivered;
    let before = world.steps.len();
    world.retry(|stream| stream == StreamId::design(7));
    world.finish();
    assert_eq!(world.delivered, delivered);
    let is_choice = |step: &LocalStep| matches!(step, LocalStep::Choose(_));
    assert!(world.steps[before..].iter().all(is_choice));
}

/// Rounds are kept up to the first one that was decided without samples that are stored by now.
#[test]
fn rounds_are_decided_again_from_the_first_whose_inputs_changed() {
    let mut world = World::new(enriched());
    let is_infill =
        |stream: &StreamId| stream.kind == Kind::Point && infill::is_infill(stream.index);
    // The second point of the second round.
    world.down = |stream| stream.kind == Kind::Point && stream.index % 100 == 11;
    world.finish();
    assert_eq!(
        world
            .state
            .quarantined
            .iter()
            .filter(|id| is_infill(id))
            .count(),
        1
    );
    let before = world.steps.len();
    let delivered = world.delivered;
    world.retry(|_| false);
    world.finish();
    let again = world.steps[before..].iter();
    assert_eq!(again.filter(|step| **step == LocalStep::Enrich).count(), 2);
    // The failed point, the third round's two, and perhaps the samples of another optimum.
    assert!(world.delivered - delivered <= 4);
    world.assert_undisturbed();
}

/// An enrichment that ended because all of its points failed continues when they deliver.
#[test]
fn an_enrichment_that_ended_by_failures_goes_on() {
    let mut world = World::new(enriched());
    world.down = |stream| stream.kind == Kind::Point && infill::is_infill(stream.index);
    world.finish();
    assert!(world.state.enrichment.is_stopped && world.state.enrichment.rounds.len() == 3);
    world.retry(|_| false);
    world.finish();
    world.assert_undisturbed();
}

/// A campaign ended when the last sample of a round came between two reads of its state.
#[test]
fn a_round_whose_last_sample_comes_while_the_state_is_read_is_waited_for() {
    let mut world = World::new(enriched());
    let is_round = |next: &Next| next.points.iter().any(|p| infill::is_infill(p.number));
    world.pass_until(|next| is_round(next) && next.points.len() == 2 && next.runs.is_empty());
    for point in &mut world.state.enrichment.points {
        point.stored = (0..point.wanted).collect();
    }
    let next = world.next();
    assert!(next.local.is_none() && !next.is_finished(), "{next:?}");
    world.finish();
    world.assert_undisturbed();
}

/// The samples of a verified optimum are removed if another design, or none, is chosen in its place.
#[test]
fn samples_of_another_design_are_removed() {
    let mut world = World::new(campaign());
    world.finish();
    let other = world.problem.base().clone();
    world.verified.insert(Approach::Kriging, (other, 4));
    world.load();
    let expected = [DerivedResult::Verification(names::verification(
        Approach::Kriging,
    ))];
    assert_eq!(world.next().outdated, expected);
    world.finish();
    world.assert_undisturbed();
}

/// After any history of failures and repairs, everything is as after an undisturbed run.
#[test]
fn what_was_repaired_is_repaired_after_any_history() {
    let disturb = |campaign: &Campaign, seeds: Range<u64>| {
        for seed in seeds {
            let mut world = World::new(campaign.clone());
            world.seed = seed;
            world.disturb();
            world.assert_undisturbed();
        }
    };
    std::thread::scope(|scope| {
        for (first, campaign) in [(0, campaign()), (1000, enriched()), (2000, own_base())] {
            scope.spawn(move || disturb(&campaign, first..first + 60));
        }
    });
}

/// The digests also decide which results are computed again after an extension.
#[test]
fn an_extension_keeps_what_does_not_depend_on_the_doe() {
    let mut world = World::new(enriched());
    world.finish();
    let mut larger = enriched();
    larger.doe.designs = 15;
    world.extend(larger);
    let next = world.next();
    assert!(next.outdated.contains(&DerivedResult::Model));
    let is_kept = |approach: Approach| {
        let optimum = DerivedResult::Optimum(names::verification(approach));
        !next.outdated.contains(&optimum)
    };
    assert!(is_kept(Approach::Nominal) && !is_kept(Approach::Kriging));
    let before = world.steps.len();
    world.finish();
    let again = &world.steps[before..];
    assert!(!again.contains(&LocalStep::Choose(Approach::Baseline)));
    world.assert_undisturbed();

    // More verification samples change no result.
    let mut larger = world.problem.campaign().clone();
    larger.verify.samples = Some(8);
    let before = world.steps.len();
    world.extend(larger);
    world.finish();
    let is_choice = |step: &LocalStep| matches!(step, LocalStep::Choose(_));
    world.steps.drain(..before);
    world.steps.retain(|step| !is_choice(step));
    assert_eq!(world.steps, [LocalStep::Statistics]);
    world.assert_undisturbed();
}

#[test]
fn without_the_section_nothing_is_enriched() {
    assert_eq!(Problem::new(campaign()).approaches().count(), 4);
    assert_eq!(Problem::new(enriched()).approaches().count(), 5);
}
