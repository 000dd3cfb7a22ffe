//! The corpus that fuzzing has found runs through what must hold of the parsers, on any toolchain.

use std::fs;
use std::path::Path;

#[path = "../../../fuzz/src/lib.rs"]
mod checks;

fn run(target: &str, check: fn(&[u8])) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../fuzz/corpus")
        .join(target);
    let entries =
        fs::read_dir(&folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut count = 0;
    for entry in entries {
        let path = entry.expect("an entry").path();
        let bytes = fs::read(&path).expect("a kept input");
        // Its name is in the output of a test that fails.
        println!("{}", path.display());
        check(&bytes);
        count += 1;
    }
    assert!(count > 20, "{target}: {count} inputs kept");
}

#[test]
fn corpus_of_parse_two() {
    run("parse_two", checks::parse_two);
}

#[test]
fn corpus_of_parse_one() {
    run("parse_one", checks::parse_one);
}

#[test]
fn corpus_of_noise_two() {
    run("noise_two", checks::noise_two);
}

#[test]
fn corpus_of_noise_one() {
    run("noise_one", checks::noise_one);
}
