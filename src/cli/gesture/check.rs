//! `handwave gesture check`: how well the gestures of a file can be told apart.

use super::load;
use super::report::{say_confusion, say_planes};
use crate::cli::{ExitStatus, Failure};
use crate::gesture::{FrontEndOptions, confusion, responses};
use std::path::Path;

pub(super) fn check(path: &Path, json: bool) -> Result<ExitStatus, Failure> {
    let set = load(path)?;
    let table = responses(&set).map_err(|anchor| {
        Failure::input(format!(
            "{}: global.anchor {anchor:?} is none of the points",
            path.display()
        ))
    })?;
    let played = confusion(&set, FrontEndOptions::default())
        .map_err(|e| Failure::input(format!("{}: {e}", path.display())))?;
    say_planes(&set, &table, json);
    say_confusion(&set, &played, json);
    Ok(ExitStatus::Done)
}
