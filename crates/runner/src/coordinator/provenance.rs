//! The machine, time and program version of a report, and the time of a failure. They are not part of any result.

use std::time::SystemTime;

/// The time in milliseconds since 1970 (UTC); `None` on a machine whose clock is before that.
pub(crate) fn unix_ms() -> Option<i64> {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    since.ok()?.as_millis().try_into().ok()
}

/// (label, value) pairs for [`results::report::write()`].
#[must_use]
pub fn labels() -> Vec<(String, String)> {
    let name = rustix::system::uname();
    let system = [name.sysname(), name.release(), name.machine()];
    let system = system.map(|part| part.to_string_lossy().into_owned());
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    [
        ("Report made", httpdate::fmt_http_date(SystemTime::now())),
        (
            "Machine",
            format!(
                "{} ({}, processors: {processors})",
                crate::worker::machine(),
                system.join(" "),
            ),
        ),
        ("Report by version", crate::identity::BUILD.to_owned()),
    ]
    .map(|(label, value)| (label.to_owned(), value))
    .to_vec()
}
