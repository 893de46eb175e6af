//! Watching, steering and extending a running campaign.

use std::collections::BTreeSet;
use std::time::Duration;

use acceptance::http::{LOCALHOST, get};
use acceptance::{Sandbox, assert_code, changed, errors, free_address, printed, small_campaign};
use runner::gateway::Role;
use runner::gateway::client::ConnectArguments;

use crate::place::{DB, Place};

fn export(sandbox: &Sandbox, db: &str, name: &str) -> Vec<String> {
    let arguments = ["export", "--db", db, "--table", "samples", "--out", name];
    assert_code(&sandbox.coordinator(&arguments), 0);
    let text = std::fs::read_to_string(sandbox.path(name)).unwrap();
    text.lines().map(str::to_owned).collect()
}

#[test]
fn a_campaign_made_larger_keeps_what_it_has() {
    let sandbox = Sandbox::new();
    let small = sandbox.write("small.toml", &small_campaign(60, 6));
    let run = |file: &std::path::Path| {
        sandbox.coordinator(&["run", file.to_str().unwrap(), "--db", "c.db"])
    };
    assert_code(&run(&small), 0);
    let before = export(&sandbox, "c.db", "before.csv");

    let larger = small_campaign(90, 9);
    let larger_file = sandbox.write("larger.toml", &larger);
    assert_code(&run(&larger_file), 0);
    let status = sandbox.status("c.db").unwrap();
    assert_eq!(status["finished"], true, "{status}");
    assert_eq!(status["designs"]["done"], 90);
    let simulable = status["designs"]["simulable"].as_u64().unwrap();
    assert_eq!(status["samples"]["done"], 9 * simulable);
    let after = export(&sandbox, "c.db", "after.csv");
    assert!(
        before.iter().all(|row| after.contains(row)),
        "a sample has changed"
    );

    // The report may be overwritten, before and after the extension.
    assert_code(&run(&larger_file), 0);

    // A smaller size or another problem makes another campaign.
    assert_code(&run(&small), 6);
    let other = larger.replacen("seed = 2009", "seed = 2010", 1);
    assert_ne!(other, larger);
    assert_code(&run(&sandbox.write("other.toml", &other)), 6);
    let unchanged = sandbox.status("c.db").unwrap();
    assert_eq!(unchanged["samples_digest"], status["samples_digest"]);
}

#[test]
fn of_two_campaigns_with_one_folder_the_first_to_finish_has_the_report() {
    let sandbox = Sandbox::new();
    let text = small_campaign(60, 6);
    let late = sandbox.write("late.toml", &text);
    let other = changed(&text, &[("seed = 2009", "seed = 2010")]);
    let first = sandbox.write("first.toml", &other);
    let serve = ["serve", late.to_str().unwrap(), "--db", "late.db"];
    let options = ["--listen", "127.0.0.1:0", "--access", "c.access"];
    let out = ["--out", "report"];
    let late_one = sandbox.start("coordinator", &[&serve[..], &options, &out].concat());
    let _ = sandbox.wait_for_file("c.access");
    let run = ["run", first.to_str().unwrap(), "--db", "first.db"];
    assert_code(&sandbox.coordinator(&[&run[..], &out].concat()), 0);
    let report = || std::fs::read(sandbox.path("report/report.html")).unwrap();
    let before = report();
    let _worker = sandbox.start("worker", &["--access", "c.access", "--slots", "1"]);
    let (status, said) = late_one.finish();
    assert_eq!(status.code(), Some(4), "{said}");
    for part in [
        "all results are in late.db",
        "with another --out",
        "write to report: it holds the report of another campaign, \"",
    ] {
        assert!(said.contains(part), "no {part:?} in {said}");
    }
    assert!(before == report(), "the report was replaced");

    // The results are kept: the same command writes the report elsewhere.
    let again = ["run", late.to_str().unwrap(), "--db", "late.db"];
    assert_code(
        &sandbox.coordinator(&[&again[..], &["--out", "own"]].concat()),
        0,
    );
    assert!(sandbox.path("own/report.html").exists());
}

#[test]
fn a_command_without_a_coordinator_names_the_way_to_a_store() {
    let sandbox = Sandbox::new();
    let output = sandbox.coordinator(&["status"]);
    assert_code(&output, 11);
    let message = errors(&output);
    for part in ["`coordinator run` has no port", "status --db FILE"] {
        assert!(message.contains(part), "no {part:?} in {message}");
    }
}

