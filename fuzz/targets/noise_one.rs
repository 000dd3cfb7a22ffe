//! See `noise_one` in the library.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| handwave_fuzz::noise_one(bytes));
