//! See `parse_one` in the library.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| handwave_fuzz::parse_one(bytes));
