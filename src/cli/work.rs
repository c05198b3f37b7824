//! `viola work`: runs jobs only, beside any number of servers and other workers.

use super::args::{StoreArguments, WorkerArguments, wrong_arguments};
use super::service::{self, print_address};
use crate::api::{WorkParams, work};
use anyhow::Result;
use clap::Args;
use std::net::SocketAddr;

#[derive(Args)]
pub struct WorkArguments {
    #[command(flatten)]
    store: StoreArguments,
    #[command(flatten)]
    worker: WorkerArguments,
    /// Address for /healthz, /readyz and /metrics; by default they are not served.
    #[arg(long, value_name = "ADDRESS", env = "VIOLA_ADMIN_LISTEN")]
    admin_listen: Option<SocketAddr>,
}

impl WorkArguments {
    /// Refuses values that exclude each other, and a process without work.
    pub fn check(&self) -> Result<()> {
        if self.worker.workers == 0 {
            return Err(wrong_arguments(
                "`viola work` with 0 workers does nothing; give it at least --workers 1",
            ));
        }
        self.worker.check()
    }
}

pub fn run(arguments: &WorkArguments) -> Result<()> {
    arguments.check()?;
    let params = || {
        Ok(WorkParams {
            storage: arguments.store.params(),
            workers: arguments.worker.workers,
            worker: arguments.worker.params()?,
            webhooks: arguments.worker.webhooks(),
            listen: arguments.admin_listen,
        })
    };
    service::run(params, |params, stop| work(params, stop, print_address))
}
