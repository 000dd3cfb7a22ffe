//! What can go wrong with a pose stream as a whole, in words for the reader.

use super::{MAX_BAD_IN_A_ROW, SampleFault};

/// A line of a recording that is not as it should be.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: found {found}; allowed: {allowed}")]
pub struct LineFault {
    /// Line number from 1.
    pub line: u64,
    /// What stands there.
    pub found: String,
    /// What may stand there, and what to do.
    pub allowed: String,
}

impl LineFault {
    /// The error of the file it stands in.
    pub fn in_file(self, file: &str) -> PoseError {
        PoseError::BadLine {
            file: file.into(),
            line: self.line,
            found: self.found,
            allowed: self.allowed,
        }
    }
}

/// Why a pose stream cannot be read, written or composed.
#[derive(Debug, thiserror::Error)]
pub enum PoseError {
    /// The file cannot be opened or read.
    #[error("{file}: cannot be read: {source}; check the path and its permissions")]
    Read {
        /// The file as the user named it.
        file: String,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The file cannot be written.
    #[error("{file}: cannot be written: {source}; check the folder and its permissions")]
    Write {
        /// The file as the user named it.
        file: String,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The name does not tell the format.
    #[error(
        "{file}: a pose stream's name ends in .jsonl, .csv or .bvh; other recordings come in with `handwave poses import`"
    )]
    Format {
        /// The file as the user named it.
        file: String,
    },
    /// Poses are not written in this format.
    #[error("{file}: poses are written to names that end in .jsonl or .csv")]
    WriteFormat {
        /// The file as the user named it.
        file: String,
    },
    /// A line of a recording is not as it should be.
    #[error("{file}:{line}: found {found}; allowed: {allowed}")]
    BadLine {
        /// The file as the user named it.
        file: String,
        /// Line number from 1.
        line: u64,
        /// What stands there.
        found: String,
        /// What may stand there, and what to do.
        allowed: String,
    },
    /// The first line is no header of a pose stream.
    #[error("{file}:{line}: bad header: found {found}; allowed: {allowed}")]
    Header {
        /// The file as the user named it.
        file: String,
        /// Line number from 1.
        line: u64,
        /// What stands there.
        found: String,
        /// What may stand there, and what to do.
        allowed: String,
    },
    /// Ten bad samples in a row.
    #[error(
        "{file}:{line}: {fault} (the first of {MAX_BAD_IN_A_ROW} bad samples in a row); correct the file from that line on, or the program that wrote it"
    )]
    TooManyBad {
        /// The file as the user named it.
        file: String,
        /// The first bad line of the row.
        line: u64,
        /// What is wrong with it.
        fault: SampleFault,
    },
    /// There is a header but not one good sample.
    #[error(
        "{file}: no good sample in it (dropped: {dropped}); a sample line looks like {{\"t\":0.0,\"p\":[[x,y,z],...]}}"
    )]
    Empty {
        /// The file as the user named it.
        file: String,
        /// Counts by reason.
        dropped: String,
    },
    /// A recording of another program is not as expected.
    #[error("{file}: {what}")]
    Import {
        /// The file as the user named it.
        file: String,
        /// What was expected, what was found, what to do.
        what: String,
    },
    /// A recipe is wrong.
    #[error("{file}: {key}: {what}")]
    Recipe {
        /// The recipe file.
        file: String,
        /// The key, as `segment 3 (from)`.
        key: String,
        /// What was found, what is allowed.
        what: String,
    },
}
