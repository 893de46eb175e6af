//! Limits on connections: for newcomers, which have not shown a valid token yet, and for admitted
//! ones.
//!
//! When all newcomers' places are taken, the oldest newcomer loses its place. A flood of silent
//! connections therefore does not delay a worker, which shows its token within milliseconds and is
//! admitted before thousands of later connections arrive. Admitted connections are counted
//! separately; one too many is refused with a message.

use std::any::Any;
use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll};
use std::time::Duration;

use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::Sleep;
use tokio_util::sync::{CancellationToken, WaitForCancellationFutureOwned};

/// Maximum number of connections without a token.
pub(crate) const NEWCOMERS: usize = 8192;
/// Maximum number of connections with a token. A worker has one.
pub(crate) const ADMITTED: usize = 16_384;
/// Time that a connection may stay open without a valid token.
const PROBATION: Duration = Duration::from_secs(30);

/// The places of a port's connections.
#[derive(Debug)]
pub(crate) struct Places {
    newcomers: Mutex<Newcomers>,
    most_newcomers: usize,
    admitted: Arc<Semaphore>,
}

#[derive(Debug, Default)]
struct Newcomers {
    arrived: u64,
    /// The newcomers by order of arrival. The value is cancelled when the newcomer loses its place.
    waiting: BTreeMap<u64, CancellationToken>,
}

impl Places {
    pub(crate) fn new(most_newcomers: usize, most_admitted: usize) -> Arc<Self> {
        Arc::new(Self {
            newcomers: Mutex::default(),
            most_newcomers,
            admitted: Arc::new(Semaphore::new(most_admitted)),
        })
    }

    fn lock(&self) -> MutexGuard<'_, Newcomers> {
        self.newcomers
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }

    /// Gives a place to a new newcomer, if necessary by closing the oldest one.
    pub(crate) fn arrive(self: &Arc<Self>) -> Newcomer {
        let mut newcomers = self.lock();
        if newcomers.waiting.len() >= self.most_newcomers {
            newcomers.close_oldest();
        }
        newcomers.arrived += 1;
        let number = newcomers.arrived;
        let lost = CancellationToken::new();
        newcomers.waiting.insert(number, lost.clone());
        Newcomer {
            places: Arc::clone(self),
            number,
            lost,
        }
    }

    /// Closes the oldest newcomer, for example when the process has run out of file descriptors.
    /// Returns false if there is none.
    pub(crate) fn close_oldest(&self) -> bool {
        self.lock().close_oldest()
    }
}

impl Newcomers {
    fn close_oldest(&mut self) -> bool {
        let oldest = self.waiting.pop_first();
        if let Some((_, lost)) = &oldest {
            lost.cancel();
        }
        oldest.is_some()
    }
}

/// A newcomer's place, which is held until it is dropped or taken by another newcomer.
#[derive(Debug)]
pub(crate) struct Newcomer {
    places: Arc<Places>,
    number: u64,
    lost: CancellationToken,
}

impl Newcomer {
    /// Waits until the place is lost.
    pub(crate) async fn lost(&self) {
        self.lost.cancelled().await;
    }

    /// A future that ends when the connection must have shown a token.
    pub(crate) fn probation(&self) -> Probation {
        Probation {
            time: Box::pin(tokio::time::sleep(PROBATION)),
            lost: Box::pin(self.lost.clone().cancelled_owned()),
        }
    }
}

impl Drop for Newcomer {
    fn drop(&mut self) {
        self.places.lock().waiting.remove(&self.number);
    }
}

/// A future that ends when a newcomer's time is up or its place is lost.
#[derive(Debug)]
pub(crate) struct Probation {
    time: Pin<Box<Sleep>>,
    lost: Pin<Box<WaitForCancellationFutureOwned>>,
}

impl Future for Probation {
    type Output = ();

