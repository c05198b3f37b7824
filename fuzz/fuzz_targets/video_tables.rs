//! The tables of mp4 and mov files.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| viola_fuzz::check_video(bytes, None));
