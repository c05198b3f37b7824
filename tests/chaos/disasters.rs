//! What goes wrong.

use crate::common::postgres::Schema;
use crate::common::s3_server::{Fault, Faults, S3Server, When};
use crate::fleet::{Fleet, PROCESSES};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;
use std::time::Duration;

/// One disaster.
pub async fn strike(fleet: &Arc<Fleet>, bucket: &S3Server, schema: &Schema, random: &mut ChaCha8Rng) {
    match random.random_range(0..10) {
        0..4 => {
            let (fleet, number) = (fleet.clone(), random.random_range(0..PROCESSES));
            tokio::task::spawn_blocking(move || fleet.kill(number)).await.unwrap();
        }
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
        _ => bucket.heal(),
    }
}
