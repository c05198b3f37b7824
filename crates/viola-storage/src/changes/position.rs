//! Positions in the changes feed, and whether its numbers are still those that a reader saw.
//!
//! A database that is restored from a copy assigns numbers again that readers have seen, for other changes. So each start of
//! a process begins an epoch, after the numbers assigned so far, and a position names the newest epoch of its reading. It is of
//! the database's past if its epoch is known and no later one begins before its number.

use super::super::database::{Connection, query};
use super::super::{Storage, StorageError};
use super::{TOLD, lock_counter};
use jiff::Timestamp;
use std::fmt;
use std::str::FromStr;
use uuid::Uuid;

/// A number of the feed, as one reading saw it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FeedPosition {
    pub seq: i64,
    /// Nil in positions of versions without epochs.
    epoch: Uuid,
}

impl fmt::Display for FeedPosition {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}.{}", self.seq, self.epoch.simple())
    }
}

impl FromStr for FeedPosition {
    type Err = ();

    fn from_str(text: &str) -> Result<FeedPosition, ()> {
        let (seq, epoch) = match text.split_once('.') {
            Some((seq, epoch)) => (seq, epoch.parse().map_err(|_| ())?),
            None => (text, Uuid::nil()),
        };
        let seq = seq.parse().ok().filter(|seq| *seq >= 0).ok_or(())?;
        Ok(FeedPosition { seq, epoch })
    }
}

impl FeedPosition {
    /// Returns the position of another number, as the same reading saw it.
    pub fn at(self, seq: i64) -> FeedPosition {
        FeedPosition { seq, ..self }
    }

    /// Returns whether the feed still has the numbers up to this one as they were.
    pub(super) async fn is_of_past(&self, connection: &mut Connection) -> Result<bool, StorageError> {
        let known = query(
            "SELECT id FROM feed_epochs own, change_counter WHERE id = $1 AND last_seq >= $2 AND NOT EXISTS
                (SELECT 1 FROM feed_epochs later WHERE later.number > own.number AND later.from_seq < $2)",
        );
        let known = known.bind(self.epoch.to_string()).bind(self.seq);
        Ok(known.fetch_optional(connection).await?.is_some())
    }
}

/// Returns the end of the feed.
pub(super) async fn end(connection: &mut Connection) -> Result<FeedPosition, StorageError> {
    let row = query("SELECT last_seq, id FROM change_counter, feed_epochs ORDER BY number DESC LIMIT 1");
    let row = row.fetch_one(connection).await?;
    Ok(FeedPosition { seq: row.number("last_seq")?, epoch: row.id("id")? })
}

impl Storage {
    /// Begins an epoch: a process starts, perhaps on a restored database.
    pub(crate) async fn begin_epoch(&self, now: Timestamp) -> Result<(), StorageError> {
        let mut transaction = self.database.begin().await?;
        // Processes that start at once take turns, and no number is assigned meanwhile.
        let last = lock_counter(&mut transaction).await?;
        // All cursors of epochs that ended so long ago have expired.
        query(
            "DELETE FROM feed_epochs
            WHERE number < (SELECT MAX(number) FROM feed_epochs later WHERE later.begun_at <= $1)",
        )
        .bind((now - TOLD).as_millisecond())
        .execute(&mut transaction)
        .await?;
        query(
            "INSERT INTO feed_epochs (number, id, from_seq, begun_at)
            SELECT MAX(number) + 1, $1, $2, $3 FROM feed_epochs",
        )
        .bind(Uuid::now_v7().to_string())
        .bind(last)
        .bind(now.as_millisecond())
        .execute(&mut transaction)
        .await?;
        transaction.commit().await
    }

    /// Returns the position from which the changes of a home are told to a reader that has `seen` them up to one: all that
    /// is there, if the numbers are others now; the end without any. Numbers that a stream told after another process had
    /// started count as others, too: what is told twice does no harm.
    pub async fn home_position(&self, seen: Option<FeedPosition>) -> Result<FeedPosition, StorageError> {
        self.number_changes().await?;
        let mut snapshot = self.database.snapshot().await?;
        let end = end(&mut snapshot).await?;
        Ok(match seen {
            None => end,
            Some(seen) if seen.is_of_past(&mut snapshot).await? => end.at(seen.seq),
            Some(_) => end.at(0),
        })
    }
}
