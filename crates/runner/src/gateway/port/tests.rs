//! Tests of the port through real connections.

use std::path::{Path, PathBuf};

use crate::protocol::Refusal;
use crate::protocol::v1::StatusRequest;
use tonic::Code;

use super::*;
use crate::gateway::access::Issuer;
use crate::gateway::client::ConnectArguments;
use crate::gateway::{Error, Link, Role, TlsFault};

/// A port with only the health service: campaign calls that get through end as unimplemented.
struct Port {
    address: SocketAddr,
    stop: CancellationToken,
}

impl Port {
    async fn open(issuer: &Issuer) -> Self {
        allow_many_files();
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let stop = CancellationToken::new();
        let (_, health) = tonic_health::server::health_reporter();
        let listeners = Listeners {
            port: Some((listener, issuer.guard().unwrap())),
            local: local().1,
        };
        tokio::spawn(serve_services(Routes::new(health), listeners, stop.clone()));
        Self { address, stop }
    }
}

impl Drop for Port {
    fn drop(&mut self) {
        self.stop.cancel();
    }
}

/// An open port and its access file.
struct Coordinator {
    folder: tempfile::TempDir,
    port: Port,
    _issuer: Issuer,
}

impl Coordinator {
    async fn start() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let mut issuer = Issuer::new(&folder.path().join("c.access"), "c").unwrap();
        let port = Port::open(&issuer).await;
        issuer.publish(port.address, &[]).unwrap();
        Self {
            folder,
            port,
            _issuer: issuer,
        }
    }

    fn file(&self) -> PathBuf {
        self.folder.path().join("c.access")
    }

    /// A copy of the access file without the line that begins with `key`.
    fn copy_without(&self, key: &str) -> PathBuf {
        let text = std::fs::read_to_string(self.file()).unwrap();
        let lines = text.split_inclusive('\n');
        let kept: String = lines.filter(|line| !line.starts_with(key)).collect();
        let copy = self.folder.path().join("copy.access");
        crate::gateway::secret_file::write(&copy, &kept).unwrap();
        copy
    }

    fn link(&self) -> Link {
        link(&self.file(), None)
    }
}

/// A client's link by the access file at `path`.
fn link(path: &Path, connect: Option<SocketAddr>) -> Link {
    let arguments = ConnectArguments {
        access: Some(path.to_owned()),
        connect: connect.map(|address| address.to_string().parse().unwrap()),
    };
    arguments.link(Role::Client).unwrap()
}

/// The status with which a `Status` call ends.
async fn status(link: &Link) -> tonic::Status {
    let mut client = link.client();
    let call = tokio::time::timeout(Duration::from_secs(20), client.status(StatusRequest {}));
    call.await.expect("an answer in time").unwrap_err()
}

/// Whether calls over this link get through.
async fn is_admitted(link: &Link) -> bool {
    status(link).await.code() == Code::Unimplemented
}

/// The TLS fault that a call meets.
async fn fault(link: &Link) -> TlsFault {
    match link.error(&status(link).await) {
        Error::Tls { fault, .. } => fault,
        other => panic!("{other:?}"),
    }
}

