//! Tests of the port through real connections.

use std::net::SocketAddr;
use std::time::SystemTime;

use protocol::Refusal;
use protocol::v1::StatusRequest;
use tonic::Code;

use super::*;
use crate::access::Held;
use crate::client::Reach;
use crate::files::Credentials;
use crate::guard::GuardFiles;
use crate::guard::tests::Keys;
use crate::link::connect;
use crate::{Error, Link, Role, TlsFault};

fn credentials(keys: &Keys, token: Option<&str>, certificate: bool) -> Credentials {
    Credentials {
        token_file: token.map(|name| keys.path(name)),
        tls_ca: Some(keys.path("ca.pem")),
        tls_cert: certificate.then(|| keys.path("client.pem")),
        tls_key: certificate.then(|| keys.path("client.key")),
    }
}

/// A port with only the health service: campaign calls that get through end as unimplemented.
struct Port {
    address: SocketAddr,
    stop: CancellationToken,
}

impl Port {
    async fn open(guard: Guard) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let stop = CancellationToken::new();
        let (_, health) = tonic_health::server::health_reporter();
        let doors = Doors {
            port: Some((listener, guard)),
            local: local().1,
        };
        tokio::spawn(serve_services(Routes::new(health), doors, stop.clone()));
        Self { address, stop }
    }

    fn link(&self, scheme: &str, credentials: &Credentials, role: Role) -> Link {
        let url = format!("{scheme}://{}", self.address);
        connect(Dial::default(), &url, credentials, role).unwrap()
    }

    /// Whether calls with the token of `role` get through.
    async fn admits(&self, scheme: &str, credentials: &Credentials, role: Role) -> bool {
        let link = self.link(scheme, credentials, role);
        status(&link).await.code() == Code::Unimplemented
    }
}

impl Drop for Port {
    fn drop(&mut self) {
        self.stop.cancel();
    }
}

/// The status with which a `Status` call ends.
async fn status(link: &Link) -> tonic::Status {
    let mut client = link.client();
    let call = tokio::time::timeout(Duration::from_secs(20), client.status(StatusRequest {}));
    call.await.expect("an answer in time").unwrap_err()
}

/// The TLS fault that a call meets.
async fn fault(port: &Port, credentials: &Credentials) -> TlsFault {
    let link = port.link("https", credentials, Role::Client);
    let status = status(&link).await;
    match link.refusal(&status) {
        Some(Error::Tls { fault, .. }) => fault,
        other => panic!("{other:?} for {status:?}"),
    }
}

#[tokio::test]
async fn tokens_and_certificates_open_the_port() {
    let keys = Keys::new();
    for client_ca in [false, true] {
        let port = Port::open(keys.guard(client_ca)).await;
        let client = credentials(&keys, Some("client.token"), client_ca);
        assert!(port.admits("https", &client, Role::Client).await);
        // A client on the same machine can also use the coordinator's own token file.
        let both = credentials(&keys, Some("coordinator.tokens"), client_ca);
        assert!(port.admits("https", &both, Role::Client).await);

        let worker = credentials(&keys, Some("worker.token"), client_ca);
        let link = port.link("https", &worker, Role::Client);
        let refused = status(&link).await;
        assert_eq!(refused.code(), Code::PermissionDenied);
        assert_eq!(Refusal::of(&refused), Some(Refusal::Forbidden));

        let nobody = credentials(&keys, None, client_ca);
        let refused = status(&port.link("https", &nobody, Role::Client)).await;
        assert_eq!(refused.code(), Code::Unauthenticated);
        assert_eq!(Refusal::of(&refused), Some(Refusal::Unknown));
    }
    let port = Port::open(Guard::open()).await;
    assert!(
        port.admits("http", &Credentials::default(), Role::Client)
            .await
    );
}

