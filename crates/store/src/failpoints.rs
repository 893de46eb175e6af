//! Points at which a test can end the process as `kill -9` does. See the crate's documentation.

/// Ends the process here when the point is set to `return`.
#[cfg(feature = "failpoints")]
pub(crate) fn at(name: &str) {
    fail::fail_point!(name, |_| std::process::abort());
}

/// Ends the process while the following operation is in progress: with `return(N)`, after N
/// microseconds.
#[cfg(feature = "failpoints")]
pub(crate) fn during(name: &str) {
    fail::fail_point!(name, |delay: Option<String>| {
        let microseconds = delay.and_then(|delay| delay.parse().ok()).unwrap_or(0);
        std::thread::spawn(move || {
            std::thread::sleep(std::time::Duration::from_micros(microseconds));
            std::process::abort();
        });
    });
}

#[cfg(not(feature = "failpoints"))]
pub(crate) const fn at(_: &str) {}

#[cfg(not(feature = "failpoints"))]
pub(crate) const fn during(_: &str) {}
