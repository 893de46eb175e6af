//! A network with faults: a TCP proxy on loopback.

use std::io::{Read as _, Write as _};
use std::net::{Ipv4Addr, Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Interval at which a waiting thread checks for changes.
const TICK: Duration = Duration::from_millis(20);

/// A fault of the network between a worker and its coordinator.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Fault {
    /// No fault.
    None,
    /// Existing connections are closed, and new ones end at once.
    Refuse,
    /// No data passes from the worker to the coordinator.
    Mute,
    /// No data passes from the coordinator to the worker.
    Deaf,
    /// No data passes in either direction.
    Partition,
    /// All data arrive later by this time.
    Delay(Duration),
    /// The coordinator's end of every connection is closed, the worker's is still open.
    HalfOpenAtWorker,
    /// The worker's end of every connection is closed, the coordinator's is still open.
    HalfOpenAtCoordinator,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Way {
    Up,
    Down,
}

#[derive(Debug)]
struct State {
    fault: Fault,
    /// Incremented to close all earlier connections.
    generation: u64,
    ended: bool,
}

#[derive(Debug)]
struct ProxyState {
    target: SocketAddr,
    state: Mutex<State>,
    changed: Condvar,
}

impl ProxyState {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn is_over(&self, generation: u64) -> bool {
        let state = self.lock();
        state.ended || state.generation != generation
    }

    /// Waits while the fault blocks this direction. Returns false if the connection is closed.
    fn let_through(&self, way: Way, generation: u64) -> bool {
        let mut state = self.lock();
        loop {
            if state.ended || state.generation != generation {
                return false;
            }
            let blocked = match state.fault {
                Fault::Mute => way == Way::Up,
                Fault::Deaf => way == Way::Down,
                Fault::Partition | Fault::HalfOpenAtWorker | Fault::HalfOpenAtCoordinator => true,
                Fault::None | Fault::Refuse | Fault::Delay(_) => false,
            };
            if !blocked {
                break;
            }
            state = self
                .changed
                .wait(state)
                .unwrap_or_else(PoisonError::into_inner);
        }
        let Fault::Delay(time) = state.fault else {
            return true;
        };
        drop(state);
        let until = Instant::now() + time;
        while Instant::now() < until && !self.is_over(generation) {
            std::thread::sleep(TICK.min(time));
        }
        !self.is_over(generation)
    }
}

/// A proxy. It ends with all its connections when it is dropped.
#[derive(Debug)]
pub(crate) struct Proxy {
    address: SocketAddr,
    shared: Arc<ProxyState>,
}

impl Proxy {
    /// Listens on a free loopback port and forwards connections to `target`.
    ///
    /// # Errors
    ///
    /// There is no free port.
    pub(crate) fn start(target: SocketAddr) -> std::io::Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;
        let address = listener.local_addr()?;
        let shared = Arc::new(ProxyState {
            target,
            state: Mutex::new(State {
                fault: Fault::None,
                generation: 0,
                ended: false,
            }),
            changed: Condvar::new(),
        });
        let of_thread = Arc::clone(&shared);
        std::thread::spawn(move || {
            for client in listener.incoming() {
                if of_thread.lock().ended {
                    return;
                }
                if let Ok(client) = client {
                    accept(&of_thread, client);
                }
            }
        });
        Ok(Self { address, shared })
    }

    /// The address on which it listens.
    #[must_use]
    pub(crate) const fn address(&self) -> SocketAddr {
        self.address
    }

    /// Sets the fault. With `cut`, existing connections are closed and blocked data are lost;
    /// otherwise blocked data are delivered late.
    pub(crate) fn set(&self, fault: Fault, cut: bool) {
        let mut state = self.shared.lock();
        // One end of a half-open connection is closed already; the other end is closed now.
        let half_open = |fault| {
            matches!(
                fault,
                Fault::HalfOpenAtWorker | Fault::HalfOpenAtCoordinator
            )
        };
        if cut || fault == Fault::Refuse || half_open(state.fault) {
            state.generation += 1;
        }
        state.fault = fault;
        drop(state);
        self.shared.changed.notify_all();
    }
}

impl Drop for Proxy {
    fn drop(&mut self) {
        self.shared.lock().ended = true;
        self.shared.changed.notify_all();
        // Wakes the accepting thread.
        let _ = TcpStream::connect(self.address);
    }
}

