//! The live page of a campaign: its data, their protection, and the page in a browser.

use std::io::Write as _;
use std::net::{SocketAddr, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use acceptance::browser::Browser;
use acceptance::http::{Answer, Events, LOCALHOST, VIEWS, get};
use acceptance::{
    RunningProgram, Sandbox, assert_code, binary, free_address, quick_campaign, small_campaign,
};
use serde_json::{Value, json};

const PATIENCE: Duration = Duration::from_secs(60);

fn ask(address: SocketAddr, path: &str) -> Answer {
    let since = Instant::now();
    loop {
        match get(address, LOCALHOST, path, PATIENCE) {
            Ok(answer) => return answer,
            // The server may not be listening yet.
            Err(error) => assert!(since.elapsed() < PATIENCE, "{path}: {error}"),
        }
        std::thread::sleep(Duration::from_millis(20));
    }
}

fn view(address: SocketAddr, name: &str) -> Value {
    let answer = ask(address, &format!("/api/v1/{name}"));
    assert_eq!(answer.code, 200, "{name}: {}", answer.body);
    answer.json()
}

/// Waits until a view satisfies `condition`, and returns it.
fn wait_for(address: SocketAddr, name: &str, condition: impl Fn(&Value) -> bool) -> Value {
    let since = Instant::now();
    loop {
        let view = view(address, name);
        if condition(&view) {
            return view;
        }
        assert!(since.elapsed() < 4 * PATIENCE, "{name}: {view}");
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// Starts a coordinator with a page and one worker of its own.
fn serve(sandbox: &Sandbox, file: &str, http: SocketAddr) -> RunningProgram {
    let http = http.to_string();
    let serve = ["serve", file, "--db", "c.db", "--listen", "127.0.0.1:0"];
    let more = ["--workers", "1", "--http", &http, "--keep-serving"];
    sandbox.start("coordinator", &[&serve[..], &more].concat())
}

fn samples(status: &Value) -> u64 {
    status["samples"]["done"].as_u64().expect("a number")
}

#[test]
fn the_views_follow_a_campaign_and_show_it_when_it_has_stopped() {
    let sandbox = Sandbox::new();
    // A campaign too long to finish before it is stopped.
    let file = sandbox.write("c.toml", &small_campaign(10_000, 4000));
    let http = free_address();
    let coordinator = serve(&sandbox, file.to_str().unwrap(), http);
    assert_eq!(ask(http, "/healthz").body, "ok\n");

    let mut events = Events::listen(http, PATIENCE).unwrap();
    let (name, first) = events.next().unwrap();
    assert_eq!(name, "status");
    let more = events.find(|(_, status)| samples(status) > samples(&first) + 8000);
    let (_, later) = more.expect("samples arrive");
    assert_eq!(later["stage"], "sample");
    let sampling = &later["stages"][1];
    assert_eq!(
        (&sampling["name"], &sampling["state"]),
        (&json!("sample"), &json!("current"))
    );
    assert_eq!(sampling["done"], later["samples"]["done"]);

    let timed = wait_for(http, "status", |status| {
        !status["live"]["eta_seconds"].is_null()
    });
    let ends = ["eta_low_seconds", "eta_seconds", "eta_high_seconds"];
    let ends = ends.map(|end| timed["live"][end].as_f64().expect("a time"));
    assert!(
        0.0 < ends[0] && ends[0] < ends[1] && ends[1] < ends[2],
        "{ends:?}"
    );
    let workers = wait_for(http, "workers", |view| {
        view["workers"][0]["samples_per_second"].as_f64() > Some(0.0)
    });
    assert_eq!(workers["running"], true);

    let some = |view: &Value| {
        view["points"]
            .as_array()
            .is_some_and(|points| points.len() > 3)
    };
    let responses = wait_for(http, "responses", some);
    assert_eq!(responses["preliminary"], true);
    let dimension = responses["coordinates"].as_array().unwrap().len();
    let point = &responses["points"][0];
    assert_eq!(point["x"].as_array().unwrap().len(), dimension);
    let best = wait_for(http, "best", |view| !view["best"].is_null());
    let design = &best["best"];
    assert_eq!(design["verified"], false, "{best}");
    assert!(
        best["note"].as_str().unwrap().contains("not verified"),
        "{best}"
    );
    let holds = design["constraints"].as_array().unwrap().iter();
    assert!(holds.clone().count() > 3 && holds.clone().all(|limit| limit["holds"] == true));
    for chart in design["charts"]
        .as_array()
        .expect("section and transmission error")
    {
        assert!(
            chart["svg"].as_str().unwrap().starts_with("<svg"),
            "{chart}"
        );
    }
    assert_eq!(ask(http, "/api/v1/map/0/1").code, 200);
    assert_eq!(ask(http, &format!("/api/v1/map/0/{dimension}")).code, 404);
    assert_eq!(ask(http, "/elsewhere").code, 404);

    // An unchanged view is not sent again.
    let path = "/api/v1/failures";
    let tag = ask(http, path).header("etag").unwrap().to_owned();
    let headers = [LOCALHOST[0], ("if-none-match", &tag)];
    assert_eq!(get(http, &headers, path, PATIENCE).unwrap().code, 304);

    // The page loads nothing from other sites, and no other site may read it.
    let page = ask(http, "/");
    let policy = page.header("content-security-policy").unwrap();
    assert!(
        policy.starts_with("default-src 'none'; script-src 'self';"),
        "{policy}"
    );
    for file in ["page.js", "page.css"] {
        assert!(page.body.contains(file), "{}", page.body);
        assert!(
            !ask(http, &format!("/{file}")).body.contains("://"),
            "{file}"
        );
    }
    for host in ["example.org", "localhost.example.org:80"] {
        for path in ["/", "/api/v1/status", "/api/v1/events", "/metrics"] {
            let answer = get(http, &[("host", host)], path, PATIENCE).unwrap();
            assert_eq!(answer.code, 403, "{host} {path}");
        }
    }

    // A listener receives the last state and the end of the stream.
    coordinator.terminate();
    assert!(
        events
            .last()
            .is_some_and(|(name, last)| name == "status" && samples(&last) > 8000)
    );
    assert_eq!(coordinator.finish().0.code(), Some(14));
    a_stopped_store_is_shown(&sandbox, &responses);
}

/// The page of a stopped store works without a coordinator and does not change the store.
fn a_stopped_store_is_shown(sandbox: &Sandbox, responses: &Value) {
    let before = std::fs::read(sandbox.path("c.db")).unwrap();
    let http = free_address();
    let address = http.to_string();
    let mut viewer = sandbox.start("coordinator", &["view", "--db", "c.db", "--http", &address]);
    viewer.wait_for_line(&format!("http://{address}"));
    for name in VIEWS {
        assert!(
            view(http, name)["schema_version"].as_u64() > Some(0),
            "{name}"
        );
    }
    let status = view(http, "status");
    let printed = sandbox.status("c.db").unwrap();
    assert_eq!(status["samples"], printed["samples"]);
    assert_eq!(status["live"], Value::Null);
    let workers = view(http, "workers");
    assert_eq!(
        (&workers["running"], &workers["workers"]),
        (&json!(false), &json!([]))
    );
    let all = view(http, "responses");
    let count = |view: &Value| view["points"].as_array().unwrap().len();
    assert!(count(&all) >= count(responses));
    viewer.terminate();
    assert_eq!(viewer.finish().0.code(), Some(0));
    assert!(
        before == std::fs::read(sandbox.path("c.db")).unwrap(),
        "the store has changed"
    );

    let output = sandbox.coordinator(&["view", "--db", "nothing.db"]);
    assert_ne!(output.status.code(), Some(0));
}

/// Some pages request everything without a pause, others listen but never read.
#[test]
fn many_pages_do_not_hold_up_a_campaign() {
    let sandbox = Sandbox::new();
    let file = sandbox.write("c.toml", &small_campaign(300, 2000));
    let file = file.to_str().unwrap();
    let alone = sandbox.coordinator(&["run", file, "--db", "alone.db", "--workers", "1"]);
    assert_code(&alone, 0);

    let http = free_address();
    let address = http.to_string();
    let arguments = [
        "run",
        file,
        "--db",
        "c.db",
        "--workers",
        "1",
        "--http",
        &address,
    ];
    let coordinator = sandbox.start("coordinator", &arguments);
    ask(http, "/healthz");
    let stuck: Vec<Events> = (0..40)
        .map(|_| Events::listen(http, PATIENCE).unwrap())
        .collect();
    let is_over = AtomicBool::new(false);
    let (ended, asked) = std::thread::scope(|scope| {
        let hammers: Vec<_> = (0..4)
            .map(|number| {
                let is_over = &is_over;
                scope.spawn(move || {
                    let mut asked = 0;
                    while !is_over.load(Ordering::Relaxed) {
                        for name in VIEWS.iter().cycle().skip(number).take(VIEWS.len()) {
                            let path = format!("/api/v1/{name}");
                            let answer = get(http, LOCALHOST, &path, PATIENCE);
                            asked += u32::from(answer.is_ok_and(|answer| answer.code == 200));
                        }
                        // A page asks every three seconds, so this load equals a thousand pages.
                        std::thread::sleep(Duration::from_millis(12));
                    }
                    asked
                })
            })
            .collect();
        let ended = coordinator.finish();
        is_over.store(true, Ordering::Relaxed);
        let asked: u32 = hammers.into_iter().map(|one| one.join().unwrap()).sum();
        (ended, asked)
    });
    drop(stuck);
    assert_eq!(ended.0.code(), Some(0), "{}", ended.1);
    assert!(asked > 100, "{asked} answers");
    let [watched, alone] = ["c.db", "alone.db"].map(|db| sandbox.status(db).unwrap());
    for digest in ["samples_digest", "point_samples_digest"] {
        assert_eq!(watched[digest], alone[digest]);
    }
}

/// More silent connections than the process may have open files.
#[test]
fn silent_connections_end_neither_the_campaign_nor_the_page() {
    // This process needs a file for each of them, too.
    results::descriptors::allow(4096);
    let sandbox = Sandbox::new();
    let file = sandbox.write("c.toml", &small_campaign(300, 2000));
    let http = free_address();
    let coordinator = sandbox.start(
        "/bin/sh",
        &[
            "-c",
            "ulimit -n 256; exec \"$@\"",
            "sh",
            binary("coordinator").to_str().unwrap(),
            "serve",
            file.to_str().unwrap(),
            "--db",
            "c.db",
            "--listen",
            "127.0.0.1:0",
            "--workers",
            "1",
            "--http",
            &http.to_string(),
            "--keep-serving",
        ],
    );
    ask(http, "/healthz");
    let silent: Vec<TcpStream> = (0..800)
        .map(|number| {
            let mut stream = TcpStream::connect(http).unwrap();
            if number % 2 == 0 {
                // The connection may have lost its place already.
                let _ = stream.write_all(b"GET / HTTP/1.1\r\nHost: local");
            }
            stream
        })
        .collect();
    assert_eq!(ask(http, "/healthz").body, "ok\n");
    sandbox.wait_for("c.db", "the end", |status| status["finished"] == true);
    // The page shows a state that may be some seconds old.
    wait_for(http, "status", |status| status["finished"] == true);
    drop(silent);
    coordinator.terminate();
    let (status, log) = coordinator.finish();
    assert_eq!(status.code(), Some(0), "{log}");
}

/// The number of samples that the page shows.
const SAMPLES: &str = "Number([...document.querySelectorAll('#tiles div')]
    .find((tile) => tile.firstChild.textContent === 'Samples of the DoE')
    .lastChild.firstChild.textContent.replaceAll(',', ''))";

/// A script that tells whether at least `least` images match and all are drawn.
fn are_drawn(selector: &str, least: usize) -> String {
    format!(
        "(() => {{ const all = [...document.querySelectorAll('{selector}')];
        return all.length >= {least} && all.every((one) => one.complete && one.naturalWidth > 0); }})()"
    )
}

