//! System calls that a decoding process has no use for, and may not make.
//!
//! The filter is installed where the system has seccomp; elsewhere the process has its limits alone.

#[cfg(all(target_os = "linux", any(target_arch = "x86_64", target_arch = "aarch64")))]
mod seccomp {
    use libc::{c_long, sock_filter, sock_fprog};
    use std::io;

    #[cfg(target_arch = "x86_64")]
    const ARCHITECTURE: u32 = 0xc000_003e;
    #[cfg(target_arch = "aarch64")]
    const ARCHITECTURE: u32 = 0xc000_00b7;
    /// Offsets of the number and of the architecture in the filter's input.
    const NUMBER: u32 = 0;
    const OF_ARCHITECTURE: u32 = 4;
    /// Numbers from here on are another way to make the same calls of x86-64.
    const OTHER_NUMBERS: u32 = 0x4000_0000;

    /// Calls for the network, for other processes, and those that reach them in another way.
    pub const OUTSIDE: &[c_long] = &[
        libc::SYS_socket,
        libc::SYS_socketpair,
        libc::SYS_connect,
        libc::SYS_bind,
        libc::SYS_listen,
        libc::SYS_accept,
        libc::SYS_accept4,
        libc::SYS_io_uring_setup,
        libc::SYS_ptrace,
        libc::SYS_process_vm_readv,
        libc::SYS_process_vm_writev,
        libc::SYS_pidfd_open,
        libc::SYS_kill,
        libc::SYS_rt_sigqueueinfo,
        libc::SYS_unshare,
        libc::SYS_setns,
        libc::SYS_mount,
        libc::SYS_chroot,
        libc::SYS_bpf,
        libc::SYS_perf_event_open,
        libc::SYS_add_key,
        libc::SYS_keyctl,
        libc::SYS_request_key,
        libc::SYS_userfaultfd,
    ];

    /// Calls that open files, such as the environment of another process, or start programs.
    pub const FILES: &[c_long] = &[
        #[cfg(target_arch = "x86_64")]
        libc::SYS_open,
        libc::SYS_openat,
        libc::SYS_openat2,
        libc::SYS_open_by_handle_at,
        libc::SYS_execve,
        libc::SYS_execveat,
    ];

    fn statement(code: u32, k: u32) -> sock_filter {
        sock_filter { code: code as u16, jt: 0, jf: 0, k }
    }

    /// Continues with the next statement if true, else skips one.
    fn unless(test: u32, k: u32) -> sock_filter {
        sock_filter { code: (libc::BPF_JMP | test | libc::BPF_K) as u16, jt: 0, jf: 1, k }
    }

    /// Returns a filter that answers `EPERM` to these calls and to those of other architectures.
    pub fn without(calls: &[c_long]) -> Vec<sock_filter> {
        let load = libc::BPF_LD | libc::BPF_W | libc::BPF_ABS;
        let answer = libc::BPF_RET | libc::BPF_K;
        let refusal = statement(answer, libc::SECCOMP_RET_ERRNO | libc::EPERM as u32);
        let mut filter = vec![
            statement(load, OF_ARCHITECTURE),
            sock_filter { jt: 1, jf: 0, ..unless(libc::BPF_JEQ, ARCHITECTURE) },
            refusal,
            statement(load, NUMBER),
        ];
        if cfg!(target_arch = "x86_64") {
            filter.extend([unless(libc::BPF_JGE, OTHER_NUMBERS), refusal]);
        }
        for call in calls {
            filter.extend([unless(libc::BPF_JEQ, *call as u32), refusal]);
        }
        filter.push(statement(answer, libc::SECCOMP_RET_ALLOW));
        filter
    }

    /// Installs a filter on this thread and what it starts. Makes two system calls and allocates nothing.
    pub fn install(filter: &[sock_filter]) -> io::Result<()> {
        let program = sock_fprog { len: filter.len() as u16, filter: filter.as_ptr().cast_mut() };
        // SAFETY: the kernel reads `program` and the filter, which live until after the call.
        let failed = unsafe {
            libc::prctl(libc::PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0
                || libc::prctl(libc::PR_SET_SECCOMP, libc::SECCOMP_MODE_FILTER, &raw const program) != 0
        };
        if failed { Err(io::Error::last_os_error()) } else { Ok(()) }
    }
}

/// Keeps the process of a command from the network and from other processes.
#[cfg(all(target_os = "linux", any(target_arch = "x86_64", target_arch = "aarch64")))]
pub(super) fn impose(command: &mut std::process::Command) {
    use std::os::unix::process::CommandExt;
    let filter = seccomp::without(seccomp::OUTSIDE);
    // SAFETY: between fork and exec there are only system calls, no allocations and no locks.
    unsafe {
        command.pre_exec(move || {
            // A system without seccomp refuses it.
            let _ = seccomp::install(&filter);
            Ok(())
        });
    }
}

#[cfg(not(all(target_os = "linux", any(target_arch = "x86_64", target_arch = "aarch64"))))]
pub(super) fn impose(_: &mut std::process::Command) {}

/// Keeps this thread, and those that it starts, from opening files: a decoder has its file already.
#[cfg(all(target_os = "linux", any(target_arch = "x86_64", target_arch = "aarch64")))]
pub fn open_no_more_files() {
    // A system without seccomp refuses it.
    let _ = seccomp::install(&seccomp::without(seccomp::FILES));
}

#[cfg(not(all(target_os = "linux", any(target_arch = "x86_64", target_arch = "aarch64"))))]
pub fn open_no_more_files() {}

#[cfg(all(test, target_os = "linux", any(target_arch = "x86_64", target_arch = "aarch64")))]
mod tests {
    use super::*;
    use std::net::TcpListener;
    use std::process::{Command, Stdio};

    fn runs(command: &mut Command) -> bool {
        command.stdout(Stdio::null()).stderr(Stdio::null()).status().unwrap().success()
    }

    #[test]
    fn a_confined_process_reaches_neither_the_network_nor_its_parent() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let connect = format!("exec 3<>/dev/tcp/127.0.0.1/{}", listener.local_addr().unwrap().port());
        let signal = format!("kill -0 {}", std::process::id());
        for script in [connect, signal] {
            let shell = || {
                let mut shell = Command::new("bash");
                shell.args(["-c", &script]);
                shell
            };
            assert!(runs(&mut shell()), "{script}");
            let mut confined = shell();
            impose(&mut confined);
            assert!(!runs(&mut confined), "{script}");
        }
        let mut harmless = Command::new("bash");
        harmless.args(["-c", "true < /dev/null"]);
        impose(&mut harmless);
        assert!(runs(&mut harmless));
    }

    #[test]
    fn no_file_is_opened_any_more() {
        let opened = std::thread::spawn(|| {
            open_no_more_files();
            std::fs::File::open("/proc/self/environ").map_err(|error| error.kind())
        });
        assert_eq!(opened.join().unwrap().unwrap_err(), std::io::ErrorKind::PermissionDenied);
        assert!(std::fs::File::open("/proc/self/environ").is_ok(), "other threads are free");
    }
}
