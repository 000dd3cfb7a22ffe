//! Recordings that lie beside the repository and are too large, or not free enough, to ship.

use std::path::{Path, PathBuf};

/// Such a folder or file; where it is missing the test says loudly that it was skipped.
pub fn shared_data(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../shared/data")
        .join(name);
    if path.exists() {
        return Some(path);
    }
    eprintln!(
        "SKIPPED, NOTHING WAS TESTED: there is no {}",
        path.display()
    );
    None
}
