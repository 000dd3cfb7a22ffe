//! Where the files that a configuration names are read from.

use super::error::ConfigError;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// A place with a character's files.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Files {
    /// Files next to a configuration on disk.
    Folder(PathBuf),
    /// The files of the built-in quadruped, part of the program.
    Embedded,
}

/// What changes when a file does.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct FileStamp {
    /// Time of the last change, nanoseconds.
    modified_ns: i64,
    /// Another file of the same name has another number.
    inode: u64,
    /// Length.
    bytes: u64,
}

/// The built-in character's configuration.
pub const BUILT_IN: &str = "quadruped.toml";

/// Embeds files of `configs/` by their path in it.
macro_rules! embed {
    ($($path:literal),* $(,)?) => {
        &[$(($path, include_str!(concat!("../../configs/", $path)))),*]
    };
}

const EMBEDDED: &[(&str, &str)] = embed![
    "quadruped.toml",
    "robots/pup.urdf",
    "gestures/hand.toml",
    "performances/drum_and_splay.jsonl",
    "clips/stand.json",
    "clips/walk_short.json",
    "clips/walk_long.json",
    "clips/trot_short.json",
    "clips/trot_long.json",
    "clips/walk_short_left.json",
    "clips/walk_long_left.json",
    "clips/trot_short_left.json",
    "clips/trot_long_left.json",
    "clips/walk_short_right.json",
    "clips/walk_long_right.json",
    "clips/trot_short_right.json",
    "clips/trot_long_right.json",
    "clips/pace.json",
    "clips/bound.json",
    "clips/sit.json",
    "clips/shake.json",
    "clips/bow.json",
    "clips/crouch.json",
    "clips/heading.json",
    "clips/lie.json",
];

impl Files {
    /// Text of the file at `path`, relative to this place.
    pub fn read(&self, path: &str) -> Result<String, ConfigError> {
        let cannot = |problem: String| ConfigError {
            file: self.name(path),
            line: None,
            key: String::new(),
            problem,
        };
        match self {
            Files::Folder(folder) => std::fs::read_to_string(folder.join(path))
                .map_err(|e| cannot(format!("cannot be read: {e}"))),
            Files::Embedded => EMBEDDED
                .iter()
                .find(|(name, _)| *name == path)
                .map(|(_, text)| (*text).to_string())
                .ok_or_else(|| cannot("is not one of the built-in files".into())),
        }
    }

    /// When the file at `path` was last changed and how long it is; `None` where that cannot be told.
    pub fn stamp(&self, path: &str) -> Option<FileStamp> {
        match self {
            Files::Folder(folder) => {
                let about = std::fs::metadata(folder.join(path)).ok()?;
                Some(FileStamp {
                    modified_ns: about.mtime().checked_mul(1_000_000_000)? + about.mtime_nsec(),
                    inode: about.ino(),
                    bytes: about.len(),
                })
            }
            Files::Embedded => None,
        }
    }

    /// The file at `path` as a name for messages.
    pub fn name(&self, path: &str) -> String {
        match self {
            Files::Folder(folder) => folder.join(path).display().to_string(),
            Files::Embedded => format!("built-in {path}"),
        }
    }

    /// The folder and file name of a configuration on disk.
    pub fn of(config: &Path) -> (Self, String) {
        let folder = config.parent().map(Path::to_path_buf).unwrap_or_default();
        let name = config
            .file_name()
            .map(|n| n.to_string_lossy().into_owned())
            .unwrap_or_default();
        (Files::Folder(folder), name)
    }
}
