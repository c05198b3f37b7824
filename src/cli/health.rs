//! `viola health`: checks whether a running process can serve, for containers without another HTTP client.

use anyhow::{Context, Result, bail};
use clap::Args;
use reqwest::StatusCode;
use std::net::SocketAddr;
use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(4);

#[derive(Args)]
pub struct HealthArguments {
    /// Address of the process; with `--admin-listen` that address.
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:8080")]
    address: SocketAddr,
}

pub fn run(arguments: &HealthArguments) -> Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    runtime.block_on(async {
        let url = format!("http://{}/readyz", arguments.address);
        let client = reqwest::Client::builder().timeout(PATIENCE).no_proxy().build()?;
        let no_answer = || format!("no answer from {url}; name the address of the process with --address");
        let answer = client.get(&url).send().await.with_context(no_answer)?;
        let status = answer.status();
        let told = answer.text().await?;
        if status == StatusCode::NOT_FOUND {
            bail!("{url} is not served; with `--admin-listen` name that address with --address");
        }
        if !status.is_success() {
            bail!("{status}: {told}");
        }
        println!("{told}");
        Ok(())
    })
}