#[test]
fn the_page_works_in_a_browser() {
    let Some(mut browser) = Browser::start() else {
        acceptance::skipped("no Chromium is installed here");
        return;
    };
    let sandbox = Sandbox::new();
    let long = sandbox.write("long.toml", &small_campaign(10_000, 4000));
    let http = free_address();
    let coordinator = serve(&sandbox, long.to_str().unwrap(), http);
    ask(http, "/healthz");
    browser.resize(1280, 900);
    browser.open(&format!("http://{http}/"));
    browser.wait_for("document.querySelectorAll('#tiles div').length > 5");
    browser.wait_for(&format!("{SAMPLES} > 0"));
    let first = browser.value(SAMPLES).as_f64().unwrap();
    browser.wait_for(&format!("{SAMPLES} > {first} + 8000"));
    browser.wait_for(&are_drawn("#map-chart img", 1));
    browser.wait_for(&are_drawn("#best-charts img", 2));
    browser.wait_for("document.querySelectorAll('#workers-table tbody tr').length === 1");
    it_fits_and_is_readable(&mut browser);
    it_has_names_and_takes_the_keyboard(&mut browser);
    assert_eq!(browser.complaints, [""; 0]);

    // When the coordinator crashes, the page says so and then follows the next coordinator.
    let last = browser.value(SAMPLES).as_f64().unwrap();
    coordinator.kill();
    browser.wait_for("document.querySelector('#connection.lost') !== null");
    let coordinator = serve(&sandbox, long.to_str().unwrap(), http);
    browser.wait_for("document.querySelector('#connection.lost') === null");
    browser.wait_for(&format!("{SAMPLES} > {last} + 8000"));
    // The browser itself logs that its requests failed.
    for complaint in std::mem::take(&mut browser.complaints) {
        assert!(complaint.contains("net::ERR_"), "{complaint}");
    }
    coordinator.terminate();
    assert_eq!(coordinator.finish().0.code(), Some(14));
}

