//! Two servers and two workers on PostgreSQL and S3, of which any may be killed at any moment, while the database's
//! connections are cut, the bucket fails and dawdles, and twenty clients go on. At the end nothing that was acknowledged
//! is missing or undone, and a webhook was told all of it.
//!
//! `VIOLA_CHAOS_SECONDS` says for how long (20), `VIOLA_CHAOS_SEED` which disasters.

mod common;

#[path = "chaos/clients.rs"]
mod clients;
#[path = "chaos/disasters.rs"]
mod disasters;
#[path = "chaos/fleet.rs"]
mod fleet;
#[path = "chaos/hooks.rs"]
mod hooks;

use clients::Ledger;
use common::postgres::Schema;
use common::s3_server::S3Server;
use fleet::Fleet;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

const CLIENTS: u64 = 20;

fn setting(name: &str, default: u64) -> u64 {
    std::env::var(name).map_or(default, |text| text.parse().expect("a number"))
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn nothing_acknowledged_is_lost() {
    let Some(schema) = Schema::new().await else { return };
    let (seconds, seed) = (setting("VIOLA_CHAOS_SECONDS", 20), setting("VIOLA_CHAOS_SEED", 1));
    let bucket = S3Server::start();
    let fleet = Arc::new(Fleet::start(&schema, &bucket).await);
    let hooks = hooks::Hooks::start(&fleet).await;
    let ledger = Arc::new(Ledger::default());
    let over = Arc::new(AtomicBool::new(false));
    let begun = Instant::now();

    let clients: Vec<_> = (0..CLIENTS)
        .map(|number| {
            let (fleet, ledger, over) = (fleet.clone(), ledger.clone(), over.clone());
            let random = ChaCha8Rng::seed_from_u64(seed ^ (number + 1) << 32);
            tokio::spawn(clients::go_on(number, fleet, ledger, random, over))
        })
        .collect();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut disasters = 0;
    while begun.elapsed() < Duration::from_secs(seconds) {
        let pause = Duration::from_millis(random.random_range(200..1500));
        disasters::strike(&fleet, &bucket, &schema, &mut random).await;
        disasters += 1;
        tokio::time::sleep(pause).await;
    }
    bucket.heal();
    over.store(true, Ordering::Relaxed);
    for client in clients {
        client.await.expect("a client's own checks hold");
    }
    fleet.settle().await;
    let report = ledger.check(&fleet).await;
    let told = hooks.check(&fleet).await;
    fleet.check_logs(&ledger);
    fleet.clean_twice();
    println!(
        "{seconds} s, seed {seed}: {disasters} disasters, {} processes killed; {report}; {told}",
        fleet.killed.load(Ordering::Relaxed)
    );
    drop(fleet);
    schema.remove().await;
}
