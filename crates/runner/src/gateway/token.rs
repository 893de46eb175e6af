//! The tokens that protect a coordinator, and the role that each grants.
//!
//! A token is `pitchline-worker-` or `pitchline-client-` followed by 64 hexadecimal digits, that is
//! 256 random bits. A caller sends its token as `authorization: Bearer TOKEN`.

use std::fmt;

use serde::{Deserialize, Serialize};
use subtle::{Choice, ConstantTimeEq as _};
use tonic::metadata::{Ascii, MetadataValue};

/// Number of random bytes in a token.
pub(crate) const TOKEN_BYTES: usize = 32;

/// The header that carries a token.
pub(crate) const TOKEN_HEADER: &str = "authorization";

const SCHEME: &str = "Bearer ";

/// The role that a token grants.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Role {
    /// Workers, which lease jobs and report results.
    Worker,
    /// Clients, which query the status, drain and retry.
    Client,
}

impl Role {
    const ALL: [Self; 2] = [Self::Worker, Self::Client];

    const fn prefix(self) -> &'static str {
        match self {
            Self::Worker => "pitchline-worker-",
            Self::Client => "pitchline-client-",
        }
    }
}

impl fmt::Display for Role {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Worker => "worker",
            Self::Client => "client",
        })
    }
}

/// A secret. `Debug` prints only its role; [`Token::reveal`] returns its text.
#[derive(Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub(crate) struct Token {
    role: Role,
    text: String,
}

impl fmt::Debug for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Token({}, ..)", self.role)
    }
}

/// The error of a text that is not a token. It does not repeat the text.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("not a valid token")]
pub(crate) struct InvalidToken;

impl Token {
    pub(crate) fn new(role: Role, random: [u8; TOKEN_BYTES]) -> Self {
        let text = role.prefix().to_owned() + &hex::encode(random);
        Self { role, text }
    }

    /// The role that the token grants.
    pub(crate) const fn role(&self) -> Role {
        self.role
    }

    /// The text of the secret.
    #[cfg(test)]
    pub(crate) fn reveal(&self) -> &str {
        &self.text
    }

    /// The value of [`TOKEN_HEADER`], marked as sensitive so that it is neither printed nor
    /// compressed.
    pub(crate) fn header(&self) -> MetadataValue<Ascii> {
        let mut value: MetadataValue<Ascii> = format!("{SCHEME}{}", self.text)
            .parse()
            .expect("a token is letters, digits and hyphens");
        value.set_sensitive(true);
        value
    }
}

impl TryFrom<String> for Token {
    type Error = InvalidToken;

    fn try_from(text: String) -> Result<Self, InvalidToken> {
        let (role, digits) = Role::ALL
            .into_iter()
            .find_map(|role| Some((role, text.strip_prefix(role.prefix())?)))
            .ok_or(InvalidToken)?;
        let hexadecimal = |byte: u8| byte.is_ascii_digit() || (b'a'..=b'f').contains(&byte);
        if digits.len() == 2 * TOKEN_BYTES && digits.bytes().all(hexadecimal) {
            Ok(Self { role, text })
        } else {
            Err(InvalidToken)
        }
    }
}

impl From<Token> for String {
    fn from(token: Token) -> Self {
        token.text
    }
}

/// The tokens that a coordinator accepts; empty if it has no port.
#[derive(Debug, Clone, Default)]
pub(crate) struct TokenSet {
    tokens: Vec<Token>,
}

impl TokenSet {
    pub(crate) const fn new(tokens: Vec<Token>) -> Self {
        Self { tokens }
    }

    /// The role that the value of [`TOKEN_HEADER`] grants; `None` if it is not a token of this set.
    ///
    /// The time taken does not depend on how much of the value is right: it is compared with every
    /// token, and every byte of each.
    pub(crate) fn role_of(&self, header: &[u8]) -> Option<Role> {
        let presented = header.strip_prefix(SCHEME.as_bytes())?;
        let mut role = None;
        for token in &self.tokens {
            let equal: Choice = token.text.as_bytes().ct_eq(presented);
            if bool::from(equal) {
                role = Some(token.role);
            }
        }
        role
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set() -> TokenSet {
        TokenSet::new(vec![
            Token::new(Role::Worker, [7; TOKEN_BYTES]),
            Token::new(Role::Client, [8; TOKEN_BYTES]),
        ])
    }

    #[test]
    fn a_token_survives_its_text_and_its_header() {
        for role in Role::ALL {
            let random = std::array::from_fn(|index| index as u8);
            let token = Token::new(role, random);
            let read = Token::try_from(token.reveal().to_owned()).unwrap();
            assert_eq!(read, token);
            assert_eq!(read.role(), role);
            assert!(read.reveal().ends_with("1c1d1e1f"));
            assert_eq!(
                TokenSet::new(vec![read]).role_of(token.header().as_bytes()),
                Some(role)
            );
        }
    }

    #[test]
    fn other_texts_are_refused() {
        let digits = "0".repeat(2 * TOKEN_BYTES);
        for wrong in [
            String::new(),
            "pitchline-worker-abcd".to_owned(),
            format!("pitchline-admin-{digits}"),
            format!("pitchline-worker-{}g", &digits[1..]),
            format!("pitchline-worker-{digits}0"),
            format!("pitchline-worker-{digits} pitchline-worker-{digits}"),
        ] {
            assert_eq!(Token::try_from(wrong.clone()), Err(InvalidToken), "{wrong}");
        }
    }

    #[test]
    fn only_the_very_token_is_recognised() {
        let set = set();
        for token in &set.tokens {
            let good = format!("Bearer {}", token.reveal()).into_bytes();
            assert_eq!(set.role_of(&good), Some(token.role()));
            for index in 0..good.len() {
                let mut bad = good.clone();
                bad[index] ^= 1;
                assert_eq!(set.role_of(&bad), None, "byte {index} is not looked at");
                assert_eq!(set.role_of(&good[..index]), None, "a prefix is enough");
            }
            assert_eq!(set.role_of(&[&good[..], b" "].concat()), None);
        }
        assert_eq!(set.role_of(b"Bearer "), None);
        assert_eq!(TokenSet::default().role_of(b"Bearer "), None);
    }

    #[test]
    fn a_secret_is_not_printed() {
        let set = set();
        let printed = format!("{set:?} {:?} {:?}", set.tokens[0], set.tokens[0].header());
        assert!(!printed.contains("0707"), "{printed}");
        assert!(printed.contains("Token(worker, ..)"));
    }
}
