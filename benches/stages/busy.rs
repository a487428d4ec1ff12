//! Time that work took of a processor, so that a shared machine does not spoil the figures.

use std::sync::LazyLock;
use std::time::{Duration, Instant};

/// Time that this thread spent on a processor; where the system does not tell, the time that passed.
fn busy() -> Duration {
    static START: LazyLock<Instant> = LazyLock::new(Instant::now);
    let told = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = told.and_then(|text| text.split(' ').next()?.parse().ok());
    nanoseconds.map_or_else(|| START.elapsed(), Duration::from_nanos)
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
