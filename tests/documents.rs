//! The documents for those who carry on name files that exist.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Words in backticks, and link targets, that look like files of this repository.
fn named_files(markdown: &str) -> BTreeSet<String> {
    const ENDINGS: [&str; 9] = [
        ".rs", ".toml", ".md", ".urdf", ".json", ".jsonl", ".csv", ".sh", ".svg",
    ];
    let mut in_block = false;
    let mut words = Vec::new();
    for line in markdown.lines() {
        in_block ^= line.trim_start().starts_with("```");
        if in_block {
            continue;
        }
        words.extend(line.split('`').skip(1).step_by(2));
        let targets = line.split("](").skip(1).filter_map(|t| t.split(')').next());
        words.extend(targets.map(|t| t.split('#').next().unwrap_or_default()));
    }
    let is_file = |word: &&str| {
        let looks = word.contains('/') || ENDINGS.iter().any(|e| word.ends_with(e));
        let placeholder = word
            .split(['/', '.'])
            .any(|part| part.len() > 1 && part.chars().all(|c| c.is_ascii_uppercase() || c == '_'))
            && !root().join(word).exists()
            && !["README.md", "CONTRIBUTING.md", "LICENSE"].contains(word);
        looks
            && !placeholder
            && !word.starts_with(['/', '~', '-', '.'])
            && !word.contains([' ', '*', '<', '{', '$', ':', '(', '@', '='])
    };
    let files = words.into_iter().filter(is_file);
    files.map(|w| w.trim_end_matches('/').to_owned()).collect()
}

fn missing_files(document: &Path, markdown: &str) -> Vec<String> {
    let beside = document.parent().unwrap_or(root());
    let places: [PathBuf; 4] = [
        root().into(),
        root().join("src"),
        root().join("configs"),
        beside.into(),
    ];
    let is_missing = |name: &String| !places.iter().any(|p| p.join(name).exists());
    named_files(markdown)
        .into_iter()
        .filter(is_missing)
        .collect()
}

#[test]
fn the_documents_name_files_that_exist() {
    let made_up =
        "See `src/lib.rs`, `live/nowhere.rs` and [this](gone.md); not `NAME.toml` or `a::b`.";
    let missing = missing_files(&root().join("docs/x.md"), made_up);
    assert_eq!(missing, ["gone.md", "live/nowhere.rs"]);
    for name in ["docs/architecture.md", "CONTRIBUTING.md"] {
        let path = root().join(name);
        let text = fs::read_to_string(&path).unwrap_or_else(|e| panic!("{name}: {e}"));
        let missing = missing_files(&path, &text);
        assert!(
            missing.is_empty(),
            "{name} names files that do not exist: {missing:?}"
        );
        let named = named_files(&text).len();
        assert!(named > 3, "{name} names only {named} files");
    }
}
