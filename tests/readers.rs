//! Readers of clips and maps: round trips, refusals, mutated bytes, and the real recordings.

#[path = "readers/clips.rs"]
mod clips;
#[path = "readers/drawing.rs"]
mod drawing;
#[path = "readers/fuzz_seeds.rs"]
mod fuzz_seeds;
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
#[path = "readers/robot_files.rs"]
mod robot_files;
#[path = "readers/writers.rs"]
mod writers;
