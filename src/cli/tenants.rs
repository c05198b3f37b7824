//! `viola tenants`: lists the tenants and removes one.

use super::store::StoreArguments;
use crate::storage::{Storage, Tenant};
use anyhow::{Result, bail};
use clap::{Args, Subcommand};
use indicatif::ProgressBar;
use jiff::Timestamp;
use serde_json::json;

#[derive(Args)]
pub struct TenantsArguments {
    #[command(subcommand)]
    command: TenantsCommand,
}

#[derive(Subcommand)]
enum TenantsCommand {
    /// List the tenants that have any data.
    List(ListArguments),
    /// Remove a tenant with all its keys, homes, clips, maps, uploads and webhooks.
    Delete(DeleteArguments),
}

#[derive(Args)]
struct ListArguments {
    #[command(flatten)]
    store: StoreArguments,
    /// Print a list of objects instead of the table.
    #[arg(long)]
    json: bool,
}

#[derive(Args)]
struct DeleteArguments {
    #[command(flatten)]
    store: StoreArguments,
    #[arg(value_name = "NAME")]
    tenant: Tenant,
    /// Confirm the removal, which cannot be undone.
    #[arg(long)]
    yes: bool,
}

pub fn run(arguments: &TenantsArguments) -> Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    runtime.block_on(async {
        match &arguments.command {
            TenantsCommand::List(arguments) => list(arguments).await,
            TenantsCommand::Delete(arguments) => delete(arguments).await,
        }
    })
}

async fn list(arguments: &ListArguments) -> Result<()> {
    let storage = Storage::administer(&arguments.store.params()).await?;
    let mut tenants = Vec::new();
    for tenant in storage.tenants().await? {
        let bytes = storage.tenant_bytes(&tenant).await?;
        tenants.push((tenant, bytes));
    }
    storage.close().await;
    if arguments.json {
        let document = |(tenant, bytes): &(Tenant, _)| json!({"tenant": tenant.name(), "bytes": bytes});
        let documents: Vec<_> = tenants.iter().map(document).collect();
        println!("{}", serde_json::to_string_pretty(&documents)?);
        return Ok(());
    }
    println!("{:32}  {:>14}", "tenant", "bytes of files");
    for (tenant, bytes) in &tenants {
        println!("{:32}  {bytes:>14}", tenant.name());
    }
    Ok(())
}

async fn delete(arguments: &DeleteArguments) -> Result<()> {
    let (tenant, name) = (&arguments.tenant, arguments.tenant.name());
    let storage = Storage::administer(&arguments.store.params()).await?;
    if !storage.tenants().await?.contains(tenant) {
        bail!("there is no tenant {name}; `viola tenants list` shows those there are");
    }
    if !arguments.yes {
        bail!("this removes every byte of the tenant {name} for good; say so with --yes");
    }
    let bar = ProgressBar::new_spinner();
    let show = |homes| bar.set_message(format!("{homes} homes removed"));
    let removed = storage.delete_tenant(tenant, Timestamp::now(), show).await;
    bar.finish_and_clear();
    let removed = removed?;
    storage.close().await;
    println!(
        "{name} is gone: {} homes, {} uploads, {} webhooks, {} keys, and every file of theirs",
        removed.homes, removed.uploads, removed.webhooks, removed.keys
    );
    Ok(())
}
