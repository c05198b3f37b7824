//! Numbers of the command line with bounds.

/// Frames of a clip: the readers take no more.
const MAX_FRAMES: usize = 100_000;
/// More threads than any machine has cores.
const MAX_THREADS: usize = 1024;
/// Parallel jobs of a process: each takes memory and threads of its own.
const MAX_WORKERS: usize = 256;
/// Error of poses after a metre, in metres: more is no pose.
const MAX_DRIFT_M: f64 = 1.0;

/// Parses the number of a clip's frames.
pub fn frames(text: &str) -> Result<usize, String> {
    let frames = text.parse().ok().filter(|frames| (1..=MAX_FRAMES).contains(frames));
    frames.ok_or_else(|| format!("a clip has 1 to {MAX_FRAMES} frames"))
}

/// Parses a number of clips.
pub fn clips(text: &str) -> Result<usize, String> {
    let clips = text.parse().ok().filter(|clips| *clips > 0);
    clips.ok_or_else(|| "the number of clips is at least 1".to_owned())
}

/// Parses a number of threads.
pub fn threads(text: &str) -> Result<usize, String> {
    let threads = text.parse().ok().filter(|threads| (1..=MAX_THREADS).contains(threads));
    threads.ok_or_else(|| format!("the number of threads is 1 to {MAX_THREADS}"))
}

/// Parses a number of workers; a server may have none.
pub fn workers(text: &str) -> Result<usize, String> {
    let workers = text.parse().ok().filter(|workers| (0..=MAX_WORKERS).contains(workers));
    workers.ok_or_else(|| format!("the number of workers is 0 to {MAX_WORKERS}"))
}

/// Parses the error of poses after a metre of path.
pub fn drift_m(text: &str) -> Result<f64, String> {
    let drift_m = text.parse().ok().filter(|drift_m| (0.0..=MAX_DRIFT_M).contains(drift_m));
    drift_m.ok_or_else(|| format!("a drift is 0 to {MAX_DRIFT_M} m"))
}

/// Parses a factor of lengths.
pub fn factor(text: &str) -> Result<f64, String> {
    let factor = text.parse().ok().filter(|factor| (0.01..=100.0).contains(factor));
    factor.ok_or_else(|| "a factor is 0.01 to 100".to_owned())
}

/// Parses a seed.
pub fn seed(text: &str) -> Result<u64, String> {
    text.parse().map_err(|_| format!("a seed is a whole number from 0 to {}", u64::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_bounds() {
        for (text, expected) in
            [("0", None), ("1", Some(1)), ("100000", Some(100_000)), ("100001", None), ("x", None)]
        {
            assert_eq!(frames(text).ok(), expected, "{text}");
        }
        for (text, expected) in [("0", None), ("1", Some(1)), ("-1", None)] {
            assert_eq!(clips(text).ok(), expected, "{text}");
        }
        for (text, expected) in [("0", Some(0)), ("256", Some(256)), ("257", None), ("-1", None)] {
            assert_eq!(workers(text).ok(), expected, "{text}");
        }
        for (text, expected) in [("0", None), ("1", Some(1)), ("1024", Some(1024)), ("1025", None)] {
            assert_eq!(threads(text).ok(), expected, "{text}");
        }
        for (text, expected) in [
            ("0", Some(0)),
            ("18446744073709551615", Some(u64::MAX)),
            ("18446744073709551616", None),
            ("-1", None),
            ("0x10", None),
            ("", None),
        ] {
            assert_eq!(seed(text).ok(), expected, "{text}");
        }
        for (text, expected) in
            [("0", Some(0.0)), ("0.01", Some(0.01)), ("-1", None), ("nan", None), ("1e308", None)]
        {
            assert_eq!(drift_m(text).ok(), expected, "{text}");
        }
    }
}
