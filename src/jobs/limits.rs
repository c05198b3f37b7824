//! Limits of one job: a base, and a share for each uploaded byte. Those of a merge grow with its clips.

use std::time::Duration;
use viola_reconstruct::Reason;

const MIB: u64 = 1 << 20;

/// Additional time for each uploaded MiB. A job needs about 0.05 s for it (BENCHMARKS.md).
const TIME_OF_A_MIB: Duration = Duration::from_secs(6);
/// Additional memory for each uploaded byte.
const MEMORY_OF_A_BYTE: u64 = 4;
/// A merge of so many clips has twice the time of one without clips: 12 s for each clip by default. A merge that reads all clips
/// of its home needs a fraction of a second for each, and maybe a hundred times as long on a slow machine with other work.
const CLIPS_OF_TWICE_THE_TIME: u32 = 50;

/// Additional memory of a merge for each clip.
const MEMORY_OF_A_CLIP: u64 = 2 * MIB;

/// Limits of a job whose files are empty.
#[derive(Debug, Clone)]
pub struct JobLimitParams {
    pub time: Duration,
    /// Memory of the job's process, in addition to its loaded networks.
    pub memory_bytes: u64,
    /// Time of a merge without clips, until it writes its files.
    pub merge_time: Duration,
    /// Memory of the process of a merge without clips, in addition to its network.
    pub merge_memory_bytes: u64,
}

impl Default for JobLimitParams {
    fn default() -> JobLimitParams {
        JobLimitParams {
            time: Duration::from_mins(10),
            memory_bytes: 1 << 30,
            merge_time: Duration::from_mins(10),
            merge_memory_bytes: 1 << 30,
        }
    }
}

/// Returns the limits of a merge of so many clips.
pub(super) fn merge_limits(params: &JobLimitParams, clips: usize) -> JobLimits {
    let clips = u32::try_from(clips).unwrap_or(u32::MAX);
    let time = params.merge_time.saturating_mul(clips) / CLIPS_OF_TWICE_THE_TIME;
    JobLimits {
        time: params.merge_time.saturating_add(time),
        memory_bytes: params.merge_memory_bytes.saturating_add(u64::from(clips) * MEMORY_OF_A_CLIP),
    }
}

/// Limits of one job or merge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct JobLimits {
    pub time: Duration,
    pub memory_bytes: u64,
}

impl JobLimits {
    /// Returns the limits of a job whose clip and LiDAR maps have this size.
    pub fn new(params: &JobLimitParams, uploaded_bytes: u64) -> JobLimits {
        let mib = u32::try_from(uploaded_bytes / MIB).unwrap_or(u32::MAX);
        JobLimits {
            time: params.time.saturating_add(TIME_OF_A_MIB.saturating_mul(mib)),
            memory_bytes: params.memory_bytes.saturating_add(uploaded_bytes.saturating_mul(MEMORY_OF_A_BYTE)),
        }
    }

    /// Returns the reason of a job that reached the time limit.
    pub fn took_too_long(&self) -> Reason {
        let detail = format!(
            "the alignment took longer than {:.0} s, the limit for files of this size; send a shorter clip",
            self.time.as_secs_f64()
        );
        Reason::new("took_too_long", detail)
    }

    /// Returns the reason of a job that reached the memory limit.
    pub fn too_large(&self) -> Reason {
        let detail = format!(
            "the alignment needs more memory than it may have, {} MiB for files of this size; send a shorter clip",
            self.memory_bytes / MIB
        );
        Reason::new("too_large", detail)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_grow_with_the_files() {
        let params = JobLimitParams::default();
        let small = JobLimits::new(&params, 1000);
        assert_eq!((small.time, small.memory_bytes), (Duration::from_mins(10), (1 << 30) + 4000));
        let large = JobLimits::new(&params, 100 * MIB);
        assert_eq!((large.time, large.memory_bytes), (Duration::from_mins(20), (1 << 30) + 400 * MIB));
        assert_eq!(JobLimits::new(&params, u64::MAX).memory_bytes, u64::MAX);
        assert!(small.took_too_long().detail.contains("600 s"));
        assert!(small.too_large().detail.contains("1024 MiB"));
    }

    #[test]
    fn the_limits_of_a_merge_grow_with_the_clips() {
        let params = JobLimitParams::default();
        let limits = [0, 5, 50, 1000].map(|clips| merge_limits(&params, clips));
        assert_eq!(limits.map(|limits| limits.time), [10, 11, 20, 210].map(Duration::from_mins));
        assert_eq!(limits.map(|limits| limits.memory_bytes / MIB), [1024, 1034, 1124, 3024]);
        merge_limits(&params, usize::MAX);
    }
}
