//! A minimal client of the live page.

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::{SocketAddr, TcpStream};
use std::time::Duration;

use serde_json::Value;

/// The header that a browser on the same machine sends.
pub const LOCALHOST: &[(&str, &str)] = &[("host", "localhost")];

/// The views of the page at `/api/v1/`.
pub const VIEWS: [&str; 7] = [
    "status",
    "workers",
    "failures",
    "best",
    "responses",
    "convergence",
    "rounds",
];

/// An answer of the page.
#[derive(Debug, Clone)]
pub struct Answer {
    /// The status code.
    pub code: u16,
    /// The headers, with names in lower case.
    pub headers: Vec<(String, String)>,
    /// The body.
    pub body: String,
}

impl Answer {
    /// A header's value.
    #[must_use]
    pub fn header(&self, name: &str) -> Option<&str> {
        let mut named = self.headers.iter().filter(|(held, _)| held == name);
        named.next().map(|(_, value)| value.as_str())
    }

    /// The body as JSON, or null if it is not JSON.
    #[must_use]
    pub fn json(&self) -> Value {
        serde_json::from_str(&self.body).unwrap_or_default()
    }
}

/// Requests a path with these headers, which must include `host`.
///
/// # Errors
///
/// No answer arrives in time.
pub fn get(
    address: SocketAddr,
    headers: &[(&str, &str)],
    path: &str,
    patience: Duration,
) -> std::io::Result<Answer> {
    let mut reader = ask(address, headers, path, patience)?;
    let (code, headers) = head(&mut reader)?;
    let mut body = String::new();
    reader.read_to_string(&mut body)?;
    Ok(Answer {
        code,
        headers,
        body,
    })
}

/// Sends the request in HTTP/1.0, where the body is in one piece and ends with the connection.
fn ask(
    address: SocketAddr,
    headers: &[(&str, &str)],
    path: &str,
    patience: Duration,
) -> std::io::Result<BufReader<TcpStream>> {
    let mut stream = TcpStream::connect_timeout(&address, patience)?;
    stream.set_read_timeout(Some(patience))?;
    let headers = headers
        .iter()
        .map(|(name, value)| format!("{name}: {value}\r\n"));
    let headers: String = headers.collect();
    write!(stream, "GET {path} HTTP/1.0\r\n{headers}\r\n")?;
    Ok(BufReader::new(stream))
}

fn head(reader: &mut BufReader<TcpStream>) -> std::io::Result<(u16, Vec<(String, String)>)> {
    let mut lines = reader.lines();
    let mut line = || {
        lines
            .next()
            .unwrap_or_else(|| Err(std::io::ErrorKind::UnexpectedEof.into()))
    };
    let status = line()?;
    let code = status.split(' ').nth(1).and_then(|code| code.parse().ok());
    let code = code.ok_or(std::io::ErrorKind::InvalidData)?;
    let mut headers = Vec::new();
    loop {
        let line = line()?;
        let Some((name, value)) = line.split_once(':') else {
            return Ok((code, headers));
        };
        headers.push((name.to_lowercase(), value.trim().to_owned()));
    }
}

/// The event stream of the page.
#[derive(Debug)]
pub struct Events(BufReader<TcpStream>);

impl Events {
    /// Opens the event stream.
    ///
    /// # Errors
    ///
    /// No answer arrives in time.
    pub fn listen(address: SocketAddr, patience: Duration) -> std::io::Result<Self> {
        let mut reader = ask(address, LOCALHOST, "/api/v1/events", patience)?;
        head(&mut reader)?;
        Ok(Self(reader))
    }
}

impl Iterator for Events {
    type Item = (String, Value);

    /// The next event with its data; `None` at the end of the stream, or after a time-out.
    fn next(&mut self) -> Option<Self::Item> {
        let (mut name, mut data) = (String::new(), String::new());
        loop {
            let mut line = String::new();
            if self.0.read_line(&mut line).ok()? == 0 {
                return None;
            }
            match line.trim_end().split_once(':') {
                Some(("event", value)) => value.trim().clone_into(&mut name),
                Some(("data", value)) => data += value.trim(),
                // A comment keeps the connection open.
                Some(_) => {}
                None if name.is_empty() => {}
                None => return Some((name, serde_json::from_str(&data).unwrap_or_default())),
            }
        }
    }
}
