//! A zip of a yaml file and an image; the first zero byte separates the two.
#![no_main]

use viola_fuzz::{check, ros_zip};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| check(&ros_zip(bytes)));
