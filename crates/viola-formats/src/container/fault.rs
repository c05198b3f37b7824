//! Classification of I/O errors as faults of the machine.

use std::error::Error;
use std::io::{self, ErrorKind};

/// Returns whether an I/O error is a fault of the machine, not of the file's content: no descriptors, no
/// memory, a full or failing disk, a missing file. The same operation may succeed later.
pub fn is_machine_fault(error: &io::Error) -> bool {
    if is_direct(error) {
        return true;
    }
    // A decoder may wrap the error of the file that it reads.
    let mut cause = error.get_ref().map(|cause| cause as &(dyn Error + 'static));
    while let Some(wrapped) = cause {
        if wrapped.downcast_ref().is_some_and(is_machine_fault) {
            return true;
        }
        cause = wrapped.source();
    }
    false
}

fn is_direct(error: &io::Error) -> bool {
    match error.kind() {
        ErrorKind::OutOfMemory
        | ErrorKind::StorageFull
        | ErrorKind::QuotaExceeded
        | ErrorKind::ReadOnlyFilesystem
        | ErrorKind::StaleNetworkFileHandle
        | ErrorKind::NetworkDown
        | ErrorKind::NetworkUnreachable
        | ErrorKind::HostUnreachable
        | ErrorKind::TimedOut
        | ErrorKind::ResourceBusy
        | ErrorKind::ExecutableFileBusy
        | ErrorKind::WouldBlock => true,
        // Readers use these kinds for content too, but only the system gives them a number.
        ErrorKind::NotFound | ErrorKind::PermissionDenied => error.raw_os_error().is_some(),
        _ => has_fault_number(error),
    }
}

/// Returns whether an error without an [`ErrorKind`] of its own is a fault of the machine.
#[cfg(unix)]
fn has_fault_number(error: &io::Error) -> bool {
    use rustix::io::Errno;
    let faults = [Errno::MFILE, Errno::NFILE, Errno::IO, Errno::NXIO, Errno::NODEV, Errno::NOBUFS];
    Errno::from_io_error(error).is_some_and(|number| faults.contains(&number))
}

#[cfg(not(unix))]
fn has_fault_number(_: &io::Error) -> bool {
    false
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::container::ContainerError;
    use rustix::io::Errno;

    #[test]
    fn errors_of_the_system_are_faults_and_errors_of_content_are_not() {
        let system = [Errno::MFILE, Errno::NFILE, Errno::NOMEM, Errno::NOSPC, Errno::DQUOT, Errno::IO];
        let system = system.into_iter().chain([Errno::AGAIN, Errno::ROFS, Errno::STALE, Errno::NOENT]);
        for number in system {
            assert!(is_machine_fault(&number.into()), "{number:?}");
            let source = io::Error::from(number);
            let wrapped = ContainerError::Unreadable { name: "clip".to_owned(), source };
            assert!(is_machine_fault(&io::Error::other(wrapped)), "{number:?} within another error");
        }
        let content = [ErrorKind::UnexpectedEof, ErrorKind::InvalidData, ErrorKind::InvalidInput];
        for kind in content.into_iter().chain([ErrorKind::Other, ErrorKind::NotFound]) {
            assert!(!is_machine_fault(&kind.into()), "{kind:?}");
            assert!(!is_machine_fault(&io::Error::new(kind, "a checksum is wrong")), "{kind:?}");
        }
        // A seek to an offset that the archive names.
        assert!(!is_machine_fault(&Errno::INVAL.into()));
    }
}
