//! The places of the page's connections. A new connection always gets one. When all are taken, the oldest
//! connection that is not being answered loses its place, so silent connections cannot keep a page from its user.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio_util::sync::CancellationToken;

/// The places of a port's connections.
#[derive(Debug)]
pub(super) struct Places {
    connections: Mutex<Connections>,
    most: usize,
}

#[derive(Debug, Default)]
struct Connections {
    /// Number of connections that have arrived.
    arrived: u64,
    /// The open connections, by order of arrival.
    by_arrival: BTreeMap<u64, Connection>,
}

#[derive(Debug)]
struct Connection {
    /// Number of answers that are being made or sent. An event stream is one.
    answers: usize,
    /// Cancelled when the connection loses its place.
    lost: CancellationToken,
}

impl Places {
    pub(super) fn new(most: usize) -> Arc<Self> {
        Arc::new(Self {
            connections: Mutex::default(),
            most,
        })
    }

    fn lock(&self) -> MutexGuard<'_, Connections> {
        self.connections
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }

    /// Gives a place to a new connection. If all are taken and all are being answered, the oldest one is closed: a
    /// page whose event stream is closed opens another.
    pub(super) fn arrive(self: &Arc<Self>) -> Arc<Place> {
        let mut connections = self.lock();
        if connections.by_arrival.len() >= self.most && !connections.close_idle() {
            connections.close(|_| true);
        }
        connections.arrived += 1;
        let number = connections.arrived;
        let lost = CancellationToken::new();
        let connection = Connection {
            answers: 0,
            lost: lost.clone(),
        };
        connections.by_arrival.insert(number, connection);
        Arc::new(Place {
            places: Arc::clone(self),
            number,
            lost,
        })
    }

    /// Closes the oldest connection that is not being answered. Returns false if there is none.
    pub(super) fn close_idle(&self) -> bool {
        self.lock().close_idle()
    }
}

impl Connections {
    fn close_idle(&mut self) -> bool {
        self.close(|connection| connection.answers == 0)
    }

    /// Closes the oldest connection that satisfies `condition`.
    fn close(&mut self, condition: impl Fn(&Connection) -> bool) -> bool {
        let mut oldest = self.by_arrival.iter();
        let Some(number) =
            oldest.find_map(|(number, connection)| condition(connection).then_some(*number))
        else {
            return false;
        };
        if let Some(connection) = self.by_arrival.remove(&number) {
            connection.lost.cancel();
        }
        true
    }
}

/// A connection's place, which is held until it is dropped or taken by another connection.
#[derive(Debug)]
pub(super) struct Place {
    places: Arc<Places>,
    number: u64,
    lost: CancellationToken,
}

impl Place {
    /// Waits until the place is lost.
    pub(super) async fn lost(&self) {
        self.lost.cancelled().await;
    }

    /// Counts an answer until it is dropped.
    pub(super) fn answer(self: &Arc<Self>) -> Answer {
        self.count(|answers| answers + 1);
        Answer(Arc::clone(self))
    }

    fn count(&self, change: impl Fn(usize) -> usize) {
        if let Some(connection) = self.places.lock().by_arrival.get_mut(&self.number) {
            connection.answers = change(connection.answers);
        }
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.places.lock().by_arrival.remove(&self.number);
    }
}

/// An answer that is being made or sent.
#[derive(Debug)]
pub(super) struct Answer(Arc<Place>);

impl Drop for Answer {
    fn drop(&mut self) {
        self.0.count(|answers| answers - 1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oldest_idle_connection_makes_room() {
        let places = Places::new(3);
        let [stream, silent, asking] = [(); 3].map(|()| places.arrive());
        let _events = stream.answer();
        let answer = asking.answer();
        let _new = places.arrive();
        assert!(silent.lost.is_cancelled());
        assert!(!stream.lost.is_cancelled() && !asking.lost.is_cancelled());
        // An answered connection is idle again.
        drop(answer);
        assert!(places.close_idle());
        assert!(asking.lost.is_cancelled());
    }

    #[test]
    fn where_all_are_answered_the_oldest_makes_room() {
        let places = Places::new(2);
        let pages = [places.arrive(), places.arrive()];
        let _answers = pages.each_ref().map(Place::answer);
        assert!(!places.close_idle());
        let _new = places.arrive();
        assert!(pages[0].lost.is_cancelled() && !pages[1].lost.is_cancelled());
    }

    #[test]
    fn a_connection_that_ends_leaves_its_place() {
        let places = Places::new(1);
        drop(places.arrive());
        let first = places.arrive();
        assert!(!first.lost.is_cancelled());
    }
}
