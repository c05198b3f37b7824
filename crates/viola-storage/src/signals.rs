//! Signals between processes: work is due, or something changed. No process depends on them: each one also
//! polls.

use super::database::query;
use super::{Storage, StorageError};
use sqlx::postgres::PgListener;

/// Kind of a signal to other processes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Signal {
    /// Work is due for a worker.
    Due,
    /// A job or a list changed.
    Changed,
}

impl Signal {
    const ALL: [Signal; 2] = [Signal::Due, Signal::Changed];

    fn channel(self) -> &'static str {
        match self {
            Signal::Due => "viola_due",
            Signal::Changed => "viola_changed",
        }
    }
}

/// Receives the signals of all processes, including its own.
pub struct Signals(PgListener);

impl Signals {
    /// Returns the next signal. It reconnects after a broken connection; signals sent meanwhile are lost.
    pub async fn next(&mut self) -> Result<Signal, StorageError> {
        loop {
            let heard = self.0.recv().await?;
            if let Some(signal) = Signal::ALL.into_iter().find(|signal| signal.channel() == heard.channel()) {
                return Ok(signal);
            }
        }
    }
}

impl Storage {
    /// Starts listening; returns `None` if there is only this process.
    pub async fn signals(&self) -> Result<Option<Signals>, StorageError> {
        let Some(mut listener) = self.database.listener().await? else { return Ok(None) };
        listener.listen_all(Signal::ALL.map(Signal::channel)).await?;
        Ok(Some(Signals(listener)))
    }

    /// Sends a signal to all processes.
    pub async fn notify_processes(&self, signal: Signal) -> Result<(), StorageError> {
        if self.database.is_shared() {
            let notify = query("SELECT pg_notify($1, '')").bind(signal.channel());
            notify.execute(&mut self.database.reader().await?).await?;
        }
        Ok(())
    }
}
