//! New secrets for a coordinator: a certificate with its key, and tokens.
//!
//! All random bits come from the operating system.

use std::time::{Duration, SystemTime};

use rcgen::{CertificateParams, DnType, ExtendedKeyUsagePurpose, KeyPair, date_time_ymd};
use rustls::crypto::ring;

use crate::gateway::error::Error;
use crate::gateway::tls::SERVER_NAME;
use crate::gateway::token::{Role, TOKEN_BYTES, Token};

/// Validity of a certificate: longer than any campaign runs.
const VALIDITY: Duration = Duration::from_secs(3650 * 24 * 3600);
/// Maximum time by which another machine's clock may be behind.
const CLOCK_DIFFERENCE: Duration = Duration::from_secs(3600);

/// A self-signed certificate that is valid from `now`, and its private key, both in PEM form.
pub(crate) fn certificate(now: SystemTime) -> Result<(String, String), Error> {
    let failed = |error: rcgen::Error| Error::Secrets {
        reason: error.to_string(),
    };
    let mut params = CertificateParams::new([SERVER_NAME.to_owned()]).map_err(failed)?;
    params
        .distinguished_name
        .push(DnType::CommonName, "Pitchline coordinator");
    params.extended_key_usages = vec![ExtendedKeyUsagePurpose::ServerAuth];
    // A clock before 1970 is wrong, and a certificate of that time is harmless.
    let since_1970 = now
        .duration_since(SystemTime::UNIX_EPOCH)
        .unwrap_or_default();
    let now = date_time_ymd(1970, 1, 1) + since_1970;
    params.not_before = now - CLOCK_DIFFERENCE;
    params.not_after = now + VALIDITY;
    let key = KeyPair::generate().map_err(failed)?;
    let certificate = params.self_signed(&key).map_err(failed)?;
    Ok((certificate.pem(), key.serialize_pem()))
}

pub(crate) fn token(role: Role) -> Result<Token, Error> {
    let mut random = [0; TOKEN_BYTES];
    ring::default_provider()
        .secure_random
        .fill(&mut random)
        .map_err(|_| Error::Secrets {
            reason: "the system gives no random numbers".to_owned(),
        })?;
    Ok(Token::new(role, random))
}
