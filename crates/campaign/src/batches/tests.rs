//! What is handed out, taken back and given up.

use super::*;

const FROZEN: Frozen = Frozen {
    tip_radius_mm: [0.0; 2],
    root_radius_mm: [0.1; 2],
    helix_angle_deg: 0.0,
};

fn designs(count: usize, samples: u32) -> Batches {
    let design = |design| OpenDesign {
        design,
        x: [0.5; ROBUST_VARIABLES],
        missing: std::iter::once(0..samples).collect(),
    };
    let mut batches = Batches::default();
    let designs: Vec<OpenDesign> = (0..count as u32).map(design).collect();
    batches.add_designs(FROZEN, &designs);
    batches
}

fn asked(task: &Task) -> Vec<(u32, u32, u32)> {
    match task {
        Task::Sample { designs, .. } => designs
            .iter()
            .map(|request| {
                let SampleRange { first, count } = request.samples;
                (request.design, first, count)
            })
            .collect(),
        _ => panic!("a sampling task"),
    }
}

fn store(batches: &mut Batches, job: u64, task: &Task, seconds_per_sample: f64) {
    let mut seconds = 0.0;
    for (design, first, count) in asked(task) {
        batches.stored(StreamId::Design(design), SampleRange { first, count });
        seconds += f64::from(count) * seconds_per_sample;
    }
    batches.close(job, Some(seconds));
}

#[test]
fn every_sample_is_handed_out_once_whatever_it_costs() {
    for seconds_per_sample in [1e-6, 1e-3, 0.7, 3600.0] {
        let mut batches = designs(40, 30);
        let mut seen = BTreeSet::new();
        let mut numbers = BTreeSet::new();
        while let Some((job, task)) = batches.draw(2) {
            assert!(numbers.insert(job), "job {job:x} twice");
            for (design, first, count) in asked(&task) {
                for sample in first..first + count {
                    assert!(seen.insert((design, sample)));
                }
            }
            store(&mut batches, job, &task, seconds_per_sample);
        }
        assert_eq!(seen.len(), 1200);
        assert!(batches.designs_are_settled());
    }
}

#[test]
fn jobs_grow_until_they_take_about_a_second_and_shrink_towards_the_end() {
    let mut batches = designs(3000, 30);
    let mut sizes = Vec::new();
    while let Some((job, task)) = batches.draw(2) {
        sizes.push(asked(&task).len());
        // 50 µs per sample with its design's share: a second is 20 000 of them.
        store(&mut batches, job, &task, 1.0 / 20_000.0);
    }
    assert_eq!(sizes[0], 1, "nothing is known at first");
    let largest = *sizes.iter().max().unwrap();
    assert!((300..=700).contains(&largest), "{largest} designs in a job");
    assert_eq!(sizes.last(), Some(&1));
    assert!(sizes.len() < 80, "{} jobs", sizes.len());
}

#[test]
fn a_sample_of_an_hour_is_a_job_of_its_own() {
    let mut batches = designs(4, 30);
    let (job, task) = batches.draw(2).unwrap();
    store(&mut batches, job, &task, 3600.0);
    let (_, task) = batches.draw(2).unwrap();
    assert_eq!(asked(&task).len(), 1);
    assert_eq!(asked(&task)[0].2, 1);
}

#[test]
fn what_a_job_leaves_undone_is_handed_out_again() {
    let mut batches = designs(1, 30);
    let (job, task) = batches.draw(1).unwrap();
    let (design, first, count) = asked(&task)[0];
    let (done, left) = (count / 2, count - count / 2);
    batches.stored(StreamId::Design(design), SampleRange { first, count: done });
    batches.close(job, None);
    let mut free = 0;
    while let Some((_, task)) = batches.draw(1) {
        free += asked(&task).iter().map(|unit| unit.2).sum::<u32>();
    }
    assert_eq!(free, 30 - count + left);
    assert!(!batches.designs_are_settled());
}

#[test]
fn a_refused_design_needs_no_samples() {
    let mut batches = designs(2, 30);
    let (job, _) = batches.draw(1).unwrap();
    batches.refused(0);
    batches.close(job, None);
    assert!(!batches.designs_are_settled());
    batches.refused(1);
    assert!(batches.designs_are_settled());
    assert!(batches.draw(1).is_none());
}

