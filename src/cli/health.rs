//! `viola health`: checks whether a running process can serve, for containers without another HTTP client.

use anyhow::{Context, Result, bail};
use clap::Args;
use reqwest::StatusCode;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(4);
/// The default address of `viola serve`.
const DEFAULT: SocketAddr = SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), 8080);
/// Environment variables with the address of the process, in the order in which it is taken.
const VARIABLES: [&str; 2] = ["VIOLA_ADMIN_LISTEN", "VIOLA_LISTEN"];

#[derive(Args)]
pub struct HealthArguments {
    /// Address of the process; with `--admin-listen` that address. Default: the port of VIOLA_ADMIN_LISTEN, else of
    /// VIOLA_LISTEN, else 8080, on this machine.
    #[arg(long, value_name = "ADDRESS")]
    address: Option<SocketAddr>,
}

/// Returns the address at which a process is reached that listens on the first of these addresses.
fn reached_at(listens: impl Iterator<Item = String>) -> SocketAddr {
    let parsed = |text: String| text.parse::<SocketAddr>().ok().filter(|address| address.port() != 0);
    let mut address = listens.filter_map(parsed).next().unwrap_or(DEFAULT);
    // It listens on all addresses of this machine.
    match address.ip() {
        IpAddr::V4(ip) if ip.is_unspecified() => address.set_ip(Ipv4Addr::LOCALHOST.into()),
        IpAddr::V6(ip) if ip.is_unspecified() => address.set_ip(Ipv6Addr::LOCALHOST.into()),
        _ => {}
    }
    address
}

pub fn run(arguments: &HealthArguments) -> Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    runtime.block_on(async {
        let listens = VARIABLES.into_iter().filter_map(|name| std::env::var(name).ok());
        let address = arguments.address.unwrap_or_else(|| reached_at(listens));
        let url = format!("http://{address}/readyz");
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_process_is_reached_at_the_address_of_its_environment() {
        for (listens, address) in [
            (&["0.0.0.0:9090", "0.0.0.0:8080"][..], "127.0.0.1:9090"),
            (&[], "127.0.0.1:8080"),
            (&["[::]:9090"], "[::1]:9090"),
            (&["10.0.0.7:8000"], "10.0.0.7:8000"),
            (&["", "127.0.0.1:0"], "127.0.0.1:8080"),
        ] {
            let listens = listens.iter().map(|text| (*text).to_owned());
            assert_eq!(reached_at(listens).to_string(), address);
        }
    }
}
