//! The order of jobs: priorities, and fair turns of homes and tenants.

use crate::database::{Transaction, query};
use crate::{HomeId, StorageError};
use jiff::SignedDuration;

/// Delay of a job in the queue for each job that comes before it: about the duration of one job.
pub(super) const TURN: SignedDuration = SignedDuration::from_secs(5);

/// Most jobs that are counted to find a turn; more make no difference.
const MAX_TURNS: i64 = 2_000;

/// Priority of a job: a limited lead in the queue, so that no job waits for ever.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Priority {
    /// A client asked for this clip and may be waiting.
    Asked,
    /// A clip without an answer.
    Uploaded,
    /// A clip with an answer, for a new LiDAR map. Clients read its last answer meanwhile.
    Again,
}

impl Priority {
    /// Returns the lead of a job over one whose clip was just uploaded.
    pub(super) fn lead(self) -> SignedDuration {
        match self {
            Priority::Asked => SignedDuration::from_mins(10),
            Priority::Uploaded => SignedDuration::ZERO,
            // Longer than the clips of a fleet need whose robots send new maps in one night; less than the day after which
            // the next maps replace these jobs.
            Priority::Again => SignedDuration::from_hours(-12),
        }
    }
}

/// Number of jobs before a new one.
pub(super) struct Turn {
    /// Jobs of its own home.
    pub in_home: i32,
    /// Jobs of its tenant that are not further back in their own homes than it is in its home.
    pub of_tenant: i32,
}

/// The fair turns of a home's next jobs. A home with many jobs delays only its own: the first job of a
/// home comes before the second of any other home of its tenant, and the first job of a tenant before the
/// second of any other. Time passes for all of them alike, so no job waits for ever. Jobs with [`Priority::Again`] delay
/// only others of this priority.
pub(super) struct Turns {
    /// Unfinished jobs of the home.
    in_home: i32,
    /// Positions of the tenant's unfinished jobs in their own homes, ascending.
    positions: Vec<i32>,
}

impl Turns {
    /// Counts for the next `jobs` jobs of a home at once: a count for each would read all earlier ones again.
    pub(super) async fn of(
        transaction: &mut Transaction,
        home: &HomeId,
        priority: Priority,
        jobs: usize,
    ) -> Result<Turns, StorageError> {
        let is_again = priority == Priority::Again;
        let in_home = query(
            "SELECT COUNT(*) AS jobs FROM (
                SELECT jobs.id FROM jobs JOIN clips ON clips.id = jobs.clip_id
                WHERE clips.home_id = $1 AND clips.state IN ('queued', 'aligning')
                    AND jobs.state IN ('queued', 'running') AND jobs.again <= $3
                LIMIT $2) AS unfinished",
        );
        let in_home = in_home.bind(home.key()).bind(MAX_TURNS).bind(i64::from(is_again));
        let in_home: i32 = in_home.fetch_one(transaction).await?.count("jobs")?;
        let of_tenant = query(if is_again {
            "SELECT position FROM jobs WHERE tenant = $1 AND position < $2 AND state IN ('queued', 'running')
            ORDER BY position LIMIT $3"
        } else {
            "SELECT position FROM jobs
            WHERE tenant = $1 AND position < $2 AND again = 0 AND state IN ('queued', 'running')
            ORDER BY position LIMIT $3"
        });
        let last = i64::from(in_home) + jobs as i64;
        let rows = of_tenant.bind(home.tenant()).bind(last).bind(MAX_TURNS).fetch_all(transaction).await?;
        let positions: Result<Vec<i32>, _> = rows.iter().map(|row| row.count("position")).collect();
        Ok(Turns { in_home, positions: positions? })
    }

    /// Returns the turn of the next job after `earlier` ones that were queued since the count.
    pub(super) fn turn(&self, earlier: usize) -> Turn {
        let at_most = |jobs: usize| jobs.min(MAX_TURNS as usize) as i32;
        let in_home = at_most(self.in_home as usize + earlier);
        let before = self.positions.partition_point(|position| *position <= in_home);
        Turn { in_home, of_tenant: at_most(before + earlier) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_count_the_jobs_that_are_not_further_back() {
        let turns = Turns { in_home: 1, positions: vec![0, 0, 1, 5] };
        // Those at positions up to its own, and those that were queued since the count.
        for (earlier, in_home, of_tenant) in [(0, 1, 3), (1, 2, 3 + 1), (4, 5, 4 + 4), (5_000, 2_000, 2_000)]
        {
            let turn = turns.turn(earlier);
            assert_eq!((turn.in_home, turn.of_tenant), (in_home, of_tenant), "{earlier}");
        }
    }
}