#[tokio::test]
async fn certificates_that_do_not_fit_are_told_apart() {
    let keys = Keys::new();
    let others = Keys::new();
    let client = credentials(&keys, Some("client.token"), false);
    let port = Port::open(keys.guard(false)).await;
    let astray = Credentials {
        tls_ca: Some(others.path("ca.pem")),
        ..client.clone()
    };
    assert_eq!(fault(&port, &astray).await, TlsFault::Untrusted);
    // An address that is not in the certificate, although it leads to the same port.
    let url = format!("https://127.0.0.2:{}", port.address.port());
    let dial = Dial::new(move |_, port| tokio::net::TcpStream::connect(("127.0.0.1", port)));
    let link = connect(dial, &url, &client, Role::Client).unwrap();
    let status = status(&link).await;
    assert!(matches!(
        link.refusal(&status),
        Some(Error::Tls {
            fault: TlsFault::OtherName,
            ..
        })
    ));

    let day = Duration::from_secs(24 * 3600);
    let old = Keys::made(1, SystemTime::now() - 3 * day);
    let port = Port::open(old.guard(false)).await;
    let client = credentials(&old, Some("client.token"), false);
    assert_eq!(fault(&port, &client).await, TlsFault::Expired);
    let early = Keys::made(1, SystemTime::now() + 3 * day);
    let port = Port::open(early.guard(false)).await;
    let client = credentials(&early, Some("client.token"), false);
    assert_eq!(fault(&port, &client).await, TlsFault::NotYetValid);
}

#[tokio::test]
async fn a_client_without_a_certificate_of_the_authority_is_told_so() {
    let keys = Keys::new();
    let others = Keys::new();
    let port = Port::open(keys.guard(true)).await;
    let none = credentials(&keys, Some("client.token"), false);
    assert_eq!(fault(&port, &none).await, TlsFault::WantsCertificate);
    for (certificate, key) in [
        (others.path("client.pem"), others.path("client.key")),
        // A client must not use the coordinator's certificate.
        (keys.path("server.pem"), keys.path("server.key")),
    ] {
        let wrong = Credentials {
            tls_cert: Some(certificate),
            tls_key: Some(key),
            ..none.clone()
        };
        let fault = fault(&port, &wrong).await;
        assert!(
            matches!(fault, TlsFault::RefusesCertificate(_)),
            "{fault:?}"
        );
    }
    // A coordinator must not use a client's certificate.
    let impostor = Guard::load(&GuardFiles {
        token_file: Some(keys.path("coordinator.tokens")),
        tls_cert: Some(keys.path("client.pem")),
        tls_key: Some(keys.path("client.key")),
        client_ca: None,
    });
    let port = Port::open(impostor.unwrap().unwrap()).await;
    let fault = fault(&port, &none).await;
    assert!(matches!(fault, TlsFault::Unusable(_)), "{fault:?}");
}

#[tokio::test]
async fn open_and_encrypted_do_not_meet() {
    let keys = Keys::new();
    let port = Port::open(keys.guard(false)).await;
    let open = Credentials {
        tls_ca: None,
        ..credentials(&keys, Some("client.token"), false)
    };
    let refused = status(&port.link("http", &open, Role::Client)).await;
    assert_eq!(Refusal::of(&refused), Some(Refusal::NotEncrypted));
    assert!(refused.message().contains("https://"), "{refused}");
    let port = Port::open(Guard::open()).await;
    let client = credentials(&keys, Some("client.token"), false);
    assert_eq!(fault(&port, &client).await, TlsFault::NoTls);
}