    fn poll(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<()> {
        if self.time.as_mut().poll(cx).is_ready() || self.lost.as_mut().poll(cx).is_ready() {
            return Poll::Ready(());
        }
        Poll::Pending
    }
}

/// The services' knowledge of the peer of a connection. Clones refer to the same connection, which
/// keeps its place until the last clone is dropped.
#[derive(Debug, Clone)]
pub(crate) struct Peer {
    /// The address of the peer; `None` within this process.
    pub(crate) address: Option<SocketAddr>,
    standing: Arc<Mutex<Standing>>,
    attachments: Attachments,
}

/// Values that are dropped at the end of a connection, by name.
type Attachments = Arc<Mutex<BTreeMap<String, Box<dyn Any + Send>>>>;

#[derive(Debug)]
enum Standing {
    Newcomer(Newcomer),
    Admitted {
        /// Released on drop. A connection within this process has none.
        _place: Option<OwnedSemaphorePermit>,
    },
}

impl Peer {
    /// The peer of a connection from `address`.
    pub(crate) fn new(address: SocketAddr, newcomer: Newcomer) -> Self {
        Self {
            address: Some(address),
            standing: Arc::new(Mutex::new(Standing::Newcomer(newcomer))),
            attachments: Attachments::default(),
        }
    }

    /// The peer of a connection within this process.
    pub(crate) fn local() -> Self {
        Self {
            address: None,
            standing: Arc::new(Mutex::new(Standing::Admitted { _place: None })),
            attachments: Attachments::default(),
        }
    }

    /// Whether the peer is within this process and needs no token.
    pub(crate) const fn is_local(&self) -> bool {
        self.address.is_none()
    }

    /// Keeps the value of `make` until the connection ends, unless a value is kept under this name already. A service
    /// learns from the drop of its value that the caller is gone.
    pub(crate) fn keep<T: Send + 'static>(&self, name: &str, make: impl FnOnce() -> T) {
        let mut kept = self
            .attachments
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        if !kept.contains_key(name) {
            kept.insert(name.to_owned(), Box::new(make()));
        }
    }

    fn standing(&self) -> MutexGuard<'_, Standing> {
        self.standing.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether the connection may stay open without a time limit.
    pub(crate) fn is_admitted(&self) -> bool {
        matches!(*self.standing(), Standing::Admitted { .. })
    }

    /// Admits the connection. Returns false if all places are taken.
    pub(crate) fn admit(&self) -> bool {
        let mut standing = self.standing();
        let Standing::Newcomer(newcomer) = &*standing else {
            return true;
        };
        let Ok(place) = Arc::clone(&newcomer.places.admitted).try_acquire_owned() else {
            return false;
        };
        *standing = Standing::Admitted {
            _place: Some(place),
        };
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn peer(newcomer: Newcomer) -> Peer {
        Peer::new("127.0.0.1:1".parse().unwrap(), newcomer)
    }

    #[tokio::test]
    async fn the_oldest_newcomer_makes_room() {
        let places = Places::new(2, 1);
        let silent = [places.arrive(), places.arrive()];
        let late = places.arrive();
        silent[0].lost().await;
        assert!(!silent[1].lost.is_cancelled());
        assert!(!late.lost.is_cancelled());
        let late = peer(late);
        assert!(late.admit() && late.is_admitted());
        // An admitted connection does not occupy a newcomer's place.
        let _another = places.arrive();
        assert!(!silent[1].lost.is_cancelled());
    }

    #[test]
    fn an_admitted_connection_keeps_its_place_until_it_ends() {
        let places = Places::new(10, 1);
        let first = peer(places.arrive());
        assert!(first.admit() && first.admit());
        let second = peer(places.arrive());
        assert!(!second.admit() && !second.is_admitted());
        let in_flight = first.clone();
        drop(first);
        assert!(!second.admit());
        drop(in_flight);
        assert!(second.admit());
        assert!(Peer::local().admit());
    }
}
