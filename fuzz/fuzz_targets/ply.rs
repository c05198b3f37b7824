//! Points as PLY.
#![no_main]

use viola_fuzz::check;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| check(&[b"ply\n", bytes].concat()));
