//! The page, its data and the metrics over HTTP.
//!
//! On a loopback address everybody on the machine can read the page, and nothing can be controlled.
//! A page of another site could reach it from a browser under a host name of its own that resolves
//! to this machine (DNS rebinding), so requests with such a `Host` are refused. Without a header
//! that permits it, no browser lets another site read an answer.
//!
//! Everybody on the machine can also connect: the number of connections and the time for a request are
//! limited, so that strangers cannot block the page or use up the open files.

use std::convert::Infallible;
use std::net::IpAddr;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::extract::{Path, Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use futures_util::{Stream, StreamExt as _, stream};
use http_body_util::BodyExt as _;
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::{Service as _, service_fn};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::net::{TcpListener, TcpStream};
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;

use crate::descriptors;
use crate::live::admission::{Place, Places};
use crate::live::metrics;
use crate::live::site::{Body, Site, View};

const PAGE: &str = include_str!("../../page/page.html");
const STYLE: &str = include_str!("../../page/page.css");
const SCRIPT: &str = include_str!("../../page/page.js");

/// The resources that a browser may load for the page: its own files, and the images in its data.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; \
                      img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// Maximum number of connections.
pub const CONNECTIONS: usize = 256;
/// Time limit for the headers of a request, also of the next one on a connection.
const HEADERS: Duration = Duration::from_secs(10);
/// Time to wait for a file descriptor when there is none for a connection.
const NO_DESCRIPTOR: Duration = Duration::from_millis(5);

/// Interval between messages to a listening page, so that a broken connection is noticed.
const HEARTBEAT: Duration = Duration::from_secs(10);
/// Time without a request after which all open pages have fetched the views of the last status.
const FAREWELL: Duration = Duration::from_secs(1);
/// Maximum time to wait for the last requests, and then for the connections to end.
const LONGEST_FAREWELL: Duration = Duration::from_secs(3);

/// Serves a site on `listener` until `stop`.
///
/// # Errors
///
/// The listener has no address.
pub async fn serve(
    listener: TcpListener,
    site: Arc<Site>,
    stop: CancellationToken,
) -> std::io::Result<()> {
    let is_loopback = listener.local_addr()?.ip().is_loopback();
    let router = router(Arc::clone(&site), is_loopback);
    let closing = CancellationToken::new();
    // Connections are dropped together with this task.
    let mut connections = JoinSet::new();
    let ended = async {
        if site.send_changes(&stop).await {
            let quiet = site.quiet(FAREWELL);
            let _ = tokio::time::timeout(LONGEST_FAREWELL, quiet).await;
        }
    };
    tokio::select! {
        () = ended => {}
        never = accept(&listener, &router, &closing, &mut connections) => match never {},
    }
    drop(listener);
    closing.cancel();
    let rest = async { while connections.join_next().await.is_some() {} };
    // A connection that is silent, or does not read its answer, is cut.
    let _ = tokio::time::timeout(LONGEST_FAREWELL, rest).await;
    Ok(())
}

/// Accepts connections and serves them until `closing`.
async fn accept(
    listener: &TcpListener,
    router: &Router,
    closing: &CancellationToken,
    connections: &mut JoinSet<()>,
) -> Infallible {
    let places = Places::new(CONNECTIONS);
    loop {
        while connections.try_join_next().is_some() {}
        let accepted = listener.accept().await;
        let is_scarce = match &accepted {
            Ok((stream, _)) => descriptors::is_of_reserve(stream, descriptors::RESERVE),
            // Most likely there are no file descriptors left.
            Err(_) => true,
        };
        let has_room = !is_scarce || places.close_idle();
        // An idle connection gives its descriptor back when its task runs. Until then new ones must not use up the
        // reserve, which the report needs.
        let leaves_enough =
            |stream: &TcpStream| !descriptors::is_of_reserve(stream, descriptors::RESERVE / 2);
        if let Ok((stream, _)) = accepted
            && has_room
            && leaves_enough(&stream)
        {
            let service = TowerToHyperService::new(router.clone());
            connections.spawn(attend(stream, service, places.arrive(), closing.clone()));
        }
        if is_scarce {
            tokio::time::sleep(NO_DESCRIPTOR).await;
        }
    }
}

/// Serves a connection until it ends, loses its place, or has no request to answer after `closing`.
async fn attend(
    stream: TcpStream,
    router: TowerToHyperService<Router>,
    place: Arc<Place>,
    closing: CancellationToken,
) {
    let service = service_fn(|request: Request<Incoming>| {
        let being_sent = place.answer();
        let answer = router.call(request);
        async move {
            let answer = answer.await?;
            // The body holds the guard until it is sent. `map_err` keeps the body's length.
            let keep = move |error| {
                let _ = &being_sent;
                error
            };
            Ok::<_, Infallible>(answer.map(|body| body.map_err(keep)))
        }
    });
    let connection = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(HEADERS)
        .serve_connection(TokioIo::new(stream), service);
    let mut connection = std::pin::pin!(connection);
    tokio::select! {
        // A client's fault, such as headers that never end.
        _ = connection.as_mut() => return,
        () = place.lost() => return,
        () = closing.cancelled() => {}
    }
    connection.as_mut().graceful_shutdown();
    let _ = connection.await;
}

fn router(site: Arc<Site>, is_loopback: bool) -> Router {
    let text = |media: &'static str, text: &'static str| {
        get(move || async move { ([(header::CONTENT_TYPE, media)], text) })
    };
    let style = || async {
        let style = format!("{}{STYLE}", crate::report::PAGE_STYLE);
        ([(header::CONTENT_TYPE, "text/css; charset=utf-8")], style)
    };
    let mut router = Router::new()
        .route("/", text("text/html; charset=utf-8", PAGE))
        .route("/page.js", text("text/javascript; charset=utf-8", SCRIPT))
        .route("/page.css", get(style))
        .route("/healthz", get(healthz))
        .route("/metrics", get(scrape))
        .route("/api/v1/map/{x}/{y}", get(map))
        .route("/api/v1/events", get(events));
    for view in View::ALL {
        let answer = move |State(site): State<Arc<Site>>, headers: HeaderMap| async move {
            let _visit = site.visit();
            json(&*site.body(view).await, &headers)
        };
        router = router.route(&format!("/api/v1/{view}"), get(answer));
    }
    let router = router
        .fallback(nothing)
        .with_state(site)
        .layer(middleware::map_response(guarded));
    if is_loopback {
        router.layer(middleware::from_fn(refuse_other_names))
    } else {
        router
    }
}

async fn guarded(mut response: Response) -> Response {
    let headers = response.headers_mut();
    for (name, value) in [
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
    ] {
        headers.insert(name, HeaderValue::from_static(value));
    }
    headers
        .entry(header::CACHE_CONTROL)
        .or_insert(HeaderValue::from_static("no-cache"));
    response
}

async fn refuse_other_names(request: Request, next: Next) -> Response {
    let host = request.headers().get(header::HOST);
    let host = host.and_then(|host| host.to_str().ok()).unwrap_or_default();
    if is_this_machine(host) {
        return next.run(request).await;
    }
    let why = "refused: ask for this page as localhost or 127.0.0.1, not by another name\n";
    (StatusCode::FORBIDDEN, why).into_response()
}

/// Whether a `Host` is a loopback name, with any port, since a tunnel may use another one.
fn is_this_machine(host: &str) -> bool {
    let name = match host.strip_prefix('[') {
        Some(rest) => rest.split_once(']').map_or("", |(name, _)| name),
        None => host.split_once(':').map_or(host, |(name, _)| name),
    };
    let is_loopback = |address: IpAddr| address.is_loopback();
    name.eq_ignore_ascii_case("localhost") || name.parse().is_ok_and(is_loopback)
}

fn json(body: &Body, headers: &HeaderMap) -> Response {
    let status = if body.is_ok {
        StatusCode::OK
    } else {
        StatusCode::SERVICE_UNAVAILABLE
    };
    let known = headers.get(header::IF_NONE_MATCH);
    let is_known = known.is_some_and(|known| known.as_bytes() == body.tag.as_bytes());
    let tag = [(header::ETAG, body.tag.clone())];
    if body.is_ok && is_known {
        return (StatusCode::NOT_MODIFIED, tag).into_response();
    }
    let media = [(header::CONTENT_TYPE, "application/json")];
    (status, tag, media, body.json.clone()).into_response()
}

async fn map(
    State(site): State<Arc<Site>>,
    Path((x, y)): Path<(usize, usize)>,
    headers: HeaderMap,
) -> Response {
    let _visit = site.visit();
    match site.map(x, y).await {
        Some(map) => json(&map, &headers),
        None => nothing().await.into_response(),
    }
}

async fn nothing() -> (StatusCode, String) {
    let views = View::ALL.map(|view| format!("/api/v1/{view}"));
    let all = views.join(", ");
    let why = format!(
        "nothing is here: the page is at /, its data at {all}, /api/v1/map/X/Y with the numbers of two \
         coordinates and /api/v1/events, metrics at /metrics\n"
    );
    (StatusCode::NOT_FOUND, why)
}

/// Answers whether the store can be read.
async fn healthz(State(site): State<Arc<Site>>) -> Response {
    match &*site.status().await {
        Ok(_) => "ok\n".into_response(),
        Err(error) => (StatusCode::SERVICE_UNAVAILABLE, format!("{error}\n")).into_response(),
    }
}

async fn scrape(State(site): State<Arc<Site>>) -> Response {
    match &*site.status().await {
        Ok(status) => {
            let text = metrics::render(status.clone());
            ([(header::CONTENT_TYPE, metrics::MEDIA_TYPE)], text).into_response()
        }
        Err(error) => (StatusCode::SERVICE_UNAVAILABLE, format!("{error}\n")).into_response(),
    }
}

/// Streams the status: at once, after every change, and when the server ends.
async fn events(
    State(site): State<Arc<Site>>,
) -> Sse<impl Stream<Item = Result<Event, Infallible>>> {
    let mut changes = site.listen();
    // The last event may be old, because events are sent only while a page listens.
    let is_over = changes.borrow_and_update().is_last;
    let first = site.body(View::Status).await;
    let later = stream::unfold((changes, is_over), |(mut changes, is_over)| async move {
        if is_over {
            return None;
        }
        changes.changed().await.ok()?;
        let sent = changes.borrow_and_update().clone();
        Some((sent.status?, (changes, sent.is_last)))
    });
    let events = stream::once(std::future::ready(first)).chain(later);
    let events = events.map(|body| {
        let name = if body.is_ok { "status" } else { "trouble" };
        Ok(Event::default()
            .event(name)
            .data(String::from_utf8_lossy(&body.json)))
    });
    Sse::new(events).keep_alive(KeepAlive::new().interval(HEARTBEAT))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_other_sites_are_told_from_those_of_this_machine() {
        for host in [
            "localhost",
            "LocalHost:9400",
            "127.0.0.1:1",
            "127.1.2.3",
            "[::1]:80",
            "[::1]",
        ] {
            assert!(is_this_machine(host), "{host}");
        }
        for host in [
            "",
            "example.org",
            "localhost.example.org",
            "127.0.0.1.example.org:80",
            "10.0.0.1",
            "[::1",
            "[2001:db8::1]:80",
            ":80",
        ] {
            assert!(!is_this_machine(host), "{host}");
        }
    }
}
