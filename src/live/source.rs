//! Pose sources by name: what `--input` and `input.source` say, opened for reading.

use crate::config::Files;
use crate::pose::{PoseError, PoseFormat, PoseReader, PoseSample};
use std::fs::File;
use std::io::{BufRead, BufReader, Cursor};
use std::path::{Path, PathBuf};

/// A reader of any source.
pub type SourceReader = PoseReader<Box<dyn BufRead + Send>>;

/// Why a source cannot be opened.
#[derive(Debug, thiserror::Error)]
pub enum SourceError {
    /// Not a source.
    #[error(
        "unknown pose source {found:?}. Allowed: file:PATH with a .jsonl, .csv or .bvh recording"
    )]
    Unknown {
        /// As written.
        found: String,
    },
    /// A source that is known and not built in.
    #[error(
        "pose source {found:?}: {kind} is not supported by this build; use file:PATH with a .jsonl, .csv or .bvh recording"
    )]
    NotYet {
        /// As written.
        found: String,
        /// Its kind.
        kind: String,
    },
    /// A built-in file that is not there.
    #[error("{0}")]
    Config(#[from] crate::config::ConfigError),
    /// Nothing in it.
    #[error("no good sample in the pose stream; nothing to play")]
    Empty,
    /// The stream cannot be read.
    #[error("{0}")]
    Pose(#[from] PoseError),
}

/// Kinds of sources that other builds have.
const OTHER_KINDS: [&str; 7] = ["udp", "ws", "osc", "zenoh", "camera", "gamepad", "mcap"];

/// Opens `source`; a relative path is taken from `files` (the configuration's folder).
pub fn open(source: &str, files: &Files) -> Result<SourceReader, SourceError> {
    let (kind, rest) = source.split_once(':').unwrap_or((source, ""));
    if kind != "file" {
        return Err(if OTHER_KINDS.contains(&kind) {
            SourceError::NotYet {
                found: source.into(),
                kind: kind.into(),
            }
        } else {
            SourceError::Unknown {
                found: source.into(),
            }
        });
    }
    match files {
        Files::Folder(folder) => open_file(&folder.join(rest)),
        Files::Embedded => {
            let name = files.name(rest);
            let format = PoseFormat::of(Path::new(rest))?;
            let text = files.read(rest)?;
            let input: Box<dyn BufRead + Send> = Box::new(Cursor::new(text.into_bytes()));
            Ok(PoseReader::new(input, format, &name)?)
        }
    }
}

fn open_file(path: &Path) -> Result<SourceReader, SourceError> {
    let name = path.display().to_string();
    let format = PoseFormat::of(path)?;
    let file = File::open(path).map_err(|source| PoseError::Read {
        file: name.clone(),
        source,
    })?;
    let input: Box<dyn BufRead + Send> = Box::new(BufReader::new(file));
    Ok(PoseReader::new(input, format, &name)?)
}

/// Reads the first good sample, so that a stream without one is found out before anything moves.
pub fn first_sample(reader: &mut SourceReader) -> Result<PoseSample, SourceError> {
    let mut sample = PoseSample::default();
    if reader.read_into(&mut sample)? {
        Ok(sample)
    } else {
        Err(SourceError::Empty)
    }
}

/// The place that a path on the command line is relative to.
pub fn working_folder() -> Files {
    Files::Folder(PathBuf::new())
}
