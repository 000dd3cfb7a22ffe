//! A copy of `configs` in a temporary folder, with edits.

use std::fs;
use std::path::{Path, PathBuf};

pub struct Folder {
    folder: tempfile::TempDir,
}

impl Folder {
    /// A copy of `configs`.
    pub fn of_configs() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let configs = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
        copy(&configs, folder.path());
        Self { folder }
    }

    /// An empty one.
    pub fn empty() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        Self { folder }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn text(&self, name: &str) -> String {
        self.path(name).to_str().expect("a plain path").to_owned()
    }

    pub fn read(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    pub fn write(&self, name: &str, text: &str) -> String {
        fs::write(self.path(name), text).expect("a writable folder");
        self.text(name)
    }

    /// Replaces the first `from` in file `name` by `to`; returns the number of the edited line.
    #[track_caller]
    pub fn edit(&self, name: &str, from: &str, to: &str) -> usize {
        let text = self.read(name);
        let at = text.find(from);
        let at = at.unwrap_or_else(|| panic!("{name} has no {from:?}"));
        self.write(name, &text.replacen(from, to, 1));
        text[..at].matches('\n').count() + 1
    }
}

fn copy(from: &Path, to: &Path) {
    for entry in fs::read_dir(from).expect("configs") {
        let entry = entry.expect("an entry");
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            fs::create_dir(&target).expect("a new folder");
            copy(&entry.path(), &target);
        } else {
            fs::copy(entry.path(), &target).expect("a copy");
        }
    }
}
