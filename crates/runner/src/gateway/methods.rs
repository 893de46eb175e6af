//! Permissions of the methods.
//!
//! [`RULES`] lists every method of every service on the port, with the token it requires and the
//! maximum size of its request. Methods that are not listed are refused. The layer decides from a
//! call's headers, before it reads any of the body.

use std::fmt;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};

use crate::protocol::{MAX_MESSAGE_BYTES, Refusal};
use http_body_util::{BodyExt as _, Limited};
use tonic::Status;
use tonic::body::Body;
use tonic::codegen::http::{Request, Response};
use tower::{Layer, Service};
use tracing::warn;

use crate::gateway::admission::Peer;
use crate::gateway::log_limit::LogLimit;
use crate::gateway::token::{Role, TOKEN_HEADER, TokenSet};

/// The token that a caller must show.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum RequiredToken {
    /// No token.
    Nothing,
    /// A token of either role.
    AnyToken,
    /// A token of this role.
    Token(Role),
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct Rule {
    /// `/package.Service/Method`.
    pub(crate) path: &'static str,
    /// The token that a caller must show.
    pub(crate) needs: RequiredToken,
    /// Maximum size of a request in bytes. For a stream of requests, the limit applies to their
    /// total.
    pub(crate) limit: usize,
}

/// A request of numbers and names.
const SMALL: usize = 64 * 1024;
/// A request that lists jobs: 4 MiB name 300 000 of them.
const LIST: usize = 4 * 1024 * 1024;
/// A request that carries jobs or results, framed.
const LARGE: usize = MAX_MESSAGE_BYTES + 5;

const fn rule(path: &'static str, needs: RequiredToken, limit: usize) -> Rule {
    Rule { path, needs, limit }
}

/// The rules of all methods.
pub(crate) const RULES: [Rule; 13] = {
    use RequiredToken::{AnyToken, Nothing, Token};
    use Role::{Client, Worker};
    [
        rule("/pitchline.v1.Campaign/Register", Token(Worker), LARGE),
        rule("/pitchline.v1.Campaign/Lease", Token(Worker), SMALL),
        rule("/pitchline.v1.Campaign/Report", Token(Worker), LARGE),
        rule("/pitchline.v1.Campaign/Heartbeat", Token(Worker), LIST),
        rule("/pitchline.v1.Campaign/Release", Token(Worker), LIST),
        rule("/pitchline.v1.Campaign/Status", Token(Client), SMALL),
        rule("/pitchline.v1.Campaign/Watch", Token(Client), SMALL),
        rule("/pitchline.v1.Campaign/Explain", Token(Client), SMALL),
        rule("/pitchline.v1.Campaign/Drain", Token(Client), SMALL),
        rule("/pitchline.v1.Campaign/Retry", Token(Client), SMALL),
        // Health probes carry no secrets, and the answer reveals nothing about the campaign.
        rule("/grpc.health.v1.Health/Check", Nothing, SMALL),
        rule("/grpc.health.v1.Health/Watch", Nothing, SMALL),
        rule(
            "/grpc.reflection.v1.ServerReflection/ServerReflectionInfo",
            AnyToken,
            LIST,
        ),
    ]
};

/// Decides whether one call is allowed and returns the method's rule.
///
/// `header` is the value of [`TOKEN_HEADER`]. `tokens` is none for a caller within this process, which
/// may call every method.
///
/// # Errors
///
/// The refusal to send as the answer.
pub(crate) fn decide(
    path: &str,
    header: Option<&[u8]>,
    tokens: Option<&TokenSet>,
) -> Result<&'static Rule, Status> {
    let Some(rule) = RULES.iter().find(|rule| rule.path == path) else {
        return Err(Status::permission_denied(
            "this coordinator has no such call",
        ));
    };
    let Some(tokens) = tokens else {
        return Ok(rule);
    };
    let wanted = match rule.needs {
        RequiredToken::Nothing => return Ok(rule),
        RequiredToken::AnyToken => None,
        RequiredToken::Token(role) => Some(role),
    };
    let Some(header) = header else {
        return Err(Refusal::Unknown
            .status("a token is needed: give this coordinator's access file with --access"));
    };
    let Some(role) = tokens.role_of(header) else {
        return Err(Refusal::Unknown.status(
            "the token is not one of this coordinator's: take the access file that belongs to it",
        ));
    };
    match wanted {
        Some(wanted) if wanted != role => {
            let method = path.rsplit('/').next().unwrap_or(path);
            Err(Refusal::Forbidden.status(format!(
                "this is a {role}'s token, and {method} takes a {wanted}'s"
            )))
        }
        _ => Ok(rule),
    }
}

/// A layer that applies [`decide`] to all services.
#[derive(Clone)]
pub(crate) struct PermissionLayer {
    tokens: Arc<TokenSet>,
    refusals: Arc<LogLimit>,
}