#[tokio::test]
async fn tokens_open_the_port() {
    let coordinator = Coordinator::start().await;
    assert!(is_admitted(&coordinator.link()).await);
    // A client with only a worker's token sends that.
    let worker = coordinator.copy_without("client_token");
    let refused = status(&link(&worker, None)).await;
    assert_eq!(refused.code(), Code::PermissionDenied);
    assert_eq!(Refusal::of(&refused), Some(Refusal::Forbidden));
    // The right certificate with a token of another coordinator.
    let text = std::fs::read_to_string(coordinator.file()).unwrap();
    let secret = text.split_once("pitchline-client-").unwrap().1;
    let (digit, other) = if secret.starts_with('0') {
        ("0", "1")
    } else {
        (&secret[..1], "0")
    };
    let (from, to) = (
        format!("pitchline-client-{digit}"),
        format!("pitchline-client-{other}"),
    );
    let strange = coordinator.folder.path().join("strange.access");
    crate::gateway::secret_file::write(&strange, &text.replace(&from, &to)).unwrap();
    let strange = link(&strange, None);
    let refused = status(&strange).await;
    assert_eq!(refused.code(), Code::Unauthenticated);
    assert_eq!(Refusal::of(&refused), Some(Refusal::Unknown));
    // A file that is being replaced looks the same, so the first failure is not final.
    assert!(strange.refusal(&refused).is_none());
    let refused = status(&strange).await;
    assert!(matches!(
        strange.refusal(&refused),
        Some(Error::Refused { .. })
    ));
}

#[tokio::test]
async fn a_certificate_of_another_coordinator_is_refused() {
    let coordinator = Coordinator::start().await;
    let other = Coordinator::start().await;
    let link = link(&other.file(), Some(coordinator.port.address));
    assert_eq!(fault(&link).await, TlsFault::Untrusted);
    let refused = status(&link).await;
    assert!(link.refusal(&refused).is_none());
    let refused = status(&link).await;
    assert!(matches!(
        link.refusal(&refused),
        Some(Error::Tls {
            fault: TlsFault::Untrusted,
            ..
        })
    ));
}

/// Another program may listen at a coordinator's address, and it must not get the token.
#[tokio::test]
async fn a_token_does_not_travel_in_clear() {
    let coordinator = Coordinator::start().await;
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    let other_program = tokio::spawn(async move {
        let (mut stream, _) = listener.accept().await.unwrap();
        stream
            .write_all(b"HTTP/1.1 400 Bad Request\r\n\r\n")
            .await
            .unwrap();
        let mut received = Vec::new();
        stream.read_to_end(&mut received).await.unwrap();
        received
    });
    let link = link(&coordinator.file(), Some(address));
    assert_eq!(fault(&link).await, TlsFault::NoTls);
    drop(link);
    let received = String::from_utf8_lossy(&other_program.await.unwrap()).into_owned();
    assert!(!received.is_empty());
    for clear in ["Bearer", "pitchline-client", "PRI"] {
        assert!(!received.contains(clear), "{received:?}");
    }
}

