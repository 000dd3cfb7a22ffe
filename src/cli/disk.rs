//! Files of commands: read and written with the same words when it cannot be.

use super::Failure;
use crate::robot::RobotModel;
use std::path::Path;

/// Text of the file at `path`.
pub(super) fn read(path: &Path) -> Result<String, Failure> {
    std::fs::read_to_string(path)
        .map_err(|e| Failure::input(format!("cannot read {}: {e}", path.display())))
}

/// The robot that the URDF at `path` describes.
pub(super) fn read_model(path: &Path) -> Result<RobotModel, Failure> {
    RobotModel::from_urdf(&read(path)?)
        .map_err(|e| Failure::input(format!("{}: {e}", path.display())))
}

/// Writes the file at `path` anew.
pub(super) fn write(path: &Path, content: impl AsRef<[u8]>) -> Result<(), Failure> {
    std::fs::write(path, content)
        .map_err(|e| Failure::input(format!("cannot write {}: {e}", path.display())))
}
