//! The secrets that protect a coordinator: their text and the role that each grants.
//!
//! A token is `pitchline-worker-` or `pitchline-client-` followed by 64 hexadecimal digits, that is
//! 256 random bits. A token file holds one per line; blank lines and lines that begin with `#` are
//! ignored. A caller sends its token as `authorization: Bearer TOKEN`.

use std::fmt;

use subtle::{Choice, ConstantTimeEq as _};
use tonic::metadata::{Ascii, MetadataValue};

/// Number of random bytes in a token.
pub const TOKEN_BYTES: usize = 32;

/// The header that carries a token.
pub const TOKEN_HEADER: &str = "authorization";

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
#[derive(Clone)]
pub struct Token {
    role: Role,
    text: String,
}

impl fmt::Debug for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Token({}, ..)", self.role)
    }
}

/// The errors of a token file. They name lines, never their contents.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum TokenError {
    /// A line that is neither a token nor a comment.
    #[error("line {line} is no token")]
    Malformed {
        /// The line, from 1.
        line: usize,
    },
    /// There is no token.
    #[error("there is no token in it")]
    Empty,
}

impl Token {
    /// Makes a token from random bytes.
    #[must_use]
    pub fn new(role: Role, random: [u8; TOKEN_BYTES]) -> Self {
        let digits = random.iter().map(|byte| format!("{byte:02x}"));
        let text = role.prefix().to_owned() + &digits.collect::<String>();
        Self { role, text }
    }

    /// Parses a token file, in the order of its lines.
    ///
    /// # Errors
    ///
    /// A line is not a token, or the file holds none.
    pub fn parse_file(content: &str) -> Result<Vec<Self>, TokenError> {
        let mut tokens = Vec::new();
        for (index, line) in content.lines().enumerate() {
            let line = line.trim();
            if !line.is_empty() && !line.starts_with('#') {
                let malformed = TokenError::Malformed { line: index + 1 };
                tokens.push(Self::parse(line).ok_or(malformed)?);
            }
        }
        if tokens.is_empty() {
            return Err(TokenError::Empty);
        }
        Ok(tokens)
    }

    /// Parses a token; `None` if the text is not one.
    pub(crate) fn parse(text: &str) -> Option<Self> {
        let (role, digits) = Role::ALL
            .into_iter()
            .find_map(|role| Some((role, text.strip_prefix(role.prefix())?)))?;
        let hexadecimal = |byte: u8| byte.is_ascii_digit() || (b'a'..=b'f').contains(&byte);
        (digits.len() == 2 * TOKEN_BYTES && digits.bytes().all(hexadecimal)).then(|| Self {
            role,
            text: text.to_owned(),
        })
    }

    /// The role that the token grants.
    #[must_use]
    pub const fn role(&self) -> Role {
        self.role
    }

    /// The text of the secret, to be written to its file.
    #[must_use]
    pub fn reveal(&self) -> &str {
        &self.text
    }

    /// The value of [`TOKEN_HEADER`], marked as sensitive so that it is neither printed nor
    /// compressed.
    #[must_use]
    pub fn header(&self) -> MetadataValue<Ascii> {
        let mut value: MetadataValue<Ascii> = format!("{SCHEME}{}", self.text)
            .parse()
            .expect("a token is letters, digits and hyphens");
        value.set_sensitive(true);
        value
    }
}

/// The tokens that a coordinator accepts. A role may have several, so that a token can be replaced
/// while the old one is in use.
#[derive(Debug, Clone)]
pub struct TokenSet {
    tokens: Vec<Token>,
}

impl TokenSet {
    /// Makes a set of these tokens.
    #[must_use]
    pub const fn new(tokens: Vec<Token>) -> Self {
        Self { tokens }
    }

    /// Whether a token grants this role.
    #[must_use]
    pub fn has(&self, role: Role) -> bool {
        self.tokens.iter().any(|token| token.role == role)
    }

    /// The role that the value of [`TOKEN_HEADER`] grants; `None` if it is not a token of this set.
    ///
    /// The time taken does not depend on how much of the value is right: it is compared with every
    /// token, and every byte of each.
    #[must_use]
    pub fn role_of(&self, header: &[u8]) -> Option<Role> {
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
    fn a_token_survives_its_file_and_its_header() {
        for role in Role::ALL {
            let random = std::array::from_fn(|index| index as u8);
            let token = Token::new(role, random);
            let file = format!("# keep secret\n\n  {}  \n", token.reveal());
            let read = Token::parse_file(&file).unwrap();
            assert_eq!(read.len(), 1);
            assert_eq!(read[0].role(), role);
            assert_eq!(read[0].reveal(), token.reveal());
            assert!(token.reveal().ends_with("1c1d1e1f"));
            assert_eq!(
                TokenSet::new(read).role_of(token.header().as_bytes()),
                Some(role)
            );
        }
    }

    #[test]
    fn what_is_no_token_is_refused_by_its_line_and_not_repeated() {
        let short = "pitchline-worker-abcd";
        let error = Token::parse_file(&format!("# a comment\n{short}\n")).unwrap_err();
        assert_eq!(error, TokenError::Malformed { line: 2 });
        assert!(!error.to_string().contains("abcd"));
        let digits = "0".repeat(2 * TOKEN_BYTES);
        for wrong in [
            format!("pitchline-admin-{digits}"),
            format!("pitchline-worker-{}g", &digits[1..]),
            format!("pitchline-worker-{digits}0"),
            format!("pitchline-worker-{digits} pitchline-worker-{digits}"),
        ] {
            let refused = Token::parse_file(&wrong).unwrap_err();
            assert_eq!(refused, TokenError::Malformed { line: 1 }, "{wrong}");
        }
        for empty in ["", "\n", "# nothing\n"] {
            assert_eq!(Token::parse_file(empty).unwrap_err(), TokenError::Empty);
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
        assert_eq!(TokenSet::new(Vec::new()).role_of(b"Bearer "), None);
    }

    #[test]
    fn a_secret_is_not_printed() {
        let set = set();
        let printed = format!("{set:?} {:?} {:?}", set.tokens[0], set.tokens[0].header());
        assert!(!printed.contains("0707"), "{printed}");
        assert!(printed.contains("Token(worker, ..)"));
    }
}
