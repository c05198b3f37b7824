//! `viola keys`: manages the keys of the service.

use super::args::StoreArguments;
use super::output;
use super::progress::to_standard_error;
use anyhow::{Context, Result, bail};
use clap::{Args, Subcommand};
use jiff::{SignedDuration, Timestamp};
use serde_json::json;
use std::io::Write;
use uuid::Uuid;
use viola_storage::{ApiKey, HomeId, NewKey, Role, Storage, Tenant};

#[derive(Args)]
pub struct KeysArguments {
    #[command(subcommand)]
    command: KeysCommand,
}

#[derive(Subcommand)]
enum KeysCommand {
    /// Create a key and print it; it is not shown again. Once a key exists, the service requires one.
    Create(CreateArguments),
    /// List the keys, without their secrets.
    List(ListArguments),
    /// Revoke a key: requests with it are refused at once, its event streams end within a minute.
    Revoke(RevokeArguments),
}

#[derive(Args)]
struct CreateArguments {
    #[command(flatten)]
    store: StoreArguments,
    /// Tenant whose homes the key opens. Data from the time without keys belongs to the tenant `default`.
    #[arg(long, value_name = "NAME")]
    tenant: Tenant,
    /// Role: uploader (uploads clips, follows their jobs), reader (reads all but webhooks), admin (all).
    #[arg(long, value_name = "uploader|reader|admin")]
    role: Role,
    /// Only home that the key opens; default: all homes of the tenant.
    #[arg(long, value_name = "ID")]
    home: Option<HomeId>,
    /// Label of the key, for people.
    #[arg(long, value_name = "TEXT", default_value = "")]
    label: String,
    /// Lifetime of the key in days; by default it does not expire.
    #[arg(long, value_name = "DAYS", value_parser = clap::value_parser!(u32).range(1..=36500))]
    days: Option<u32>,
}

#[derive(Args)]
struct ListArguments {
    #[command(flatten)]
    store: StoreArguments,
    /// Tenant whose keys are listed; default: all tenants.
    #[arg(long, value_name = "NAME")]
    tenant: Option<Tenant>,
    /// Print a list of objects instead of the table.
    #[arg(long)]
    json: bool,
}

#[derive(Args)]
struct RevokeArguments {
    #[command(flatten)]
    store: StoreArguments,
    /// Id of the key, from `viola keys list`.
    id: Uuid,
}

pub fn run(arguments: &KeysArguments) -> Result<()> {
    match &arguments.command {
        // A service may get its first key before its first start.
        KeysCommand::Create(arguments) => {
            arguments.store.administer_or_create(async |storage| create(storage, arguments).await)
        }
        KeysCommand::List(arguments) => list(arguments),
        KeysCommand::Revoke(arguments) => revoke(arguments),
    }
}

async fn create(storage: &Storage, arguments: &CreateArguments) -> Result<()> {
    let now = storage.now();
    let life = arguments.days.map(|days| SignedDuration::from_hours(24 * i64::from(days)));
    let new = NewKey {
        tenant: arguments.tenant.clone(),
        role: arguments.role,
        home: arguments.home.as_ref().map(|home| arguments.tenant.home(home)),
        label: arguments.label.clone(),
        expires_at: life.map(|life| now + life),
    };
    let (key, secret) = storage.create_key(new, now).await?;
    // The secret is alone on standard output, so that a script can read it.
    to_standard_error(&format!("key {} of tenant {}; it is not shown again:", key.id, key.tenant.name()));
    let shown = writeln!(std::io::stdout(), "{}", secret.show());
    // Nobody has it otherwise, and it would be valid.
    let is_revoked = shown.is_err() && storage.revoke_key(key.id, storage.now()).await.is_ok();
    shown.with_context(|| {
        let state = if is_revoked { "it is revoked" } else { "revoke it with `viola keys revoke`" };
        format!("key {} cannot be shown; {state}, and create another one", key.id)
    })
}

fn list(arguments: &ListArguments) -> Result<()> {
    let (keys, now) = arguments
        .store
        .administer(async |storage| Ok((storage.keys(arguments.tenant.as_ref()).await?, storage.now())))?;
    let document = |key: &ApiKey| {
        json!({"id": key.id, "tenant": key.tenant.name(), "role": key.role.name(),
            "home": key.home.as_ref().map(HomeId::as_str), "state": state(key, now),
            "expires_at": key.expires_at, "last_used_at": key.last_used_at, "label": key.label})
    };
    let when =
        |at: Option<Timestamp>| at.map_or("never".to_owned(), |at| at.strftime("%Y-%m-%d %H:%M").to_string());
    let head = ["id", "tenant", "role", "home", "state", "expires", "last used", "label"];
    output::print_list(&keys, arguments.json, document, head, |key| {
        [
            key.id.to_string(),
            key.tenant.name().to_owned(),
            key.role.name().to_owned(),
            key.home.as_ref().map_or("all", HomeId::as_str).to_owned(),
            state(key, now).to_owned(),
            when(key.expires_at),
            when(key.last_used_at),
            key.label.clone(),
        ]
    })
}

fn state(key: &ApiKey, now: Timestamp) -> &'static str {
    match (key.revoked_at, key.is_valid(now)) {
        (Some(_), _) => "revoked",
        (None, true) => "valid",
        (None, false) => "expired",
    }
}

fn revoke(arguments: &RevokeArguments) -> Result<()> {
    let id = arguments.id;
    let was_there =
        arguments.store.administer(async |storage| Ok(storage.revoke_key(id, storage.now()).await?))?;
    if !was_there {
        bail!("no key has the id {id}; `viola keys list` shows those there are");
    }
    println!("{id} is revoked");
    Ok(())
}
