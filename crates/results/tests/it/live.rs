//! The live page over HTTP, on a store whose campaign has just begun.

use std::io::{Read as _, Write as _};
use std::net::{Ipv4Addr, SocketAddr, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use ledger::Counts;
use results::live::site::View;
use results::live::{Site, serve};
use results::running::{CoordinatorState, Paces};
use tempfile::TempDir;
use tokio_util::sync::CancellationToken;

/// A coordinator without workers.
fn idle() -> CoordinatorState {
    CoordinatorState {
        workers: Vec::new(),
        now: Duration::ZERO,
        counts: Counts::default(),
        paces: Paces::default(),
        run_seconds: None,
        searches: Vec::new(),
        is_draining: false,
    }
}

/// A site that is served until `stop`.
struct Server {
    address: SocketAddr,
    stop: CancellationToken,
    ended: tokio::task::JoinHandle<std::io::Result<()>>,
    _folder: TempDir,
}

impl Server {
    async fn start() -> Self {
        let (folder, store) = super::new_store().await;
        let listener = tokio::net::TcpListener::bind((Ipv4Addr::LOCALHOST, 0));
        let listener = listener.await.unwrap();
        let address = listener.local_addr().unwrap();
        let stop = CancellationToken::new();
        let site = Site::new(store, Some(Box::new(idle)));
        Self {
            address,
            ended: tokio::spawn(serve(listener, site, stop.clone())),
            stop,
            _folder: folder,
        }
    }

    /// Sends a request; the connection ends with the answer.
    fn request(&self, path: &str, headers: &str) -> TcpStream {
        let mut stream = TcpStream::connect(self.address).unwrap();
        stream
            .set_read_timeout(Some(Duration::from_secs(60)))
            .unwrap();
        let request = format!("GET {path} HTTP/1.1\r\nConnection: close\r\n{headers}\r\n");
        stream.write_all(request.as_bytes()).unwrap();
        stream
    }

    /// The whole answer to a request as localhost.
    fn ask(&self, path: &str) -> String {
        self.ask_with(path, "Host: localhost\r\n")
    }

    fn ask_with(&self, path: &str, headers: &str) -> String {
        let mut answer = String::new();
        self.request(path, headers)
            .read_to_string(&mut answer)
            .unwrap();
        answer
    }
}

/// The value of a header.
fn header<'a>(answer: &'a str, name: &str) -> &'a str {
    let line = answer.lines().find_map(|line| line.strip_prefix(name));
    line.and_then(|line| line.strip_prefix(": "))
        .unwrap_or_else(|| panic!("no {name}: {answer}"))
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn every_address_answers_and_others_are_told_which_there_are() {
    let server = Server::start().await;
    let page = server.ask("/");
    assert!(
        page.starts_with("HTTP/1.1 200") && page.contains("<html"),
        "{page}"
    );
    assert!(header(&page, "content-security-policy").starts_with("default-src 'none'"));
    let mut addresses = vec![
        "/page.js".to_owned(),
        "/page.css".to_owned(),
        "/healthz".to_owned(),
    ];
    addresses.extend(View::ALL.map(|view| format!("/api/v1/{view}")));
    addresses.push("/api/v1/map/0/1".to_owned());
    for path in &addresses {
        let answer = server.ask(path);
        assert!(answer.starts_with("HTTP/1.1 200"), "{path}: {answer}");
        assert_eq!(header(&answer, "x-content-type-options"), "nosniff");
        if path.starts_with("/api/") {
            let (_, json) = answer.split_once("\r\n\r\n").unwrap();
            let view: serde_json::Value = serde_json::from_str(json).unwrap();
            assert!(view["schema_version"].is_u64(), "{path}: {view}");
            assert!(view["error"].is_null(), "{path}: {view}");
            // A browser that has the view already is told so.
            let tag = header(&answer, "etag");
            let again = server.ask_with(
                path,
                &format!("Host: localhost\r\nIf-None-Match: {tag}\r\n"),
            );
            let is_still = again.starts_with("HTTP/1.1 304") || header(&again, "etag") != tag;
            assert!(is_still, "{path}: {again}");
        }
    }
    let metrics = server.ask("/metrics");
    for line in [
        "pitchline_designs_wanted 3000",
        "pitchline_workers 0",
        "pitchline_samples_total 0",
    ] {
        assert!(metrics.contains(&format!("\n{line}")), "{metrics}");
    }
    assert!(metrics.contains("# EOF"));
    for path in ["/x", "/api/v1/x", "/api/v1/map/0/99"] {
        let answer = server.ask(path);
        assert!(answer.starts_with("HTTP/1.1 404"), "{path}: {answer}");
        assert!(
            answer.contains("/api/v1/best, /api/v1/responses"),
            "{path}: {answer}"
        );
    }
    assert!(server.ask("/api/v1/map/0/y").starts_with("HTTP/1.1 400"));
    let foreign = server.ask_with("/api/v1/status", "Host: example.org\r\n");
    assert!(foreign.starts_with("HTTP/1.1 403"), "{foreign}");
    server.stop.cancel();
    server.ended.await.unwrap().unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_page_that_listens_hears_the_end() {
    let server = Server::start().await;
    let mut events = server.request("/api/v1/events", "Host: localhost\r\n");
    let mut heard = Vec::new();
    while !String::from_utf8_lossy(&heard).contains("event: status") {
        let mut some = [0; 4096];
        let count = events.read(&mut some).unwrap();
        assert!(count > 0, "the stream ended before its first event");
        heard.extend(&some[..count]);
    }
    server.stop.cancel();
    // The stream ends with the server.
    events.read_to_end(&mut heard).unwrap();
    let heard = String::from_utf8(heard).unwrap();
    assert!(heard.matches("event: status").count() >= 2, "{heard}");
    server.ended.await.unwrap().unwrap();
    assert!(TcpStream::connect(server.address).is_err());
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_request_that_never_ends_is_cut() {
    let server = Server::start().await;
    let begun = ["", "GET / HTTP/1.1\r\nHost: local"];
    let begun = begun.map(|begun| {
        let mut stream = TcpStream::connect(server.address).unwrap();
        stream
            .set_read_timeout(Some(Duration::from_secs(60)))
            .unwrap();
        stream.write_all(begun.as_bytes()).unwrap();
        (begun, stream)
    });
    for (begun, mut stream) in begun {
        let mut answer = String::new();
        let read = stream.read_to_string(&mut answer);
        assert!(read.is_ok(), "{begun:?}: {read:?}");
        assert!(!answer.contains("200 OK"), "{begun:?}: {answer}");
    }
    server.stop.cancel();
    server.ended.await.unwrap().unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_hundred_open_pages_read_the_store_about_once() {
    let (_folder, store) = super::new_store().await;
    let asked = Arc::new(AtomicU32::new(0));
    let count = Arc::clone(&asked);
    let site = Site::new(
        store,
        Some(Box::new(move || {
            count.fetch_add(1, Ordering::Relaxed);
            idle()
        })),
    );
    let requests: Vec<_> = (0..100)
        .map(|_| {
            let site = Arc::clone(&site);
            tokio::spawn(async move { site.body(View::Workers).await.is_ok })
        })
        .collect();
    for request in requests {
        assert!(request.await.unwrap());
    }
    // On a busy machine the view may expire once or twice before the last request is answered.
    let asked = asked.load(Ordering::Relaxed);
    assert!((1..10).contains(&asked), "{asked}");
}
