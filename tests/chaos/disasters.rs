//! Disasters.

use crate::fleet::Fleet;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;
use std::time::Duration;
use viola_testing::postgres::Schema;
use viola_testing::s3_server::{Fault, Faults, S3Server, When};

async fn kill_one(fleet: &Arc<Fleet>, random: &mut ChaCha8Rng) {
    let (fleet, number) = (fleet.clone(), random.random_range(0..fleet.size()));
    tokio::task::spawn_blocking(move || fleet.kill(number)).await.unwrap();
}

/// Strikes many processes on PostgreSQL and a bucket with one disaster.
pub async fn strike(fleet: &Arc<Fleet>, bucket: &S3Server, schema: &Schema, random: &mut ChaCha8Rng) {
    // The database's disk is full until the next disaster.
    schema.free_disk().await;
    match random.random_range(0..12) {
        0..4 => kill_one(fleet, random).await,
        4..6 => schema.cut_connections().await,
        6..8 => bucket.fail(Faults {
            seed: random.random(),
            when: When::Share(0.2),
            kinds: vec![Fault::Refuse(500), Fault::Refuse(503), Fault::Deny, Fault::Cut, Fault::CutAfter],
        }),
        8 => bucket.fail(Faults {
            seed: random.random(),
            when: When::Share(0.3),
            kinds: vec![Fault::Slow(Duration::from_millis(random.random_range(50..800)))],
        }),
        9 => schema.fill_disk().await,
        // The bucket's disk is full.
        10 => bucket.fail(Faults {
            seed: random.random(),
            when: When::Method("PUT"),
            kinds: vec![Fault::Refuse(507)],
        }),
        _ => bucket.heal(),
    }
}

/// Strikes a process alone on its disk with one disaster.
pub async fn strike_alone(fleet: &Arc<Fleet>, random: &mut ChaCha8Rng) {
    match random.random_range(0..10) {
        0..3 => kill_one(fleet, random).await,
        3..7 => {
            let fleet = fleet.clone();
            tokio::task::spawn_blocking(move || fleet.fill_disk()).await.unwrap();
        }
        _ => fleet.free_disk(),
    }
}
