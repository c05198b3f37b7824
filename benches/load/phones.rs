//! Uploads over slow connections.

use super::Times;
use bytes::Bytes;
use std::time::{Duration, Instant};

/// Slow connection: `PIECE` bytes, twenty times a second.
const PIECE: usize = 4096;
const EVERY: Duration = Duration::from_millis(50);

pub async fn run(base: &str, count: u64, seconds: u64, home: &str) -> anyhow::Result<()> {
    let pieces = seconds * 20;
    let client = reqwest::Client::new();
    let sending = (0..count).map(|_| {
        let stream = futures::stream::unfold(0, move |sent| async move {
            if sent == pieces {
                return None;
            }
            tokio::time::sleep(EVERY).await;
            Some((Ok::<_, std::io::Error>(Bytes::from_static(&[7; PIECE])), sent + 1))
        });
        let request =
            client.post(format!("{base}/v1/homes/{home}/clips")).body(reqwest::Body::wrap_stream(stream));
        tokio::spawn(async move {
            let begun = Instant::now();
            let status = request.send().await?.status();
            Ok::<_, reqwest::Error>((status.as_u16(), begun.elapsed()))
        })
    });
    let sending: Vec<_> = sending.collect();
    let mut times = Vec::new();
    let mut statuses = std::collections::BTreeMap::<u16, u64>::new();
    for phone in sending {
        let (status, time) = phone.await??;
        *statuses.entry(status).or_default() += 1;
        times.push(time);
    }
    println!(
        "{count} phones with {} KiB each, by status {statuses:?}: {}",
        pieces as usize * PIECE / 1024,
        Times::new(times)
    );
    Ok(())
}
