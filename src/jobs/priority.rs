//! Priority of threads.

/// Lowers the priority of this thread, so that work which takes long does not delay short requests.
pub fn give_way() {
    /// Ten steps give such a thread a tenth of a processor that another thread wants.
    #[cfg(target_os = "linux")]
    const NICENESS: i32 = 10;
    // On Linux it is that of the thread, and of the threads that it starts. Without it requests are slower, but served.
    #[cfg(target_os = "linux")]
    let _ = rustix::process::setpriority_process(None, NICENESS);
}
