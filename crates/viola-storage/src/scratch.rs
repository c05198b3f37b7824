//! Unpacking of archives: in the data folder, never in the system's temporary folder, which may be in memory.

use super::Storage;
use super::params::UnpackParams;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use viola_formats::container::{Budget, Scratch};

/// The budgets of this process.
pub(super) struct Unpacking {
    tenant_bytes: u64,
    process: Arc<Budget>,
    tenants: Mutex<HashMap<String, Arc<Budget>>>,
}

impl Unpacking {
    pub fn new(params: UnpackParams) -> Unpacking {
        let process = Arc::new(Budget::new(params.process_bytes));
        Unpacking { tenant_bytes: params.tenant_bytes, process, tenants: Mutex::default() }
    }
}

impl Storage {
    /// Returns the place for a tenant's unpacked archives.
    pub fn scratch(&self, tenant: &str) -> Scratch {
        let Unpacking { tenant_bytes, process, tenants } = &self.unpacking;
        let mut tenants = tenants.lock().unwrap_or_else(PoisonError::into_inner);
        // The map holds the last reference to the budget of a tenant that unpacks nothing.
        tenants.retain(|_, budget| Arc::strong_count(budget) > 1);
        let new = || Arc::new(Budget::new(*tenant_bytes));
        let of_tenant = tenants.entry(tenant.to_owned()).or_insert_with(new).clone();
        Scratch::new(self.blobs.incoming_folder(), vec![process.clone(), of_tenant])
    }
}
