//! Points with a path.
#![no_main]

use viola_fuzz::check_layout;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| check_layout("clip_points", bytes));