#[tokio::test]
async fn other_protocols_get_a_sentence_and_rubbish_is_dropped() {
    let coordinator = Coordinator::start().await;
    for bytes in [
        &b"GET / HTTP/1.1\r\n\r\n"[..],
        b"\0\xff\0\xff",
        b"PRI * HTTP/3.0",
        PREFACE,
    ] {
        let mut stream = TcpStream::connect(coordinator.port.address).await.unwrap();
        stream.write_all(bytes).await.unwrap();
        let mut answer = String::new();
        tokio::time::timeout(Duration::from_secs(5), stream.read_to_string(&mut answer))
            .await
            .expect("the connection is closed")
            .unwrap();
        assert!(answer.starts_with("HTTP/1.1 400 "), "{answer}");
        assert!(answer.contains("gRPC over TLS"), "{answer}");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_thousand_callers_get_in_at_once() {
    let coordinator = Coordinator::start().await;
    let mut callers = JoinSet::new();
    let mut links = Vec::new();
    for _ in 0..1000 {
        let link = coordinator.link();
        links.push(link.clone());
        callers.spawn(async move {
            // On a busy machine some connections are too slow and try again, as workers do.
            loop {
                let status = link.client().status(StatusRequest {}).await.unwrap_err();
                if status.code() == Code::Unimplemented {
                    break;
                }
                assert_eq!(status.code(), Code::Unavailable, "{status}");
            }
        });
    }
    let all_in = async { while callers.join_next().await.transpose().unwrap().is_some() {} };
    tokio::time::timeout(Duration::from_secs(60), all_in)
        .await
        .expect("all get in");
    assert_eq!(
        links.len(),
        1000,
        "all connections were held until the last was in"
    );
}

// The clock jumps to the next deadline whenever nothing can be read or written.
#[tokio::test(start_paused = true)]
async fn silent_connections_are_closed_in_time() {
    let coordinator = Coordinator::start().await;
    let mut callers = JoinSet::new();
    // Callers that send nothing, half of the opening bytes, or half a handshake.
    for bytes in [&b""[..], b"PRI * HT", b"\x16\x03\x01\x02"] {
        let address = coordinator.port.address;
        callers.spawn(async move {
            let mut stream = TcpStream::connect(address).await.unwrap();
            stream.write_all(bytes).await.unwrap();
            // The last bytes do not matter, only that the connection ends.
            let mut rest = Vec::new();
            let limit = HANDSHAKE_LIMIT + Duration::from_secs(10);
            let ended = tokio::time::timeout(limit, stream.read_to_end(&mut rest)).await;
            assert!(ended.is_ok(), "{bytes:?} is still connected");
        });
    }
    while let Some(caller) = callers.join_next().await {
        caller.unwrap();
    }
}

#[tokio::test]
async fn without_a_token_a_connection_ends_when_its_place_is_lost() {
    for admitted in [false, true] {
        let (mut far, near) = tokio::io::duplex(64);
        let places = Places::new(1, 1);
        let newcomer = places.arrive();
        let probation = newcomer.probation();
        let peer = Peer::new("127.0.0.1:1".parse().unwrap(), newcomer);
        let mut connection = Connection::new(Box::new(near), peer.clone(), probation);
        let mut preface = [0; PREFACE.len()];
        connection.read_exact(&mut preface).await.unwrap();
        assert_eq!(&preface, PREFACE);
        if admitted {
            assert!(peer.admit());
        }
        let _next = places.arrive();
        far.write_all(b"x").await.unwrap();
        let read = connection.read_u8().await;
        assert_eq!(read.is_ok(), admitted, "{read:?}");
    }
}

#[tokio::test]
async fn silent_connections_delay_nobody() {
    let coordinator = Coordinator::start().await;
    let mut silent = Vec::new();
    for _ in 0..2000 {
        silent.push(TcpStream::connect(coordinator.port.address).await.unwrap());
    }
    let since = std::time::Instant::now();
    assert!(is_admitted(&coordinator.link()).await);
    // Well before the first of them is dropped for its silence.
    assert!(since.elapsed() < FIRST_BYTE, "{:?}", since.elapsed());
}

#[tokio::test]
async fn a_link_follows_a_coordinator_that_moved() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("c.access");
    let mut issuer = Issuer::new(&path, "c").unwrap();
    let first = Port::open(&issuer).await;
    let unreachable = "nowhere.invalid".to_owned();
    issuer.publish(first.address, &[unreachable]).unwrap();
    let link = link(&path, None);
    assert!(is_admitted(&link).await);
    // A second coordinator at another address and with other secrets.
    drop(first);
    issuer.remove();
    let mut issuer = Issuer::new(&path, "c").unwrap();
    let second = Port::open(&issuer).await;
    issuer.publish(second.address, &[]).unwrap();
    // The old connection may answer one last time.
    let address = second.address.to_string();
    for _ in 0..100 {
        if is_admitted(&link).await && link.address() == address {
            break;
        }
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    assert_eq!(link.address(), address);
    assert!(is_admitted(&link).await);
}

#[tokio::test]
async fn within_the_process_no_token_is_asked_for() {
    let (dial, local) = local();
    let stop = CancellationToken::new();
    let (_, health) = tonic_health::server::health_reporter();
    let listeners = Listeners { port: None, local };
    tokio::spawn(serve_services(Routes::new(health), listeners, stop.clone()));
    assert!(is_admitted(&Link::local(dial)).await);
    stop.cancel();
}
