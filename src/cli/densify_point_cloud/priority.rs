//! `--process-priority`.

/// Niceness for -3 to 3.
const NICENESS: [i32; 7] = [19, 15, 10, 0, -10, -15, -20];

/// Sets the priority of this process, -3 (lowest) to 3; what is beyond is taken for the end. Only a privileged process
/// can raise it above the ordinary, 0.
///
/// # Errors
/// What the system said.
pub(super) fn set(priority: i32) -> Result<(), String> {
    let niceness = NICENESS[(priority.clamp(-3, 3) + 3) as usize];
    set_niceness(niceness)
}

/// Threads that are started from now on inherit it.
#[cfg(unix)]
fn set_niceness(niceness: i32) -> Result<(), String> {
    let current = rustix::process::getpriority_process(None).map_err(|e| e.to_string())?;
    // Started with less already: that is for whoever did so to decide.
    if niceness >= 0 && current >= niceness {
        return Ok(());
    }
    rustix::process::setpriority_process(None, niceness).map_err(|e| e.to_string())
}

#[cfg(not(unix))]
fn set_niceness(_: i32) -> Result<(), String> {
    Err("not available on this system".to_owned())
}
