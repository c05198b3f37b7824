//! Points as PCD.
#![no_main]

use viola_fuzz::check;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| check(&[b"# .PCD v0.7\n", bytes].concat()));
