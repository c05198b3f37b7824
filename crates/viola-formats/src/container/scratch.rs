//! The place where archives are unpacked, and the bytes that may lie there at once.

use super::ContainerError;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// A number of bytes that all files unpacked at the same time share.
#[derive(Debug)]
pub struct Budget {
    max_bytes: u64,
    used_bytes: AtomicU64,
}

impl Budget {
    pub fn new(max_bytes: u64) -> Budget {
        Budget { max_bytes, used_bytes: AtomicU64::new(0) }
    }

    /// Returns the bytes that are in use now.
    pub fn used_bytes(&self) -> u64 {
        self.used_bytes.load(Ordering::Relaxed)
    }

    fn take(&self, bytes: u64) -> bool {
        let more = |used: u64| used.checked_add(bytes).filter(|sum| *sum <= self.max_bytes);
        self.used_bytes.fetch_update(Ordering::Relaxed, Ordering::Relaxed, more).is_ok()
    }

    fn give_back(&self, bytes: u64) {
        self.used_bytes.fetch_sub(bytes, Ordering::Relaxed);
    }
}

/// A folder for unpacked archives, and the budgets that bound them. The default is the system's folder for temporary files, without a budget.
#[derive(Debug, Clone, Default)]
pub struct Scratch {
    folder: Option<PathBuf>,
    budgets: Vec<Arc<Budget>>,
}

impl Scratch {
    /// Returns a scratch in a folder, within all of these budgets.
    pub fn new(folder: &Path, budgets: Vec<Arc<Budget>>) -> Scratch {
        Scratch { folder: Some(folder.to_owned()), budgets }
    }

    /// Creates a file without a name, which is deleted when it is closed.
    pub(super) fn file(&self) -> io::Result<File> {
        match &self.folder {
            Some(folder) => tempfile::tempfile_in(folder),
            None => tempfile::tempfile(),
        }
    }

    pub(super) fn reserve(&self) -> Reservation {
        Reservation { budgets: self.budgets.clone(), bytes: 0 }
    }
}

/// Bytes of budgets in use. Dropping it gives them back.
#[derive(Debug)]
pub(super) struct Reservation {
    budgets: Vec<Arc<Budget>>,
    bytes: u64,
}

impl Reservation {
    /// Takes further bytes for the file `name`. Refuses them if the file alone exceeds a budget, or for now if it does so
    /// together with others.
    pub fn grow(&mut self, bytes: u64, name: &str) -> Result<(), ContainerError> {
        for (at, budget) in self.budgets.iter().enumerate() {
            if budget.take(bytes) {
                continue;
            }
            self.budgets[..at].iter().for_each(|taken| taken.give_back(bytes));
            if self.bytes.saturating_add(bytes) > budget.max_bytes {
                return Err(ContainerError::UnpacksTooLarge { max_bytes: budget.max_bytes });
            }
            let source = io::Error::new(io::ErrorKind::QuotaExceeded, "other archives are being unpacked");
            return Err(ContainerError::CannotUnpack { name: name.to_owned(), source });
        }
        self.bytes += bytes;
        Ok(())
    }
}

impl Drop for Reservation {
    fn drop(&mut self) {
        self.budgets.iter().for_each(|budget| budget.give_back(self.bytes));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_budgets_bound_what_is_unpacked_at_once() {
        let (process, tenant) = (Arc::new(Budget::new(100)), Arc::new(Budget::new(60)));
        let scratch = Scratch::new(Path::new("/"), vec![process.clone(), tenant.clone()]);
        let mut first = scratch.reserve();
        first.grow(40, "a").unwrap();
        let mut second = scratch.reserve();
        assert!(
            matches!(second.grow(30, "b"), Err(ContainerError::CannotUnpack { .. })),
            "others use it now"
        );
        assert_eq!((process.used_bytes(), tenant.used_bytes()), (40, 40));
        assert!(matches!(first.grow(30, "a"), Err(ContainerError::UnpacksTooLarge { max_bytes: 60 })));
        drop(first);
        second.grow(30, "b").unwrap();
        assert_eq!((process.used_bytes(), tenant.used_bytes()), (30, 30));
        drop(second);
        assert_eq!((process.used_bytes(), tenant.used_bytes()), (0, 0));
    }
}
