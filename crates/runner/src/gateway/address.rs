//! Addresses of coordinators.

use std::fmt;
use std::net::{IpAddr, Ipv6Addr};
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// A host and a port, written `HOST:PORT`, with an IPv6 address in brackets.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Address {
    /// The host's name or IP address, without brackets.
    pub host: String,
    pub port: u16,
}

/// The error of a text that is not an address.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum AddressError {
    #[error("{text:?} is not a coordinator address: give HOST:PORT, such as 127.0.0.1:7400")]
    Address { text: String },
    #[error(
        "{text:?} is not a host: give a name or address, such as head.example.org or 192.0.2.7"
    )]
    Host { text: String },
}

impl FromStr for Address {
    type Err = AddressError;

    fn from_str(text: &str) -> Result<Self, AddressError> {
        let parse = || {
            let (host, port) = text.rsplit_once(':')?;
            let host = match host.strip_prefix('[') {
                Some(rest) => {
                    let address: Ipv6Addr = rest.strip_suffix(']')?.parse().ok()?;
                    address.to_string()
                }
                None if host.contains(':') => return None,
                None => self::host(host).ok()?,
            };
            let port = port.parse().ok().filter(|port| *port > 0)?;
            Some(Self { host, port })
        };
        parse().ok_or_else(|| AddressError::Address {
            text: text.to_owned(),
        })
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.host.contains(':') {
            write!(f, "[{}]:{}", self.host, self.port)
        } else {
            write!(f, "{}:{}", self.host, self.port)
        }
    }
}

impl TryFrom<String> for Address {
    type Error = AddressError;

    fn try_from(text: String) -> Result<Self, AddressError> {
        text.parse()
    }
}

impl From<Address> for String {
    fn from(address: Address) -> Self {
        address.to_string()
    }
}

/// Parses a host: an IP address, or letters, digits, hyphens and underscores between dots. RFC 1123
/// has no underscores, but names of containers do. An IPv6 address may have brackets.
pub fn host(text: &str) -> Result<String, AddressError> {
    let label = |label: &str| {
        (1..=63).contains(&label.len())
            && label
                .bytes()
                .all(|byte| byte.is_ascii_alphanumeric() || b"-_".contains(&byte))
            && !label.starts_with('-')
            && !label.ends_with('-')
    };
    let bare = text
        .strip_prefix('[')
        .and_then(|rest| rest.strip_suffix(']'));
    if let Some(address) = bare.and_then(|bare| bare.parse::<Ipv6Addr>().ok()) {
        return Ok(address.to_string());
    }
    if text.parse::<IpAddr>().is_ok() || (text.len() <= 253 && text.split('.').all(label)) {
        return Ok(text.to_owned());
    }
    Err(AddressError::Host {
        text: text.to_owned(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_is_written_as_it_is_read() {
        for text in [
            "head:7400",
            "192.0.2.7:1",
            "[2001:db8::1]:7400",
            "a-b.c_d:65535",
        ] {
            let address: Address = text.parse().unwrap();
            assert_eq!(address.to_string(), text);
        }
        for text in [
            "",
            "head",
            "head:",
            ":7400",
            "head:0",
            "head:65536",
            "2001:db8::1",
            "[head]:7400",
            "https://head:7400",
            "head:7400/",
            "over there:7400",
        ] {
            let error = text.parse::<Address>().unwrap_err().to_string();
            assert!(error.starts_with(&format!("{text:?} ")), "{error}");
        }
    }

    #[test]
    fn a_host_is_a_name_or_an_ip_address() {
        for good in [
            "head",
            "head.example.org",
            "192.0.2.7",
            "2001:db8::1",
            "n-1",
        ] {
            assert_eq!(host(good).as_deref(), Ok(good));
        }
        assert_eq!(host("[2001:db8::1]").as_deref(), Ok("2001:db8::1"));
        for bad in [
            "",
            "a b",
            "-a",
            "a-",
            "a..b",
            "https://head",
            "head:7400",
            "[head]",
            "*.x",
        ] {
            assert!(host(bad).is_err(), "{bad}");
        }
    }
}