#[tokio::test]
async fn other_protocols_get_a_sentence_and_rubbish_is_dropped() {
    let keys = Keys::new();
    for guard in [Guard::open(), keys.guard(false)] {
        let port = Port::open(guard).await;
        let mut answers = Vec::new();
        for bytes in [
            &b"GET / HTTP/1.1\r\n\r\n"[..],
            b"\0\xff\0\xff",
            b"PRI * HTTP/3.0",
        ] {
            let mut stream = TcpStream::connect(port.address).await.unwrap();
            stream.write_all(bytes).await.unwrap();
            let mut answer = String::new();
            tokio::time::timeout(Duration::from_secs(5), stream.read_to_string(&mut answer))
                .await
                .expect("the connection is closed")
                .unwrap();
            answers.push(answer);
        }
        for answer in answers {
            assert!(answer.starts_with("HTTP/1.1 400 "), "{answer}");
            assert!(answer.contains("gRPC"), "{answer}");
        }
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_thousand_callers_with_certificates_get_in_at_once() {
    let keys = Keys::new();
    let port = Port::open(keys.guard(true)).await;
    let client = credentials(&keys, Some("client.token"), true);
    let mut callers = JoinSet::new();
    let mut links = Vec::new();
    for _ in 0..1000 {
        let link = port.link("https", &client, Role::Client);
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
async fn who_says_nothing_is_dropped_in_time() {
    let keys = Keys::new();
    let open = Port::open(Guard::open()).await;
    let encrypted = Port::open(keys.guard(false)).await;
    let mut callers = JoinSet::new();
    // Callers that send nothing, half of the opening bytes, or half a handshake.
    for (port, bytes) in [
        (&open, &b""[..]),
        (&open, b"PRI * HT"),
        (&encrypted, b""),
        (&encrypted, b"PRI * HT"),
        (&encrypted, b"\x16\x03\x01\x02"),
    ] {
        let address = port.address;
        callers.spawn(async move {
            let mut stream = TcpStream::connect(address).await.unwrap();
            stream.write_all(bytes).await.unwrap();
            // The last bytes do not matter, only that the connection ends.
            let mut rest = Vec::new();
            let limit = GREETING + Duration::from_secs(10);
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
        let peer = Peer::new("127.0.0.1:1".parse().unwrap(), false, newcomer);
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
    let keys = Keys::new();
    let port = Port::open(keys.guard(false)).await;
    let mut silent = Vec::new();
    for _ in 0..2000 {
        silent.push(TcpStream::connect(port.address).await.unwrap());
    }
    let client = credentials(&keys, Some("client.token"), false);
    let since = std::time::Instant::now();
    assert!(port.admits("https", &client, Role::Client).await);
    // Well before the first of them is dropped for its silence.
    assert!(since.elapsed() < FIRST_BYTE, "{:?}", since.elapsed());
}

#[tokio::test]
async fn an_access_file_is_all_it_takes_and_leads_to_a_coordinator_that_moved() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("c.access");
    let mut held = Held::take(&path, "c").unwrap();
    let first = Port::open(held.guard().unwrap()).await;
    held.publish(first.address, &["nowhere.invalid".to_owned()])
        .unwrap();
    let reach = Reach {
        access: Some(path.clone()),
        ..Reach::default()
    };
    let link = reach.link(Role::Client).unwrap();
    assert_eq!(status(&link).await.code(), Code::Unimplemented);
    // A second coordinator at another address and with other secrets.
    drop(first);
    held.remove();
    let mut held = Held::take(&path, "c").unwrap();
    let second = Port::open(held.guard().unwrap()).await;
    held.publish(second.address, &[]).unwrap();
    // The old connection may answer one last time.
    let second_port = second.address.port().to_string();
    for _ in 0..100 {
        let answer = status(&link).await;
        if link.url().ends_with(&second_port) && answer.code() == Code::Unimplemented {
            break;
        }
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    assert!(link.url().ends_with(&second_port), "{}", link.url());
    assert_eq!(status(&link).await.code(), Code::Unimplemented);

    // The right address with another coordinator's file.
    let others = folder.path().join("d.access");
    let mut other = Held::take(&others, "d").unwrap();
    other.publish(second.address, &[]).unwrap();
    let reach = Reach {
        access: Some(others),
        ..Reach::default()
    };
    let link = reach.link(Role::Client).unwrap();
    let refused = status(&link).await;
    // A file that is being replaced looks the same, so the first failure is not final.
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

#[tokio::test]
async fn within_the_process_no_token_is_asked_for() {
    let (dial, door) = local();
    let stop = CancellationToken::new();
    let (_, health) = tonic_health::server::health_reporter();
    let doors = Doors {
        port: None,
        local: door,
    };
    tokio::spawn(serve_services(Routes::new(health), doors, stop.clone()));
    let none = Credentials::default();
    let link = connect(dial, "http://in-process", &none, Role::Client).unwrap();
    assert_eq!(status(&link).await.code(), Code::Unimplemented);
    stop.cancel();
}
