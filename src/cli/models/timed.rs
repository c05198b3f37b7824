//! A network that measures the time of its runs.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;
use viola_network::{Network, NetworkError, Tensor, TensorInfo};

pub(super) struct Timed {
    network: Arc<dyn Network>,
    last_ns: AtomicU64,
}

impl Timed {
    pub(super) fn new(network: Arc<dyn Network>) -> Arc<Timed> {
        Arc::new(Timed { network, last_ns: AtomicU64::new(0) })
    }

    /// Returns the time of the last run in milliseconds.
    pub(super) fn last_ms(&self) -> f64 {
        self.last_ns.load(Ordering::Relaxed) as f64 * 1e-6
    }
}

impl Network for Timed {
    fn inputs(&self) -> &[TensorInfo] {
        self.network.inputs()
    }

    fn outputs(&self) -> &[TensorInfo] {
        self.network.outputs()
    }

    fn run(&self, inputs: &[(&str, Tensor)]) -> Result<Vec<(String, Tensor)>, NetworkError> {
        let start = Instant::now();
        let outputs = self.network.run(inputs);
        self.last_ns.store(start.elapsed().as_nanos() as u64, Ordering::Relaxed);
        outputs
    }

    fn runtime(&self) -> &str {
        self.network.runtime()
    }

    fn reason(&self) -> &str {
        self.network.reason()
    }
}