impl fmt::Debug for PermissionLayer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("PermissionLayer")
            .field("tokens", &self.tokens)
            .finish_non_exhaustive()
    }
}

impl PermissionLayer {
    /// Admits callers within this process and those with one of these tokens.
    pub(crate) fn new(tokens: TokenSet) -> Self {
        Self {
            tokens: Arc::new(tokens),
            refusals: Arc::new(LogLimit::default()),
        }
    }
}

impl<S> Layer<S> for PermissionLayer {
    type Service = PermissionService<S>;

    fn layer(&self, inner: S) -> PermissionService<S> {
        PermissionService {
            inner,
            layer: self.clone(),
        }
    }
}

/// A service behind a [`PermissionLayer`].
#[derive(Debug, Clone)]
pub(crate) struct PermissionService<S> {
    inner: S,
    layer: PermissionLayer,
}

impl<S> PermissionService<S> {
    fn admit(&self, request: &Request<Body>) -> Result<&'static Rule, Status> {
        let peer = request.extensions().get::<Peer>();
        let header = request.headers().get(TOKEN_HEADER);
        let is_local = peer.is_some_and(Peer::is_local);
        let tokens = (!is_local).then_some(&*self.layer.tokens);
        let rule = decide(
            request.uri().path(),
            header.map(|value| value.as_bytes()),
            tokens,
        )?;
        if let Some(peer) = peer
            && rule.needs != RequiredToken::Nothing
            && !peer.admit()
        {
            return Err(Status::resource_exhausted(
                "the coordinator has as many connections as it can hold",
            ));
        }
        Ok(rule)
    }
}