fn accept(shared: &Arc<ProxyState>, client: TcpStream) {
    let (fault, generation) = {
        let state = shared.lock();
        (state.fault, state.generation)
    };
    if fault == Fault::Refuse {
        return;
    }
    // A coordinator that is down refuses at once, because it is on the same machine.
    let Ok(server) = TcpStream::connect(shared.target) else {
        return;
    };
    for (way, from, to) in [(Way::Up, &client, &server), (Way::Down, &server, &client)] {
        let _ = from.set_nodelay(true);
        if let (Ok(from), Ok(to)) = (from.try_clone(), to.try_clone()) {
            let shared = Arc::clone(shared);
            std::thread::spawn(move || {
                pump(&shared, way, generation, &from, &to);
                let _ = from.shutdown(Shutdown::Both);
                let _ = to.shutdown(Shutdown::Both);
            });
        }
    }
}

/// Forwards data in one direction until either end or the proxy ends.
fn pump(shared: &ProxyState, way: Way, generation: u64, mut from: &TcpStream, mut to: &TcpStream) {
    let mut buffer = vec![0; 64 * 1024];
    let _ = from.set_read_timeout(Some(TICK));
    loop {
        let gone = match shared.lock().fault {
            Fault::HalfOpenAtWorker => Some(Way::Up),
            Fault::HalfOpenAtCoordinator => Some(Way::Down),
            _ => None,
        };
        if gone == Some(way) {
            // The far end is closed, and the near end stays open until the fault is over.
            let _ = to.shutdown(Shutdown::Both);
        }
        if !shared.let_through(way, generation) {
            return;
        }
        match from.read(&mut buffer) {
            // The end of a connection is delayed like data.
            Ok(0) => {
                shared.let_through(way, generation);
                return;
            }
            Ok(n) => {
                if !shared.let_through(way, generation) || to.write_all(&buffer[..n]).is_err() {
                    return;
                }
            }
            Err(error) if is_timeout(&error) => {}
            Err(_) => {
                shared.let_through(way, generation);
                return;
            }
        }
    }
}

fn is_timeout(error: &std::io::Error) -> bool {
    use std::io::ErrorKind::{Interrupted, TimedOut, WouldBlock};
    matches!(error.kind(), WouldBlock | TimedOut | Interrupted)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A server that echoes every byte.
    fn echo() -> SocketAddr {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        let address = listener.local_addr().unwrap();
        std::thread::spawn(move || {
            for stream in listener.incoming() {
                std::thread::spawn(move || {
                    let mut stream = stream.unwrap();
                    let mut byte = [0];
                    while stream.read_exact(&mut byte).is_ok() && stream.write_all(&byte).is_ok() {}
                });
            }
        });
        address
    }

    fn connect(proxy: &Proxy) -> TcpStream {
        let stream = TcpStream::connect(proxy.address()).unwrap();
        let patience = Some(Duration::from_millis(500));
        stream.set_read_timeout(patience).unwrap();
        stream
    }

    fn ask(mut stream: &TcpStream) -> std::io::Result<u8> {
        let mut byte = [7];
        stream.write_all(&byte)?;
        stream.read_exact(&mut byte)?;
        Ok(byte[0])
    }

    #[test]
    fn held_up_bytes_arrive_late_or_never() {
        let proxy = Proxy::start(echo()).unwrap();
        for fault in [Fault::Mute, Fault::Deaf, Fault::Partition] {
            let stream = connect(&proxy);
            assert_eq!(ask(&stream).unwrap(), 7);
            proxy.set(fault, false);
            assert!(is_timeout(&ask(&stream).unwrap_err()), "{fault:?}");
            proxy.set(Fault::None, false);
            let mut late = [0];
            (&stream).read_exact(&mut late).unwrap();
            assert_eq!(late, [7], "late, but there");
            proxy.set(fault, false);
            ask(&stream).unwrap_err();
            proxy.set(Fault::None, true);
            let lost = (&stream).read_exact(&mut late).unwrap_err();
            assert!(!is_timeout(&lost), "{fault:?}: the connection is cut");
        }
    }

    #[test]
    fn a_refusing_network_cuts_and_a_half_open_one_says_nothing() {
        let proxy = Proxy::start(echo()).unwrap();
        let stream = connect(&proxy);
        assert_eq!(ask(&stream).unwrap(), 7);
        proxy.set(Fault::Refuse, false);
        assert!(!is_timeout(&ask(&stream).unwrap_err()));
        proxy.set(Fault::None, false);
        let stream = connect(&proxy);
        assert_eq!(ask(&stream).unwrap(), 7);
        proxy.set(Fault::HalfOpenAtWorker, false);
        assert!(is_timeout(&ask(&stream).unwrap_err()));
        proxy.set(Fault::None, false);
        assert!(!is_timeout(&ask(&stream).unwrap_err()));
        assert_eq!(ask(&connect(&proxy)).unwrap(), 7);
    }
}
