//! Roborock's RRMap without its gzip layer, whose checksum no fuzzer guesses.
#![no_main]

use viola_fuzz::check;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| check(&[b"rr\x14\0", bytes].concat()));