impl<S> Service<Request<Body>> for PermissionService<S>
where
    S: Service<Request<Body>, Response = Response<Body>>,
    S::Future: Send + 'static,
{
    type Response = Response<Body>;
    type Error = S::Error;
    type Future = Pin<Box<dyn Future<Output = Result<Self::Response, Self::Error>> + Send>>;

    fn poll_ready(&mut self, cx: &mut Context<'_>) -> Poll<Result<(), Self::Error>> {
        self.inner.poll_ready(cx)
    }

    fn call(&mut self, request: Request<Body>) -> Self::Future {
        match self.admit(&request) {
            Ok(rule) => {
                let limit = rule.limit;
                let request = request.map(|body| {
                    Body::new(Limited::new(body, limit).map_err(move |error| {
                        if error.is::<http_body_util::LengthLimitError>() {
                            Status::resource_exhausted(format!(
                                "the request is larger than {limit} bytes"
                            ))
                        } else {
                            Status::from_error(error)
                        }
                    }))
                });
                Box::pin(self.inner.call(request))
            }
            Err(status) => {
                if let Some(more) = self.layer.refusals.permit() {
                    let peer = request.extensions().get::<Peer>();
                    let peer = peer
                        .and_then(|peer| peer.address)
                        .map(tracing::field::display);
                    warn!(peer, path = %request.uri().path(), reason = status.message(), more,
                        "refused a call");
                }
                Box::pin(async move { Ok(status.into_http()) })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use prost::Message as _;
    use tonic::Code;

    use super::*;
    use crate::gateway::token::{TOKEN_BYTES, Token};

    fn tokens() -> TokenSet {
        TokenSet::new(vec![
            Token::new(Role::Worker, [1; TOKEN_BYTES]),
            Token::new(Role::Client, [2; TOKEN_BYTES]),
        ])
    }

    fn bearer(role: Role) -> Vec<u8> {
        let byte = if role == Role::Worker { 1 } else { 2 };
        Token::new(role, [byte; TOKEN_BYTES])
            .header()
            .as_bytes()
            .to_vec()
    }

    /// The paths of the methods in encoded descriptors.
    fn methods(descriptors: &[u8]) -> Vec<String> {
        let set = prost_types::FileDescriptorSet::decode(descriptors).unwrap();
        let mut paths = Vec::new();
        for file in &set.file {
            for service in &file.service {
                for method in &service.method {
                    paths.push(format!(
                        "/{}.{}/{}",
                        file.package(),
                        service.name(),
                        method.name()
                    ));
                }
            }
        }
        paths
    }

    #[test]
    fn every_method_has_its_rule() {
        let mut paths = methods(crate::protocol::DESCRIPTORS);
        assert!(paths.len() >= 6);
        paths.extend(methods(tonic_health::pb::FILE_DESCRIPTOR_SET));
        paths.extend(methods(tonic_reflection::pb::v1::FILE_DESCRIPTOR_SET));
        for path in &paths {
            let rules = RULES.iter().filter(|rule| rule.path == path).count();
            assert_eq!(rules, 1, "{path} has no rule, so nobody can call it");
        }
        for rule in &RULES {
            assert!(
                paths.iter().any(|path| path == rule.path),
                "{} is no method",
                rule.path
            );
        }
    }

    #[test]
    fn each_role_has_its_own_calls() {
        let tokens = tokens();
        for rule in &RULES {
            let code = |header: Option<&[u8]>| {
                decide(rule.path, header, Some(&tokens))
                    .map_or_else(|status| status.code(), |_| Code::Ok)
            };
            let of = |role| code(Some(&bearer(role)));
            let (none, worker, client) = match rule.needs {
                RequiredToken::Nothing => (Code::Ok, Code::Ok, Code::Ok),
                RequiredToken::AnyToken => (Code::Unauthenticated, Code::Ok, Code::Ok),
                RequiredToken::Token(Role::Worker) => {
                    (Code::Unauthenticated, Code::Ok, Code::PermissionDenied)
                }
                RequiredToken::Token(Role::Client) => {
                    (Code::Unauthenticated, Code::PermissionDenied, Code::Ok)
                }
            };
            assert_eq!(code(None), none, "{}", rule.path);
            assert_eq!(of(Role::Worker), worker, "{}", rule.path);
            assert_eq!(of(Role::Client), client, "{}", rule.path);
            let strange = Token::new(Role::Worker, [9; TOKEN_BYTES]);
            assert_eq!(
                code(Some(strange.header().as_bytes())),
                none,
                "{}",
                rule.path
            );
            assert_eq!(code(Some(b"Basic cGl0Y2g=")), none, "{}", rule.path);
            assert!(decide(rule.path, None, None).is_ok(), "{}", rule.path);
        }
    }

    #[test]
    fn workers_call_what_workers_do_and_clients_the_rest() {
        let role = |method: &str| {
            let path = format!("/pitchline.v1.Campaign/{method}");
            RULES.iter().find(|rule| rule.path == path).unwrap().needs
        };
        for method in ["Register", "Lease", "Report", "Heartbeat", "Release"] {
            assert_eq!(role(method), RequiredToken::Token(Role::Worker), "{method}");
        }
        for method in ["Status", "Watch", "Explain", "Drain", "Retry"] {
            assert_eq!(role(method), RequiredToken::Token(Role::Client), "{method}");
        }
    }

    /// A service that answers after reading the whole request.
    #[derive(Clone)]
    struct Reader;

    impl Service<Request<Body>> for Reader {
        type Response = Response<Body>;
        type Error = std::convert::Infallible;
        type Future = Pin<Box<dyn Future<Output = Result<Response<Body>, Self::Error>> + Send>>;

        fn poll_ready(&mut self, _: &mut Context<'_>) -> Poll<Result<(), Self::Error>> {
            Poll::Ready(Ok(()))
        }

        fn call(&mut self, request: Request<Body>) -> Self::Future {
            Box::pin(async move {
                Ok(match request.into_body().collect().await {
                    Ok(_) => Response::new(Body::empty()),
                    Err(status) => status.into_http(),
                })
            })
        }
    }

    #[tokio::test]
    async fn a_request_that_is_too_large_for_its_call_is_cut_off() {
        let mut service = PermissionLayer::new(TokenSet::default()).layer(Reader);
        let mut call = |method: &str, bytes: usize| {
            let body = http_body_util::Full::new(vec![0; bytes].into());
            let request = Request::post(format!("/pitchline.v1.Campaign/{method}"))
                .extension(Peer::local())
                .body(Body::new(body))
                .unwrap();
            service.call(request)
        };
        for (method, bytes, code) in [
            ("Lease", SMALL, None),
            ("Lease", SMALL + 1, Some("8")),
            ("Heartbeat", LIST, None),
            ("Heartbeat", LIST + 1, Some("8")),
            ("Report", LIST + 1, None),
        ] {
            let response = call(method, bytes).await.unwrap();
            let status = response.headers().get("grpc-status");
            let status = status.map(|value| value.to_str().unwrap());
            // 8 is RESOURCE_EXHAUSTED.
            assert_eq!(status, code, "{method} with {bytes} bytes");
        }
    }

    #[test]
    fn what_is_not_listed_is_refused_to_everybody() {
        let tokens = tokens();
        for path in [
            "/pitchline.v1.Campaign/Erase",
            "/",
            "",
            "/pitchline.v1.Campaign/lease",
        ] {
            for tokens in [None, Some(&tokens)] {
                let header = bearer(Role::Client);
                let status = decide(path, Some(&header), tokens).unwrap_err();
                assert_eq!(status.code(), Code::PermissionDenied, "{path}");
            }
        }
    }

    #[test]
    fn a_refusal_names_roles_and_no_secret() {
        let header = bearer(Role::Client);
        let status = decide(RULES[1].path, Some(&header), Some(&tokens())).unwrap_err();
        assert_eq!(
            status.message(),
            "this is a client's token, and Lease takes a worker's"
        );
        let layer = format!("{:?} {status:?}", PermissionLayer::new(tokens()));
        for secret in ["0101", "0202"] {
            assert!(!layer.contains(secret), "{layer}");
        }
    }
}
