use std::fs;
use std::path::Path;

use tonic::Request;

use super::part::PartWriter;
use super::*;
use crate::protocol::v1::campaign_server::Campaign as _;
use crate::protocol::v1::{
    Directive, Kind, Lease, LeaseId, LeaseRequest, LeaseResult, Origin, RegisterRequest,
    ReportRequest, Unit, UnitResult,
};

/// A design with this index and ten samples.
fn unit(index: u64) -> Unit {
    Unit {
        kind: Kind::Design.into(),
        index,
        generation: 7,
        first: 0,
        count: 10,
    }
}

fn lease(number: u64) -> Lease {
    Lease {
        id: Some(LeaseId { epoch: 1, number }),
        units: vec![unit(number)],
        ..Lease::default()
    }
}

/// The samples of a lease.
fn result(number: u64) -> LeaseResult {
    LeaseResult {
        id: Some(LeaseId { epoch: 1, number }),
        results: vec![UnitResult {
            unit: Some(unit(number)),
            samples: (0..10)
                .map(|sample| number as f64 + 0.1 * f64::from(sample))
                .collect(),
            ..UnitResult::default()
        }],
        wall_seconds: 0.5,
        origin: None,
    }
}

fn deal(leases: u64, shards: u32) -> Vec<Shard> {
    Shard::deal(
        (0..leases).map(lease).collect(),
        shards,
        ("{}", "campaign"),
        Some("model"),
    )
}

/// A part with the results of leases 0, 1 and 2, of a shard with four leases.
fn part_of_three(path: &Path) -> Shard {
    let shard = deal(4, 1).remove(0);
    let mut writer = PartWriter::open(path, &shard, "model").unwrap();
    writer.append(&[result(0)]).unwrap();
    writer.append(&[result(1), result(2)]).unwrap();
    shard
}

#[test]
fn every_lease_is_in_one_shard_and_no_shard_is_empty() {
    for (leases, shards, expected) in [(10, 3, 3), (3, 8, 3), (1, 1, 1), (0, 4, 0)] {
        let dealt = deal(leases, shards);
        assert_eq!(dealt.len(), expected);
        let sizes: Vec<usize> = dealt.iter().map(|shard| shard.leases.len()).collect();
        let differ = sizes.iter().max().zip(sizes.iter().min());
        assert!(
            differ.is_none_or(|(most, least)| *least > 0 && most - least <= 1),
            "{sizes:?}"
        );
        let mut numbers: Vec<u64> = dealt
            .iter()
            .flat_map(Shard::units)
            .map(|unit| unit.index)
            .collect();
        numbers.sort_unstable();
        assert_eq!(numbers, (0..leases).collect::<Vec<_>>());
        for (shard, number) in dealt.iter().zip(1..) {
            assert_eq!((shard.shard, shard.shards), (number, expected as u32));
            assert_eq!(shard.plan, dealt[0].plan);
        }
    }
    // The plan's id is that of its jobs.
    assert_eq!(deal(10, 3)[0].plan, deal(10, 2)[0].plan);
    assert_ne!(deal(10, 3)[0].plan, deal(9, 3)[0].plan);
}

#[test]
fn a_shard_is_read_as_it_was_written_and_another_build_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let shard = deal(5, 2).remove(1);
    let path = shard.write(folder.path()).unwrap();
    assert_eq!(path, folder.path().join("2.json"));
    assert_eq!(Shard::read(&path).unwrap(), shard);
    let text = fs::read_to_string(&path).unwrap();
    fs::write(&path, text.replace(crate::identity::BUILD, "other")).unwrap();
    let error = Shard::read(&path).unwrap_err();
    assert!(
        matches!(&error, Error::Build { theirs, .. } if theirs == "other"),
        "{error}"
    );
    fs::write(&path, &text[..text.len() / 2]).unwrap();
    let error = Shard::read(&path).unwrap_err().to_string();
    assert!(error.contains("2.json is not a shard"), "{error}");
}