#[test]
fn a_job_that_kills_is_split_before_a_design_is_given_up() {
    let mut batches = designs(100, 10);
    // One cheap job teaches that more fit into a second.
    let (job, task) = batches.draw(1).unwrap();
    store(&mut batches, job, &task, 1e-6);
    let (killer, task) = batches.draw(1).unwrap();
    let victims = asked(&task);
    assert!(victims.len() > 2);
    assert_eq!(batches.give_up(killer), None);
    let (single, single_task) = batches.draw(1).unwrap();
    assert_eq!(asked(&single_task), victims[..1]);
    assert_ne!(
        single, killer,
        "the number must not be that of the job given up"
    );
    let poison = StreamId::Design(victims[0].0);
    assert_eq!(batches.give_up(single), Some(poison));
    while let Some((job, task)) = batches.draw(1) {
        assert!(asked(&task).iter().all(|unit| unit.0 != victims[0].0));
        store(&mut batches, job, &task, 1e-6);
    }
    assert!(batches.designs_are_settled());
    assert_eq!(batches.given_up().collect::<Vec<_>>(), [poison]);

    batches.retry();
    assert!(!batches.designs_are_settled());
    assert_eq!(batches.draw(1), None, "the job that failed is out again");
    store(&mut batches, single, &single_task, 1e-6);
    assert!(batches.designs_are_settled());
}

#[test]
fn a_late_result_of_a_design_that_was_given_up_is_counted_once() {
    let mut batches = designs(2, 10);
    let (job, _) = batches.draw(1).unwrap();
    assert_eq!(batches.give_up(job), Some(StreamId::Design(0)));
    batches.stored(StreamId::Design(0), SampleRange { first: 0, count: 4 });
    batches.stored(StreamId::Design(0), SampleRange { first: 4, count: 6 });
    assert!(!batches.designs_are_settled(), "design 1 is still missing");
    assert_eq!(batches.given_up().count(), 0);
}

#[test]
fn a_job_from_before_a_restart_is_taken_over_unless_it_is_stale() {
    let mut before = designs(3, 10);
    let (job, task) = before.draw(1).unwrap();
    let mut after = designs(3, 10);
    assert!(after.adopt(job, &task));
    assert!(!after.adopt(job, &task), "a job is taken over once");
    let held = asked(&task);
    while let Some((_, task)) = after.draw(1) {
        for (design, first, count) in asked(&task) {
            let again = held
                .iter()
                .any(|h| h.0 == design && overlap(&(h.1..h.1 + h.2), &(first..first + count)));
            assert!(!again, "a sample that is being computed was handed out");
        }
    }
    let mut done = designs(0, 10);
    assert!(!done.adopt(job, &task), "its samples are stored");
}

#[test]
fn a_point_that_was_forgotten_starts_afresh_wherever_it_lies() {
    let point = |x: f64| VerifyPoint {
        name: "archard".to_owned(),
        number: 2,
        variables: Variables::robust(&[x; 6], &FROZEN),
        wanted: 8,
        stored: BTreeSet::from([0, 1, 5]),
    };
    let mut batches = Batches::default();
    batches.add_point(&point(0.1));
    let (job, task) = batches.draw(1).unwrap();
    batches.add_point(&point(0.1));
    assert!(!batches.point_is_settled(2));
    assert!(batches.forget_points(|number| number != 2).is_empty());
    assert_eq!(batches.forget_points(|number| number == 2), [job]);
    assert!(batches.point_is_settled(2));
    batches.add_point(&point(0.2));
    assert!(!batches.adopt(job, &task), "it is a job of the old point");
    let (_, task) = batches.draw(1).unwrap();
    assert!(matches!(task, Task::Verify { variables, .. }
        if variables == point(0.2).variables));
    // Even the same place: its samples are no longer stored.
    batches.stored(StreamId::Point(2), SampleRange { first: 0, count: 8 });
    assert!(batches.point_is_settled(2));
    batches.forget_points(|_| true);
    let stored = BTreeSet::new();
    batches.add_point(&VerifyPoint {
        stored,
        ..point(0.2)
    });
    assert!(!batches.point_is_settled(2) && batches.has_free());
}
