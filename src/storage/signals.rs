//! Telling the other processes that there is something to do or to look at. Nothing depends on it: who hears nothing
//! looks by itself from time to time.

use super::database::query;
use super::{Storage, StorageError};
use sqlx::postgres::PgListener;

/// What another process may want to know.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Signal {
    /// Something is due for a worker.
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

/// Hears the signals of all processes, its own too.
pub struct Signals(PgListener);

impl Signals {
    /// The next one. After a connection that broke, it goes on with a new one; what was told meanwhile is lost.
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
    /// Begins to listen; none where there is but this process.
    pub async fn signals(&self) -> Result<Option<Signals>, StorageError> {
        let Some(mut listener) = self.database.listener().await? else { return Ok(None) };
        listener.listen_all(Signal::ALL.map(Signal::channel)).await?;
        Ok(Some(Signals(listener)))
    }

    /// Tells all processes.
    pub async fn tell(&self, signal: Signal) -> Result<(), StorageError> {
        if self.database.is_shared() {
            let notify = query("SELECT pg_notify($1, '')").bind(signal.channel());
            notify.execute(&mut self.database.reader().await?).await?;
        }
        Ok(())
    }
}