#[test]
fn a_part_cut_at_any_byte_keeps_its_whole_records_and_is_continued() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("1.part");
    let shard = part_of_three(&path);
    let whole = fs::read(&path).unwrap();
    let all = Part::read(&path).unwrap().results;
    assert_eq!(all, [result(0), result(1), result(2)]);
    let head = whole.iter().position(|byte| *byte == b'\n').unwrap() + 1;
    let mut counts = Vec::new();
    for end in head..=whole.len() {
        fs::write(&path, &whole[..end]).unwrap();
        let held = Part::read(&path).unwrap().results;
        assert_eq!(held, all[..held.len()], "cut at {end}");
        let mut writer = PartWriter::open(&path, &shard, "model").unwrap();
        writer.append(&all[held.len()..]).unwrap();
        assert_eq!(fs::read(&path).unwrap(), whole, "cut at {end}");
        counts.push(held.len());
    }
    counts.dedup();
    assert_eq!(counts, [0, 1, 2, 3]);
    for end in 0..head {
        fs::write(&path, &whole[..end]).unwrap();
        let error = Part::read(&path).unwrap_err();
        assert!(
            matches!(error, Error::NotAPart { .. }),
            "cut at {end}: {error}"
        );
        // A file that is not a part is not overwritten.
        assert!(PartWriter::open(&path, &shard, "model").is_err());
        assert_eq!(fs::read(&path).unwrap(), whole[..end]);
    }
}

#[test]
fn a_flipped_bit_never_gives_other_results() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("1.part");
    part_of_three(&path);
    let whole = fs::read(&path).unwrap();
    let all = Part::read(&path).unwrap().results;
    let head = whole.iter().position(|byte| *byte == b'\n').unwrap() + 1;
    let mut named = 0;
    for bit in 8 * head..8 * whole.len() {
        let mut bytes = whole.clone();
        bytes[bit / 8] ^= 1 << (bit % 8);
        fs::write(&path, bytes).unwrap();
        match Part::read(&path) {
            Err(Error::Damaged { at, shard, .. }) => {
                assert!(at <= bit as u64 / 8 && shard == Some(1));
                named += 1;
            }
            Err(error) => panic!("bit {bit}: {error}"),
            // A longer length makes a record look as if it were being written: its jobs are missing.
            Ok(part) => {
                assert!(part.results.len() < all.len(), "bit {bit}");
                assert_eq!(part.results, all[..part.results.len()], "bit {bit}");
                assert!(part.missing().len() > 1, "bit {bit}");
            }
        }
    }
    assert!(named > 8 * (whole.len() - head) * 9 / 10, "{named}");
}

#[test]
fn a_part_of_another_shard_is_left_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("1.part");
    part_of_three(&path);
    let before = fs::read(&path).unwrap();
    let error =
        |designs, model| PartWriter::open(&path, &deal(designs, 1).remove(0), model).unwrap_err();
    let other = error(5, "model");
    assert!(matches!(other, Error::OtherShard { .. }), "{other}");
    let other = error(4, "other");
    assert!(matches!(other, Error::OtherSimulator { .. }), "{other}");
    assert_eq!(fs::read(&path).unwrap(), before);
}

#[test]
fn a_unit_is_done_when_its_samples_are_covered_or_a_reason_is_given() {
    let of = |first: u32, count: u32, change: fn(&mut UnitResult)| {
        let mut result = UnitResult {
            unit: Some(Unit {
                first,
                count,
                ..unit(3)
            }),
            ..UnitResult::default()
        };
        change(&mut result);
        LeaseResult {
            results: vec![result],
            ..LeaseResult::default()
        }
    };
    let done = |results: &[LeaseResult]| part::is_done(&unit(3), results);
    let samples = |first, count| of(first, count, |_| ());
    assert!(!done(&[]));
    assert!(done(&[samples(0, 4), samples(4, 6)]));
    assert!(!done(&[samples(0, 4), samples(5, 5)]), "a gap");
    assert!(!done(&[samples(0, 9)]));
    for reason in [
        |result: &mut UnitResult| result.refused = Some("r".to_owned()),
        |result: &mut UnitResult| result.ruled_out = Some("r".to_owned()),
        |result: &mut UnitResult| result.error = Some("r".to_owned()),
    ] {
        assert!(done(&[of(0, 0, reason)]));
        assert!(done(&[samples(0, 4), of(4, 0, reason)]));
        assert!(!done(&[of(10, 0, reason)]), "a reason of another lease");
    }
    assert!(
        !part::is_done(&unit(4), &[samples(0, 10)]),
        "another stream"
    );
    let other = Unit {
        generation: 8,
        ..unit(3)
    };
    assert!(
        !part::is_done(&other, &[samples(0, 10)]),
        "another generation"
    );
}

