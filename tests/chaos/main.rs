//! Chaos: two servers and two workers on PostgreSQL and S3 are killed at any moment, the database's
//! connections are cut and its disk is full, the bucket fails and is slow, and twenty clients continue. The
//! same with one process on SQLite whose disk is filled and freed. At the end nothing acknowledged is missing
//! or undone, and a webhook received the newest change of each item.
//!
//! `VIOLA_CHAOS_SECONDS` sets the length of each test (20), `VIOLA_CHAOS_SEED` the disasters.

mod clients;
mod disasters;
mod fleet;
mod hooks;

use clients::Ledger;
use fleet::Fleet;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use viola_testing::disk::{Disk, LimitedDisk, SmallDisk};
use viola_testing::postgres::Schema;
use viola_testing::s3_server::S3Server;

const CLIENTS: u64 = 20;

/// One fleet at a time: deadlines are those of a machine with two cores.
static TURN: tokio::sync::Mutex<()> = tokio::sync::Mutex::const_new(());

fn setting(name: &str, default: u64) -> u64 {
    std::env::var(name).map_or(default, |text| text.parse().expect("a number"))
}

fn seconds() -> u64 {
    setting("VIOLA_CHAOS_SECONDS", 20)
}

/// Runs clients and disasters until the time is over and `heal` has ended the last one; then compares the
/// stored state with the promises.
async fn survive(
    fleet: Arc<Fleet>,
    mut strike: impl AsyncFnMut(&mut ChaCha8Rng),
    heal: impl AsyncFnOnce(),
) -> String {
    let (seconds, seed) = (seconds(), setting("VIOLA_CHAOS_SEED", 1));
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
        strike(&mut random).await;
        disasters += 1;
        tokio::time::sleep(pause).await;
    }
    heal().await;
    over.store(true, Ordering::Relaxed);
    for client in clients {
        client.await.expect("a client's own checks hold");
    }
    fleet.settle().await;
    let report = ledger.check(&fleet).await;
    let told = hooks.check(&fleet).await;
    fleet.check_logs(&ledger);
    fleet.clean_twice();
    let killed = fleet.killed.load(Ordering::Relaxed);
    format!("{seconds} s, seed {seed}: {disasters} disasters, {killed} processes killed; {report}; {told}")
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn nothing_acknowledged_is_lost() {
    let Some(schema) = Schema::new().await else { return };
    let _turn = TURN.lock().await;
    let bucket = S3Server::start();
    let fleet = Arc::new(Fleet::start(&schema, &bucket));
    schema.prepare_full_disk().await;
    let strike = async |random: &mut ChaCha8Rng| disasters::strike(&fleet, &bucket, &schema, random).await;
    let heal = async || {
        bucket.heal();
        schema.free_disk().await;
    };
    println!("{}", survive(fleet.clone(), strike, heal).await);
    drop(fleet);
    schema.remove().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn nothing_acknowledged_is_lost_on_a_disk_that_fills() {
    let _turn = TURN.lock().await;
    let folder = tempfile::tempdir().unwrap();
    // Twenty clients with three homes of twenty clips each.
    let small = SmallDisk::mount(folder.path(), 600 + (2 * seconds()).min(2000))
        .map(|disk| Box::new(disk) as Box<dyn Disk>);
    let limited = || LimitedDisk::new(folder.path()).map(|disk| Box::new(disk) as Box<dyn Disk>);
    let Some(disk) = small.or_else(limited) else { return };
    let fleet = Arc::new(Fleet::alone(disk));
    let strike = async |random: &mut ChaCha8Rng| disasters::strike_alone(&fleet, random).await;
    println!("{}", survive(fleet.clone(), strike, async || fleet.free_disk()).await);
}
