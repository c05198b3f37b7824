//! The sample table of a track (ISO/IEC 14496-12, section 8.6 and 8.7): the offset, presentation time and
//! sync flag of each coded picture.

use super::boxes::{self, Box};
use super::{MAX_FRAMES, VideoError};
use mp4_atom::{Co64, Ctts, Stco, Stsc, Stss, Stsz, StszSamples, Stts};

/// Coded pictures of the allowed sizes are not larger.
const MAX_SAMPLE_BYTES: u32 = 32 << 20;

/// One coded picture, in the order of decoding.
#[derive(Debug, Clone, Copy)]
pub struct Sample {
    /// Offset from the region's start, in bytes.
    pub offset: u64,
    pub bytes: u32,
    /// Presentation time in units of the track's time scale, before the edit list.
    pub shown_at: i64,
    /// True if decoding may begin here, according to the file.
    pub sync: bool,
}

/// Returns all samples of a track, in decoding order. Every one lies within `region_bytes`.
pub fn read(stbl: &[Box<'_>], region_bytes: u64) -> Result<Vec<Sample>, VideoError> {
    let sizes = sizes(stbl)?;
    let offsets = offsets(stbl, &sizes)?;
    let times = times(stbl, sizes.len())?;
    // Without a table of sync samples every sample is one.
    let sync: Option<Stss> = boxes::read(stbl, "stss")?;
    let mut samples: Vec<Sample> = (sizes.iter().zip(offsets).zip(times))
        .map(|((&bytes, offset), shown_at)| Sample { offset, bytes, shown_at, sync: sync.is_none() })
        .collect();
    for number in sync.iter().flat_map(|table| &table.entries) {
        let at = (*number as usize).checked_sub(1);
        let sample = at.and_then(|at| samples.get_mut(at));
        sample.ok_or(VideoError::malformed("a sync sample that is not there"))?.sync = true;
    }
    for sample in &samples {
        let end = sample.offset.checked_add(u64::from(sample.bytes));
        if end.is_none_or(|end| end > region_bytes) {
            return Err(VideoError::Truncated);
        }
    }
    Ok(samples)
}

fn sizes(stbl: &[Box<'_>]) -> Result<Vec<u32>, VideoError> {
    // The count is checked before the table is read, because reading allocates memory for it.
    let table = boxes::find(stbl, b"stsz").ok_or(VideoError::malformed("no sample sizes"))?;
    let count = table.body.get(8..12).ok_or(VideoError::malformed("stsz"))?;
    let count = count.iter().fold(0u64, |count, byte| count << 8 | u64::from(*byte));
    if count > MAX_FRAMES as u64 {
        return Err(VideoError::TooManyFrames { frames: count });
    }
    let table: Option<Stsz> = boxes::read(stbl, "stsz")?;
    let sizes = match table.map(|table| table.samples) {
        Some(StszSamples::Different { sizes }) => sizes,
        Some(StszSamples::Identical { count, size }) => vec![size; count as usize],
        None => return Err(VideoError::malformed("no sample sizes")),
    };
    if let Some(bytes) = sizes.iter().find(|bytes| **bytes > MAX_SAMPLE_BYTES) {
        let (bytes, max) = (u64::from(*bytes), u64::from(MAX_SAMPLE_BYTES));
        return Err(VideoError::TooLarge { what: "largest picture", bytes, max });
    }
    if sizes.contains(&0) {
        return Err(VideoError::malformed("a sample without bytes"));
    }
    if sizes.is_empty() {
        return Err(VideoError::malformed("a track without samples"));
    }
    Ok(sizes)
}

/// Returns the samples' offsets: they lie one after the other in chunks, whose offsets the file has.
fn offsets(stbl: &[Box<'_>], sizes: &[u32]) -> Result<Vec<u64>, VideoError> {
    const DAMAGED: &str = "the table of chunks";
    let chunks: Vec<u64> = match boxes::read::<Stco>(stbl, DAMAGED)? {
        Some(table) => table.entries.iter().map(|at| u64::from(*at)).collect(),
        None => boxes::read::<Co64>(stbl, DAMAGED)?.ok_or(VideoError::malformed("no chunks"))?.entries,
    };
    let runs = boxes::read::<Stsc>(stbl, DAMAGED)?.ok_or(VideoError::malformed("no chunks"))?.entries;
    if runs.iter().any(|run| run.sample_description_index != 1) {
        return Err(VideoError::SeveralDescriptions);
    }
    let ordered = runs.windows(2).all(|pair| pair[0].first_chunk < pair[1].first_chunk);
    if !ordered || runs.first().is_none_or(|run| run.first_chunk != 1) {
        return Err(VideoError::malformed(DAMAGED));
    }
    let mut offsets = Vec::with_capacity(sizes.len());
    let mut left = sizes.iter();
    for (i, run) in runs.iter().enumerate() {
        if run.samples_per_chunk == 0 {
            return Err(VideoError::malformed("a chunk without samples"));
        }
        let end = runs.get(i + 1).map_or(chunks.len(), |next| next.first_chunk as usize - 1);
        for chunk in chunks.get(run.first_chunk as usize - 1..end).unwrap_or_default() {
            let mut at = *chunk;
            for bytes in left.by_ref().take(run.samples_per_chunk as usize) {
                offsets.push(at);
                at = at.checked_add(u64::from(*bytes)).ok_or(VideoError::Truncated)?;
            }
        }
    }
    if offsets.len() < sizes.len() {
        return Err(VideoError::malformed("samples without a chunk"));
    }
    Ok(offsets)
}

/// Returns each sample's presentation time: its decoding time and its offset.
fn times(stbl: &[Box<'_>], count: usize) -> Result<Vec<i64>, VideoError> {
    let steps: Stts = boxes::read(stbl, "stts")?.ok_or(VideoError::malformed("no times"))?;
    let mut times = Vec::with_capacity(count);
    let mut now = 0i64;
    for step in &steps.entries {
        for _ in 0..(step.sample_count as usize).min(count - times.len()) {
            times.push(now);
            now += i64::from(step.sample_delta);
        }
    }
    if times.len() < count {
        return Err(VideoError::malformed("samples without a time"));
    }
    if let Some(table) = boxes::read::<Ctts>(stbl, "ctts")? {
        let mut left = times.iter_mut();
        for entry in &table.entries {
            for time in left.by_ref().take(entry.sample_count as usize) {
                // Old writers put negative offsets into the table of unsigned ones.
                *time += i64::from(entry.sample_offset as i32);
            }
        }
    }
    Ok(times)
}
