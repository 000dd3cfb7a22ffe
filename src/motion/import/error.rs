//! Why a motion file cannot be brought in: which file, where in it, what was found, what is allowed.

use crate::body::{SkeletonError, SkinError};
use crate::pose::LineFault;

/// A motion file that cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("{file}: {fault}")]
pub struct ImportError {
    /// Path as it was given.
    pub file: String,
    /// What is wrong with it.
    pub fault: ImportFault,
}

/// What is wrong with a motion file.
#[derive(Debug, thiserror::Error)]
pub enum ImportFault {
    /// It cannot be read.
    #[error("cannot be read: {0}; check the path and its permissions")]
    Read(#[from] std::io::Error),
    /// A line is not as it should be.
    #[error("{0}")]
    Line(#[from] LineFault),
    /// An element of the file (node, accessor, frame, column) is not as it should be.
    #[error("{place}: found {found}; allowed: {allowed}")]
    Element {
        /// Which element.
        place: String,
        /// What stands there.
        found: String,
        /// What may stand there, and what to do.
        allowed: String,
    },
    /// No JSON, or not the expected one.
    #[error("not the JSON of {kind}: {source}")]
    Json {
        /// What was expected.
        kind: &'static str,
        /// What the parser says, with line and column.
        source: serde_json::Error,
    },
    /// Not a glTF 2.0 document.
    #[error("not a glTF 2.0 document: {0}")]
    Gltf(#[from] gltf::Error),
    /// Its joints form no skeleton.
    #[error("skeleton: {0}")]
    Skeleton(#[from] SkeletonError),
    /// Its surface cannot be skinned.
    #[error("skin: {0}")]
    Skin(#[from] SkinError),
}

impl ImportFault {
    /// An element that is not as it should be.
    pub(super) fn element(
        place: impl Into<String>,
        found: impl Into<String>,
        allowed: impl Into<String>,
    ) -> Self {
        Self::Element {
            place: place.into(),
            found: found.into(),
            allowed: allowed.into(),
        }
    }

    /// The error of the file it stands in.
    pub(super) fn in_file(self, file: &str) -> ImportError {
        ImportError {
            file: file.into(),
            fault: self,
        }
    }
}
