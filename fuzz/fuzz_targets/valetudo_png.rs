//! The chunks of a PNG with Valetudo's JSON in it.
#![no_main]

use viola_fuzz::check;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| check(&[b"\x89PNG\r\n\x1a\n", bytes].concat()));
