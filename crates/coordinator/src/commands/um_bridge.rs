//! `coordinator um-bridge`: a campaign's gear model for other programs.

use std::net::{Ipv4Addr, SocketAddr};
use std::sync::Arc;

use axum::extract::{DefaultBodyLimit, Path, State};
use axum::http::StatusCode;
use axum::response::{IntoResponse as _, Response};
use axum::{Router, routing};
use runner::coordinator::serving::listen;
use runner::exit::{self, ProgramError};
use serde_json::{Value, json};
use studies::um_bridge::{Model, NAME, Refusal};
use tokio_util::sync::CancellationToken;

use super::studies::usage;
use super::{campaign_or_paper, viewing};
use crate::arguments;

/// The port that clients of UM-Bridge try first.
const PORT: u16 = 4242;
/// The largest request, in bytes; a design and its coefficients take about 2 kB.
const LARGEST_REQUEST: usize = 1 << 20;

/// Serves the model until it is interrupted.
pub(super) async fn um_bridge(arguments: arguments::UmBridge) -> Result<u8, ProgramError> {
    viewing::refuse_open(arguments.http)?;
    let campaign = campaign_or_paper(arguments.campaign.as_deref())?.campaign;
    let model = Arc::new(Model::new(campaign).map_err(usage)?);
    let here = SocketAddr::from((Ipv4Addr::LOCALHOST, PORT));
    let listener = listen("--http", arguments.http.unwrap_or(here)).await?;
    runner::console::announce(&format!(
        "the UM-Bridge model {NAME} is at http://{}; Ctrl-C ends it\n{}",
        listener.local_addr()?,
        model.describe().trim_end()
    ));
    let stop = CancellationToken::new();
    tokio::spawn(runner::console::watch_signals(stop.clone(), "stopping"));
    let router = Router::new()
        .route("/{path}", routing::any(answer))
        .layer(DefaultBodyLimit::max(LARGEST_REQUEST))
        .with_state(model);
    axum::serve(listener, router)
        .with_graceful_shutdown(stop.cancelled_owned())
        .await?;
    Ok(exit::OK)
}

async fn answer(
    State(model): State<Arc<Model>>,
    Path(path): Path<String>,
    body: String,
) -> Response {
    // A question about the server alone has no content.
    let text = if body.is_empty() { "null" } else { &body };
    let content: Value = match serde_json::from_str(text) {
        Ok(content) => content,
        Err(error) => {
            return refuse(&Refusal {
                kind: "InvalidInput",
                message: format!("the request is not JSON: {error}"),
            });
        }
    };
    let answered = tokio::task::spawn_blocking(move || model.answer(&path, &content)).await;
    match answered {
        Ok(Ok(answer)) => answer.to_string().into_response(),
        Ok(Err(refusal)) => refuse(&refusal),
        // The computation panicked.
        Err(error) => refuse(&Refusal {
            kind: "InternalError",
            message: error.to_string(),
        }),
    }
}

fn refuse(refusal: &Refusal) -> Response {
    let error = json!({ "error": { "type": refusal.kind, "message": refusal.message } });
    (StatusCode::BAD_REQUEST, error.to_string()).into_response()
}