#[test]
fn the_page_shows_the_end_of_a_campaign_and_a_finished_store() {
    let Some(mut browser) = Browser::start() else {
        acceptance::skipped("no Chromium is installed here");
        return;
    };
    let sandbox = Sandbox::new();
    let file = sandbox.write("c.toml", &quick_campaign(&[]));
    let http = free_address();
    let address = http.to_string();
    let file = file.to_str().unwrap();
    let run = ["run", file, "--db", "c.db", "--http", &address];
    let coordinator = sandbox.start("coordinator", &run);
    ask(http, "/healthz");
    browser.open(&format!("http://{http}/"));
    assert_eq!(coordinator.finish().0.code(), Some(0));
    let is_over =
        "document.getElementById('connection').textContent === 'The campaign is finished.'";
    let is_verified =
        "document.getElementById('best-note').textContent === 'Verified with samples of its own.'";
    browser.wait_for(is_over);
    browser.wait_for(is_verified);
    browser.wait_for(&are_drawn("#convergence-charts img", 3));

    let mut viewer = sandbox.start("coordinator", &["view", "--db", "c.db", "--http", &address]);
    viewer.wait_for_line(&address);
    browser.complaints.clear();
    browser.open(&format!("http://{http}/"));
    browser.wait_for(is_over);
    browser.wait_for(is_verified);
    browser.wait_for(&are_drawn("img", 6));
    let note = "document.getElementById('workers-note').textContent.includes('does not know')";
    browser.wait_for(note);
    assert_eq!(browser.complaints, [""; 0]);
}

