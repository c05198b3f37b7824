//! `viola tenants`: lists the tenants, sets their limits and removes one.

use super::args::StoreArguments;
use super::output;
use super::progress::spinner;
use anyhow::{Result, bail};
use clap::{Args, Subcommand};
use serde_json::json;
use viola_storage::{Removed, Storage, Tenant, TenantLimits};

#[derive(Args)]
pub struct TenantsArguments {
    #[command(subcommand)]
    command: TenantsCommand,
}

#[derive(Subcommand)]
enum TenantsCommand {
    /// List the tenants with a key, with data, or with limits of their own.
    List(ListArguments),
    /// Set the limits of a tenant; those that are not given become the service's.
    Set(SetArguments),
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
struct SetArguments {
    #[command(flatten)]
    store: StoreArguments,
    /// Name of the tenant.
    #[arg(value_name = "NAME")]
    tenant: Tenant,
    /// Maximum size of its files in bytes.
    #[arg(long, value_name = "BYTES")]
    max_bytes: Option<u64>,
    /// Maximum number of its unfinished uploads.
    #[arg(long, value_name = "N")]
    max_uploads: Option<u64>,
}

#[derive(Args)]
struct DeleteArguments {
    #[command(flatten)]
    store: StoreArguments,
    /// Name of the tenant to remove.
    #[arg(value_name = "NAME")]
    tenant: Tenant,
    /// Confirm the removal, which cannot be undone.
    #[arg(long)]
    yes: bool,
}

pub fn run(arguments: &TenantsArguments) -> Result<()> {
    match &arguments.command {
        TenantsCommand::List(arguments) => list(arguments),
        TenantsCommand::Set(arguments) => set(arguments),
        TenantsCommand::Delete(arguments) => delete(arguments),
    }
}

fn list(arguments: &ListArguments) -> Result<()> {
    let tenants = arguments.store.administer(async |storage| {
        let mut tenants = Vec::new();
        for tenant in storage.tenants().await? {
            let bytes = storage.tenant_bytes(&tenant).await?;
            let limits = storage.tenant_limits(&tenant).await?;
            tenants.push((tenant, bytes, limits));
        }
        Ok(tenants)
    })?;
    let document = |(tenant, bytes, limits): &(Tenant, u64, TenantLimits)| {
        json!({"tenant": tenant.name(), "bytes": bytes, "max_bytes": limits.max_bytes,
            "max_uploads": limits.max_uploads})
    };
    let head = ["tenant", "bytes of files", "max. bytes", "max. uploads"];
    output::print_list(&tenants, arguments.json, document, head, |(tenant, bytes, limits)| {
        let (max_bytes, max_uploads) = (shown(limits.max_bytes), shown(limits.max_uploads));
        [tenant.name().to_owned(), bytes.to_string(), max_bytes, max_uploads]
    })
}

fn shown(limit: Option<u64>) -> String {
    limit.map_or("default".to_owned(), |limit| limit.to_string())
}

fn set(arguments: &SetArguments) -> Result<()> {
    let SetArguments { store, tenant, max_bytes, max_uploads } = arguments;
    let limits = TenantLimits { max_bytes: *max_bytes, max_uploads: *max_uploads };
    store.administer(async |storage| {
        check_known(storage, tenant).await?;
        Ok(storage.set_tenant_limits(tenant, &limits).await?)
    })?;
    println!("{}: bytes {}, unfinished uploads {}", tenant.name(), shown(*max_bytes), shown(*max_uploads));
    Ok(())
}

/// Refuses a name that no key, home or other row has: it is a slip of the pen.
async fn check_known(storage: &Storage, tenant: &Tenant) -> Result<()> {
    // Without keys, all requests are of this tenant, before its first home too.
    if *tenant == Tenant::default() || storage.tenants().await?.contains(tenant) {
        return Ok(());
    }
    let name = tenant.name();
    bail!(
        "there is no tenant {name}; `viola tenants list` shows those there are, and \
         `viola keys create --tenant {name}` makes a new one"
    )
}

fn delete(arguments: &DeleteArguments) -> Result<()> {
    let removed = arguments.store.administer(async |storage| delete_from(storage, arguments).await)?;
    println!(
        "{} is gone with all its files: homes {}, uploads {}, webhooks {}, keys {}",
        arguments.tenant.name(),
        removed.homes,
        removed.uploads,
        removed.webhooks,
        removed.keys
    );
    Ok(())
}

async fn delete_from(storage: &Storage, arguments: &DeleteArguments) -> Result<Removed> {
    let (tenant, name) = (&arguments.tenant, arguments.tenant.name());
    if !storage.tenants().await?.contains(tenant) {
        bail!("there is no tenant {name}; `viola tenants list` shows those there are");
    }
    if !arguments.yes {
        bail!("this removes every byte of the tenant {name} for good; say so with --yes");
    }
    // A deletion from the wrong store would succeed, since files that are not there count as deleted.
    storage.check_store().await?;
    let bar = spinner(String::new());
    let show = |homes| bar.set_message(format!("homes removed: {homes}"));
    let removed = storage.delete_tenant(tenant, storage.now(), show).await;
    bar.finish_and_clear();
    Ok(removed?)
}
