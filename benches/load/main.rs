//! Load tests of the service: `cargo run --release --example load -- COMMAND`.
//!
//! - `queue POSTGRES_URL`: claims per second of sixteen workers at once, and the latency until an idle worker
//!   of another process starts a new job.
//! - `reads BASE RATE SECONDS PATH...`: sends RATE requests per second at fixed times (open loop), and
//!   measures from each due time to the last byte.

mod queue;
mod reads;

use std::time::Duration;

/// Percentiles of times.
pub struct Times(Vec<Duration>);

impl Times {
    pub fn new(mut times: Vec<Duration>) -> Times {
        times.sort_unstable();
        Times(times)
    }

    fn at(&self, share: f64) -> f64 {
        let last = self.0.len().saturating_sub(1);
        let index = (share * last as f64).round() as usize;
        self.0.get(index).map_or(f64::NAN, |time| time.as_secs_f64() * 1e3)
    }
}

impl std::fmt::Display for Times {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [median, p99, max] = [0.5, 0.99, 1.0].map(|share| self.at(share));
        write!(formatter, "median {median:.1} ms, 99 % {p99:.1} ms, longest {max:.1} ms")
    }
}

fn usage() -> ! {
    eprintln!("load queue POSTGRES_URL | load reads BASE RATE SECONDS PATH...");
    std::process::exit(2);
}

fn number(text: &str) -> u64 {
    text.parse().unwrap_or_else(|_| usage())
}

#[tokio::main]
async fn main() -> anyhow::Result<()> {
    viola_storage::tls::use_ring();
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match arguments.as_slice() {
        ["queue", url] => queue::run(url).await,
        ["reads", base, rate, seconds, paths @ ..] if !paths.is_empty() => {
            reads::run(base, number(rate), number(seconds), paths).await
        }
        _ => usage(),
    }
}
