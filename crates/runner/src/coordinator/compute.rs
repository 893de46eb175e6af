//! Computations outside the threads of the async runtime.

use crate::cpu::thread_seconds;

/// Runs `work` on separate compute threads, one per processor. Also returns their CPU time, in
/// seconds.
pub(crate) async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> T + Send + 'static,
) -> anyhow::Result<(T, f64)> {
    let timed = move || -> anyhow::Result<(T, f64)> {
        let pool = rayon::ThreadPoolBuilder::new().build()?;
        let result = pool.install(work);
        let times = pool.broadcast(|_| thread_seconds());
        Ok((result, times.iter().sum()))
    };
    tokio::task::spawn_blocking(timed).await?
}
