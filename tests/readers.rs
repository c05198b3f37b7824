//! Readers of clips and maps: round trips, refusals, mutated bytes, and the real recordings.

#[path = "readers/archives.rs"]
mod archives;
#[path = "readers/clips.rs"]
mod clips;
#[path = "readers/clips_written.rs"]
mod clips_written;
#[path = "readers/drawing.rs"]
mod drawing;
#[path = "readers/edits.rs"]
mod edits;
#[path = "readers/export_writers.rs"]
mod export_writers;
#[path = "readers/exports.rs"]
mod exports;
#[path = "readers/exports_real.rs"]
mod exports_real;
#[path = "readers/exports_refused.rs"]
mod exports_refused;
#[path = "readers/exports_tolerated.rs"]
mod exports_tolerated;
#[path = "readers/fuzz_seeds.rs"]
mod fuzz_seeds;
#[path = "readers/hostile_archives.rs"]
mod hostile_archives;
#[path = "readers/hostile_zips.rs"]
mod hostile_zips;
#[path = "readers/maps.rs"]
mod maps;
#[path = "readers/maps_carmen.rs"]
mod maps_carmen;
#[path = "readers/maps_cli.rs"]
mod maps_cli;
#[path = "readers/maps_real.rs"]
mod maps_real;
#[path = "readers/maps_refused.rs"]
mod maps_refused;
#[path = "readers/maps_robots.rs"]
mod maps_robots;
#[path = "readers/maps_written.rs"]
mod maps_written;
#[path = "readers/memory.rs"]
mod memory;
#[path = "readers/mutations.rs"]
mod mutations;
#[path = "readers/real.rs"]
mod real;
#[path = "readers/recording.rs"]
mod recording;
#[path = "readers/refusals.rs"]
mod refusals;
#[path = "readers/robot_files.rs"]
mod robot_files;
#[path = "readers/sens_refused.rs"]
mod sens_refused;
#[path = "readers/spectacular_refused.rs"]
mod spectacular_refused;
#[path = "readers/streaming.rs"]
mod streaming;
#[path = "readers/writers.rs"]
mod writers;
