//! Where the files that a configuration names are read from.

use super::error::ConfigError;
use std::collections::BTreeMap;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// A place with a character's files.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Files {
    /// Files next to a configuration on disk.
    Folder(PathBuf),
    /// The files of the built-in quadruped, part of the program.
    Embedded,
    /// Files that are kept in memory as they are read, or that a recording brought along.
    Kept(Arc<KeptFiles>),
}

/// Files by the names that the configuration gives them.
#[derive(Debug)]
pub struct KeptFiles {
    /// Where they are read from; `None`: what is not kept does not exist.
    from: Option<Files>,
    /// For messages, when they came from nowhere else.
    name: String,
    kept: Mutex<BTreeMap<String, Vec<u8>>>,
}

impl PartialEq for KeptFiles {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::eq(self, other)
    }
}

impl Eq for KeptFiles {}

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
    /// The same files, kept as they are read.
    pub fn keeping(self) -> Self {
        Files::Kept(Arc::new(KeptFiles {
            from: Some(self),
            name: String::new(),
            kept: Mutex::default(),
        }))
    }

    /// Files that `name` (a recording) brought along.
    pub fn brought(name: &str, files: BTreeMap<String, Vec<u8>>) -> Self {
        Files::Kept(Arc::new(KeptFiles {
            from: None,
            name: name.into(),
            kept: Mutex::new(files),
        }))
    }

    /// What has been read so far of files that are kept, by name.
    pub fn kept(&self) -> BTreeMap<String, Vec<u8>> {
        match self {
            Files::Kept(files) => files.lock().clone(),
            Files::Folder(_) | Files::Embedded => BTreeMap::new(),
        }
    }

    /// The place itself, without what keeps its files.
    pub fn place(&self) -> &Files {
        match self {
            Files::Kept(files) => files.from.as_ref().map_or(self, Files::place),
            Files::Folder(_) | Files::Embedded => self,
        }
    }

    /// Text of the file at `path`, relative to this place.
    pub fn read(&self, path: &str) -> Result<String, ConfigError> {
        String::from_utf8(self.bytes(path)?)
            .map_err(|_| self.cannot(path, "cannot be read: it is not UTF-8 text".into()))
    }

    /// Content of the file at `path`, relative to this place.
    pub fn bytes(&self, path: &str) -> Result<Vec<u8>, ConfigError> {
        match self {
            Files::Folder(folder) => std::fs::read(folder.join(path))
                .map_err(|e| self.cannot(path, format!("cannot be read: {e}"))),
            Files::Embedded => EMBEDDED
                .iter()
                .find(|(name, _)| *name == path)
                .map(|(_, text)| text.as_bytes().to_vec())
                .ok_or_else(|| self.cannot(path, "is not one of the built-in files".into())),
            Files::Kept(files) => match &files.from {
                Some(from) => {
                    let bytes = from.bytes(path)?;
                    files.lock().insert(path.to_owned(), bytes.clone());
                    Ok(bytes)
                }
                None => files
                    .lock()
                    .get(path)
                    .cloned()
                    .ok_or_else(|| self.cannot(path, "is not in the recording".into())),
            },
        }
    }

    fn cannot(&self, path: &str, problem: String) -> ConfigError {
        ConfigError {
            file: self.name(path),
            line: None,
            key: String::new(),
            problem,
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
            Files::Kept(files) => files.from.as_ref()?.stamp(path),
        }
    }

    /// The file at `path` as a name for messages.
    pub fn name(&self, path: &str) -> String {
        match self {
            Files::Folder(folder) => folder.join(path).display().to_string(),
            Files::Embedded => format!("built-in {path}"),
            Files::Kept(files) => match &files.from {
                Some(from) => from.name(path),
                None => format!("{}: {path}", files.name),
            },
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

impl KeptFiles {
    fn lock(&self) -> std::sync::MutexGuard<'_, BTreeMap<String, Vec<u8>>> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
