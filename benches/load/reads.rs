//! Open-loop requests at fixed times.

use super::Times;
use std::time::Duration;
use tokio::time::Instant;

pub async fn run(base: &str, rate: u64, seconds: u64, paths: &[&str]) -> anyhow::Result<()> {
    let client = reqwest::Client::new();
    let begun = Instant::now();
    let mut asking = Vec::new();
    for number in 0..rate * seconds {
        let due = begun + Duration::from_secs_f64(number as f64 / rate as f64);
        tokio::time::sleep_until(due).await;
        let request = client.get(format!("{base}{}", paths[number as usize % paths.len()]));
        asking.push(tokio::spawn(async move {
            let response = request.send().await?.error_for_status()?;
            response.bytes().await?;
            Ok::<_, reqwest::Error>(due.elapsed())
        }));
    }
    let mut times = Vec::new();
    let mut failed = 0;
    for answer in asking {
        match answer.await? {
            Ok(time) => times.push(time),
            Err(error) => {
                failed += 1;
                eprintln!("{error}");
            }
        }
    }
    let took = begun.elapsed().as_secs_f64();
    let answered = times.len() as f64 / took;
    println!("{answered:.0} answers a second of {rate} asked, {failed} failed: {}", Times::new(times));
    Ok(())
}
