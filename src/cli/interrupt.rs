//! Ctrl-C: the first asks the work to stop where it can go on later, the second ends the process.

use super::complain;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Exit code of a process that was interrupted, as shells have it.
pub(super) const INTERRUPTED: u8 = 130;

/// From now on Ctrl-C sets `stop`, and only then ends the process.
pub(super) fn ask_to_stop(stop: &Arc<AtomicBool>) {
    let stop = Arc::clone(stop);
    let handler = move || {
        if stop.swap(true, Ordering::SeqCst) {
            std::process::exit(i32::from(INTERRUPTED));
        }
        complain("interrupted: what is in hand is completed; Ctrl-C again stops at once\n");
    };
    // Where it cannot be set, Ctrl-C ends the process, and what is complete is kept all the same.
    let _ = ctrlc::set_handler(handler);
}