/// From the second extension on, existing designs share strata of the finer grid.
#[test]
fn a_campaign_grows_again_and_again() {
    let sandbox = Sandbox::new();
    let mut before: Vec<String> = Vec::new();
    for n in [60, 70, 81, 160] {
        let text = changed(&small_campaign(n, 6), &[("\"random\"", "\"maximin\"")]);
        let file = sandbox.write("c.toml", &text);
        let run = || sandbox.coordinator(&["run", file.to_str().unwrap(), "--db", "c.db"]);
        assert_code(&run(), 0);
        let status = sandbox.status("c.db").unwrap();
        assert_eq!(status["finished"], true, "{status}");
        assert_eq!(status["designs"]["done"], n);
        let simulable = status["designs"]["simulable"].as_u64().unwrap();
        assert_eq!(status["samples"]["done"], 6 * simulable);

        let after = export(&sandbox, "c.db", &format!("{n}.csv"));
        let held: BTreeSet<&String> = after.iter().collect();
        assert!(before.iter().all(|row| held.contains(row)), "{n} designs");
        // The table has a header, and each (design, index) once.
        let keys: BTreeSet<Vec<&str>> = after
            .iter()
            .map(|row| row.split(',').take(2).collect())
            .collect();
        assert_eq!(keys.len() as u64, 6 * simulable + 1);
        assert_eq!(after.len(), keys.len());

        // The store holds the extended DoE, so the same command has no work.
        assert_code(&run(), 0);
        let again = sandbox.status("c.db").unwrap();
        assert_eq!(again["samples_digest"], status["samples_digest"]);
        assert_eq!(export(&sandbox, "c.db", &format!("{n}-again.csv")), after);
        before = after;
    }
}

#[test]
fn a_running_campaign_can_be_asked_and_drained() {
    let sandbox = Sandbox::new();
    // Far more jobs than a worker can hold, each of a few milliseconds: the campaign never
    // finishes, and leased jobs are reported soon after the drain.
    let file = sandbox.write("long.toml", &small_campaign(1500, 4000));
    let (address, page) = (free_address().to_string(), free_address());
    let http = page.to_string();
    let serve = [
        "serve",
        file.to_str().unwrap(),
        "--db",
        "c.db",
        "--listen",
        &address,
        "--http",
        &http,
        "--log-format",
        "json",
    ];
    let coordinator = sandbox.start("coordinator", &serve);
    sandbox.wait_for("c.db", "the DoE", |status| status["stage"] == "sample");
    let ask = |arguments: &[&str]| {
        let output = sandbox.coordinator(&[arguments, &["--connect", &address]].concat());
        assert_code(&output, 0);
        printed(&output)
    };
    let why = ask(&["explain"]);
    assert!(why.contains("no worker has connected"), "{why}");

    let worker = sandbox.start("worker", &["--connect", &address, "--slots", "1"]);
    let some = |status: &serde_json::Value| status["samples"]["done"].as_u64() > Some(10_000);
    sandbox.wait_for("c.db", "some samples", some);
    let status: serde_json::Value =
        serde_json::from_str(&ask(&["status", "--json"])).expect("the status is JSON");
    let workers = status["live"]["workers"].as_array().expect("the live part");
    assert_eq!(workers.len(), 1, "{status}");
    assert!(status["live"]["samples_per_second"].as_f64() > Some(0.0));
    assert!(ask(&["status"]).contains("samples per second"));

    let metrics = get(page, LOCALHOST, "/metrics", Duration::from_secs(30)).unwrap();
    for line in ["pitchline_samples_total ", "pitchline_workers 1", "# EOF"] {
        assert!(metrics.body.contains(line), "no {line:?} in\n{metrics:?}");
    }

    assert!(ask(&["drain"]).contains("draining"));
    let (ended, errors) = coordinator.finish();
    assert_eq!(ended.code(), Some(14), "{errors}");
    let held = sandbox.status("c.db").unwrap();
    assert_eq!(
        (&held["failures"], &held["finished"]),
        (&0.into(), &false.into())
    );

    // The worker leaves because it cannot know whether the drain will be lifted.
    assert_eq!(worker.finish().0.code(), Some(14));
    // The same command continues.
    let again = sandbox.start("coordinator", &serve);
    let worker = sandbox.start("worker", &["--connect", &address, "--slots", "1"]);
    let done = |status: &serde_json::Value| status["samples"]["done"].as_u64();
    sandbox.wait_for("c.db", "more samples", |status| done(status) > done(&held));
    worker.terminate();
    assert_eq!(worker.finish().0.code(), Some(14));
    again.terminate();
    assert_eq!(again.finish().0.code(), Some(14));
}