/// Checks that nothing is wider than the window and that text has enough contrast in both themes.
fn it_fits_and_is_readable(browser: &mut Browser) {
    // The contrast ratio of WCAG 2.1, which must be at least 4.5 for text.
    let contrast = "(() => {
        const luminance = (colour) => colour.match(/[\\d.]+/g).slice(0, 3).map((part) => part / 255)
            .map((part) => part <= 0.04045 ? part / 12.92 : ((part + 0.055) / 1.055) ** 2.4)
            .reduce((sum, part, place) => sum + part * [0.2126, 0.7152, 0.0722][place], 0);
        const back = luminance(getComputedStyle(document.documentElement).backgroundColor);
        const ratio = (one) => {
            const fore = luminance(getComputedStyle(one).color);
            return (Math.max(fore, back) + 0.05) / (Math.min(fore, back) + 0.05);
        };
        const texts = [...document.querySelectorAll('body *')].filter((one) =>
            [...one.childNodes].some((node) => node.nodeType === 3 && node.data.trim()));
        return Math.min(...texts.map(ratio));
    })()";
    for theme in ["light", "dark"] {
        let features = json!([{ "name": "prefers-color-scheme", "value": theme }]);
        browser.call(
            "Emulation.setEmulatedMedia",
            &json!({ "features": features }),
        );
        let least = browser.value(contrast).as_f64().unwrap();
        assert!(least >= 4.5, "{theme}: a contrast of {least}");
        for width in [400, 1280, 3840] {
            browser.resize(width, 1000);
            let wide = browser.value("document.documentElement.scrollWidth");
            assert!(
                wide.as_u64() <= Some(width.into()),
                "{theme}: {wide} of {width} pixels"
            );
        }
    }
}

/// Checks the accessible names of controls, images and regions, and the order of keyboard focus.
fn it_has_names_and_takes_the_keyboard(browser: &mut Browser) {
    let named = [
        "link",
        "combobox",
        "image",
        "region",
        "table",
        "progressbar",
        "heading",
    ];
    let tree = browser.call("Accessibility.getFullAXTree", &json!({}));
    let nodes = tree["nodes"].as_array().unwrap().iter();
    let nodes = nodes.filter(|node| node["ignored"] == false);
    let of_role = |node: &&Value| named.iter().any(|role| node["role"]["value"] == *role);
    let mut count = 0;
    for node in nodes.filter(of_role) {
        let name = node["name"]["value"].as_str().unwrap_or_default();
        assert!(!name.trim().is_empty(), "without a name: {node}");
        count += 1;
    }
    assert!(count > 30, "{count} nodes");

    let focused = "(() => { const one = document.activeElement;
        return [one.id || one.getAttribute('href') || one.tagName, getComputedStyle(one).outlineStyle]; })()";
    browser.value("document.activeElement.blur()");
    let mut reached = Vec::new();
    for _ in 0..30 {
        browser.press_tab();
        let [name, outline] = [0, 1].map(|place| browser.value(focused)[place].to_string());
        // After the last control the focus leaves the page.
        assert!(
            name == "\"BODY\"" || outline != "\"none\"",
            "{name} does not show that it has the focus"
        );
        reached.push(name);
    }
    for name in ["\"#map\"", "\"axis-x\"", "\"axis-y\"", "\"SUMMARY\""] {
        assert!(
            reached.iter().any(|one| one == name),
            "{name} is not among {reached:?}"
        );
    }
}
