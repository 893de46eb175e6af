//! `view`: the live page of a store without a coordinator, and the check of a page's address.

use std::net::{Ipv4Addr, SocketAddr};

use runner::coordinator::serving::listen;
use runner::exit::{self, ProgramError};
use store::Store;
use tokio_util::sync::CancellationToken;

use super::Usage;
use crate::arguments;

/// Refuses an address that other machines reach: the page is served without encryption or tokens.
pub(super) fn refuse_open(address: Option<SocketAddr>) -> Result<(), Usage> {
    match address {
        Some(address) if !address.ip().is_loopback() => {
            let port = address.port();
            Err(Usage(format!(
                "--http {address} is reachable by others and has neither encryption nor tokens: give \
                 127.0.0.1:{port}, and look from another machine through a tunnel, as with ssh -L \
                 {port}:127.0.0.1:{port} HOST"
            )))
        }
        _ => Ok(()),
    }
}

/// `coordinator view`.
pub(super) async fn view(arguments: arguments::View) -> Result<u8, ProgramError> {
    refuse_open(arguments.http)?;
    let store = Store::open_read_only(&arguments.db).await?;
    let anywhere = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
    let listener = listen("--http", arguments.http.unwrap_or(anywhere)).await?;
    runner::console::announce(&format!(
        "the page of {} is at http://{}; Ctrl-C ends it",
        arguments.db.display(),
        listener.local_addr()?
    ));
    let stop = CancellationToken::new();
    tokio::spawn(runner::console::watch_signals(stop.clone(), "stopping"));
    results::live::serve(
        listener,
        results::live::Site::new(store.clone(), None),
        stop,
    )
    .await?;
    store.close().await?;
    Ok(exit::OK)
}
