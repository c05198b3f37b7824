//! Readers of clips and maps: round trips, refusals, mutated bytes, and the real recordings.

#[path = "readers/clips.rs"]
mod clips;
#[path = "readers/drawing.rs"]
mod drawing;
#[path = "readers/hostile_zips.rs"]
mod hostile_zips;
#[path = "readers/maps.rs"]
mod maps;
#[path = "readers/maps_real.rs"]
mod maps_real;
#[path = "readers/maps_refused.rs"]
mod maps_refused;
#[path = "readers/memory.rs"]
mod memory;
#[path = "readers/mutations.rs"]
mod mutations;
#[path = "readers/real.rs"]
mod real;
#[path = "readers/writers.rs"]
mod writers;
