//! Time that work took of a processor, so that a shared machine does not spoil the figures.

use std::time::Duration;

/// Time that this thread spent on a processor; where the system does not tell, the time that passed.
fn busy() -> Duration {
    #[cfg(unix)]
    {
        let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
        Duration::new(time.tv_sec as u64, time.tv_nsec as u32)
    }
    #[cfg(not(unix))]
    {
        static START: std::sync::LazyLock<std::time::Instant> =
            std::sync::LazyLock::new(std::time::Instant::now);
        START.elapsed()
    }
}

/// What `work`, done `iterations` times by one thread, took of a processor; dropping results does not count.
pub(crate) fn time<T: Send>(iterations: u64, work: impl Fn() -> T + Send + Sync) -> Duration {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    pool.install(|| {
        let timed = || {
            let before = busy();
            let value = std::hint::black_box(work());
            let time = busy() - before;
            drop(value);
            time
        };
        (0..iterations).map(|_| timed()).sum()
    })
}
