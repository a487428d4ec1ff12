//! Memory that runs out ends the process as the system would have ended it.
#![allow(
    unsafe_code,
    reason = "an allocator is unsafe by its nature; this one only looks at what the system's returns"
)]

use super::OUT_OF_MEMORY;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// The system's allocator; when it has nothing left the process ends with one line and exit code 137, which those who
/// call `DensifyPointCloud` take for what it is.
#[derive(Debug)]
pub struct ExitWhenExhausted;

/// Set once the process is on its way out.
static ENDING: AtomicBool = AtomicBool::new(false);

thread_local! {
    /// Whether this thread ends the process, which may need a little memory too.
    static ENDS: Cell<bool> = const { Cell::new(false) };
}

fn checked(memory: *mut u8, bytes: usize) -> *mut u8 {
    if memory.is_null() && !ENDS.get() {
        while ENDING.swap(true, Ordering::SeqCst) {
            // Another thread was first.
            std::thread::sleep(Duration::from_secs(1));
        }
        ENDS.set(true);
        let mut err = std::io::stderr();
        let _ = writeln!(
            err,
            "error: out of memory: {} KiB more are not to be had: give a lower --max-resolution or fewer --max-threads",
            bytes.div_ceil(1 << 10)
        );
        std::process::exit(i32::from(OUT_OF_MEMORY));
    }
    memory
}

// SAFETY: every call is passed on to the system's allocator as it is.
unsafe impl GlobalAlloc for ExitWhenExhausted {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as promised by the caller.
        checked(unsafe { System.alloc(layout) }, layout.size())
    }
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as promised by the caller.
        checked(unsafe { System.alloc_zeroed(layout) }, layout.size())
    }
    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: as promised by the caller.
        checked(unsafe { System.realloc(memory, layout, size) }, size)
    }
    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        // SAFETY: as promised by the caller.
        unsafe { System.dealloc(memory, layout) }
    }
}