#[tokio::test]
async fn anyone_with_the_access_file_learns_what_can_be_asked() {
    use tonic_reflection::pb::v1::ServerReflectionRequest;
    use tonic_reflection::pb::v1::server_reflection_client::ServerReflectionClient;
    use tonic_reflection::pb::v1::server_reflection_request::MessageRequest;
    use tonic_reflection::pb::v1::server_reflection_response::MessageResponse;

    let sandbox = Sandbox::new();
    let place = Place::new(&sandbox, &small_campaign(60, 6));
    let _coordinator = place.serve(&["--access", "c.access"]);
    let _ = sandbox.wait_for_file("c.access");
    let arguments = ConnectArguments {
        access: Some(sandbox.path("c.access")),
        connect: None,
    };
    let channel = arguments.link(Role::Client).unwrap().channel();

    let request = ServerReflectionRequest {
        message_request: Some(MessageRequest::ListServices(String::new())),
        ..ServerReflectionRequest::default()
    };
    let mut client = ServerReflectionClient::new(channel.clone());
    let questions = tokio_stream::once(request);
    let mut answers = client
        .server_reflection_info(questions)
        .await
        .unwrap()
        .into_inner();
    let answer = answers.message().await.unwrap().unwrap().message_response;
    let Some(MessageResponse::ListServicesResponse(list)) = answer else {
        panic!("{answer:?}")
    };
    let names: Vec<&str> = list.service.iter().map(|s| s.name.as_str()).collect();
    for name in ["pitchline.v1.Campaign", "grpc.health.v1.Health"] {
        assert!(names.contains(&name), "{names:?}");
    }

    let mut health = tonic_health::pb::health_client::HealthClient::new(channel);
    let request = tonic_health::pb::HealthCheckRequest {
        service: "pitchline.v1.Campaign".to_owned(),
    };
    let health = health.check(request).await.unwrap().into_inner();
    assert_eq!(
        health.status(),
        tonic_health::pb::health_check_response::ServingStatus::Serving
    );
}

#[test]
fn who_watches_through_a_restart_sees_the_end_all_the_same() {
    let sandbox = Sandbox::new();
    let place = Place::new(&sandbox, &small_campaign(60, 6));
    let coordinator = place.serve(&["--keep-serving"]);
    sandbox.wait_for(DB, "the DoE", |status| status["stage"] == "sample");
    let watch = ["status", "--watch", "--connect", &place.address];
    let watch = sandbox.start("coordinator", &watch);
    // The first answer comes at once, and a worker's registration counts as a change.
    std::thread::sleep(std::time::Duration::from_secs(3));
    coordinator.kill();
    std::thread::sleep(std::time::Duration::from_secs(2));
    let coordinator = place.serve(&["--keep-serving"]);
    let worker = place.worker(&[]);
    assert_eq!(worker.finish().0.code(), Some(0));
    let (ended, said) = watch.finish();
    assert_eq!(ended.code(), Some(0), "{said}");
    assert!(said.contains("asking again"), "{said}");
    let again = place.ask(&["retry"]);
    assert!(again.contains("nothing was quarantined"), "{again}");
    coordinator.terminate();
    assert_eq!(coordinator.finish().0.code(), Some(0));
}

#[test]
fn whoever_watches_sees_the_end() {
    let sandbox = Sandbox::new();
    let place = Place::new(&sandbox, &small_campaign(60, 6));
    let coordinator = place.serve(&[]);
    // The coordinator makes the DoE after writing the access file.
    sandbox.wait_for(DB, "the DoE", |status| status["stage"] == "sample");
    let worker = place.worker(&[]);
    let watch = ["status", "--watch", "--json", "--connect", &place.address];
    let output = sandbox.coordinator(&watch);
    assert_code(&output, 0);
    let text = printed(&output);
    let last: serde_json::Value =
        serde_json::from_str(text.lines().last().expect("at least one line")).unwrap();
    assert_eq!(last["finished"], true, "{last}");
    assert_eq!(worker.finish().0.code(), Some(0));
    assert_eq!(coordinator.finish().0.code(), Some(0));
}
