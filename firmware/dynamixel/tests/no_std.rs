//! The codec runs where there is no operating system: it takes nothing from `std` or `alloc` outside its tests.

use std::fs;
use std::path::Path;

#[test]
fn only_tests_see_the_standard_library() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let lib = fs::read_to_string(source.join("lib.rs")).expect("the crate's root");
    assert!(lib.lines().any(|line| line == "#![no_std]"));
    // Without an `extern crate` nothing of them can be named, so the crate's root decides.
    let mut folders = vec![source];
    let mut files = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).expect("the crate's sources") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else {
                files.push(path);
            }
        }
    }
    for path in files {
        let text = fs::read_to_string(&path).expect("a source file");
        let lines: Vec<&str> = text.lines().map(str::trim).collect();
        for (number, line) in lines.iter().enumerate() {
            if line.contains("extern crate") {
                let before = number.checked_sub(1).map(|before| lines[before]);
                let place = format!("{}:{}", path.display(), number + 1);
                assert_eq!(before, Some("#[cfg(test)]"), "{place}");
            }
        }
    }
}

#[test]
fn there_are_no_dependencies() {
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join("Cargo.toml");
    let manifest = fs::read_to_string(manifest).expect("the crate's manifest");
    let (_, behind) = manifest
        .split_once("[dependencies]\n")
        .expect("a section for them");
    let section = behind.split("\n[").next().unwrap_or_default();
    assert_eq!(section.trim(), "");
}