/// Registers worker `w` with this simulator.
async fn register(service: &Service, model: &str) -> Result<(), tonic::Status> {
    register_as("w", service, model).await
}

async fn register_as(worker: &str, service: &Service, model: &str) -> Result<(), tonic::Status> {
    let request = RegisterRequest {
        worker_id: worker.to_owned(),
        model_digest: model.to_owned(),
        ..RegisterRequest::default()
    };
    service.register(Request::new(request)).await.map(|_| ())
}

/// The numbers of the leases that a request gets, and whether the shard is finished.
async fn ask(service: &Service, credit: u32) -> (Vec<u64>, bool) {
    let request = LeaseRequest {
        credit,
        ..LeaseRequest::default()
    };
    let response = service
        .lease(Request::new(request))
        .await
        .unwrap()
        .into_inner();
    let numbers = response.leases.iter().map(|lease| lease.id.unwrap().number);
    (
        numbers.collect(),
        response.directive() == Directive::Finished,
    )
}

async fn report(service: &Service, numbers: &[u64]) {
    let results = numbers.iter().map(|number| result(*number)).collect();
    let request = ReportRequest {
        results,
        ..ReportRequest::default()
    };
    service.report(Request::new(request)).await.unwrap();
}

#[tokio::test]
async fn a_stopped_shard_continues_with_what_its_part_lacks() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("1.part");
    let shard = deal(5, 1).remove(0);
    let service = Service::new(shard.clone(), out.clone());
    register(&service, "model").await.unwrap();
    assert_eq!(ask(&service, 3).await, (vec![0, 1, 2], false));
    report(&service, &[0, 2]).await;
    drop(service);
    // The lease that was computed and not reported is computed again.
    let service = Service::new(shard.clone(), out.clone());
    register_as("next", &service, "model").await.unwrap();
    assert_eq!(ask(&service, 8).await, (vec![1, 3, 4], false));
    assert_eq!(ask(&service, 8).await, (vec![], false));
    report(&service, &[1, 3, 4]).await;
    assert_eq!(ask(&service, 8).await, (vec![], true));
    let part = Part::read(&out).unwrap();
    assert!(part.missing().is_empty());
    // Each result says which of the two workers computed it.
    let of = |(number, worker): (u64, &str)| LeaseResult {
        origin: Some(Origin {
            worker_id: worker.to_owned(),
            ..Origin::default()
        }),
        ..result(number)
    };
    let computed = [(0, "w"), (2, "w"), (1, "next"), (3, "next"), (4, "next")];
    assert_eq!(part.results, computed.map(of));
    let processes = part.by_process();
    let units = processes
        .iter()
        .map(|(_, results)| part.units_with(results));
    let expected = [vec![unit(0), unit(2)], vec![unit(1), unit(3), unit(4)]];
    assert_eq!(units.collect::<Vec<_>>(), expected);
    assert!(service.failed().is_none());
}

#[tokio::test]
async fn a_worker_that_does_not_fit_the_shard_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("1.part");
    let service = Service::new(deal(2, 1).remove(0), out.clone());
    let refused = register(&service, "other").await.unwrap_err();
    assert!(refused.message().contains("other numbers"), "{refused}");
    assert!(!out.exists());
    // A file that cannot be continued is an error of the program, not only of the worker.
    fs::write(&out, "a diary\n").unwrap();
    assert!(register(&service, "model").await.is_err());
    let error = service.failed().unwrap();
    assert!(matches!(error, Error::NotAPart { .. }), "{error}");
    assert_eq!(fs::read_to_string(&out).unwrap(), "a diary\n");
}
