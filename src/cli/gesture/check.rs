//! `handwave gesture list` and `check`: what a gesture file holds, and how well its gestures differ.

use super::load;
use super::report::{say_confusion, say_planes};
use crate::cli::{ExitStatus, Failure, say};
use crate::gesture::{FrontEndOptions, confusion, responses};
use std::path::Path;

pub(super) fn list(path: &Path, json: bool) -> Result<ExitStatus, Failure> {
    let set = load(path)?;
    if !json {
        say(format_args!(
            "{:<16} {:<10} {:>10} {:>7}  source",
            "gesture", "kind", "duration_s", "frames"
        ));
    }
    for gesture in &set.gestures {
        if json {
            let object = serde_json::json!({
                "gesture": gesture.name, "kind": gesture.kind.name(),
                "duration_s": gesture.duration_s, "frames": gesture.frames.len(),
                "source": gesture.source,
            });
            say(format_args!("{object}"));
        } else {
            say(format_args!(
                "{:<16} {:<10} {:>10.3} {:>7}  {}",
                gesture.name,
                gesture.kind.name(),
                gesture.duration_s,
                gesture.frames.len(),
                gesture.source
            ));
        }
    }
    Ok(ExitStatus::Done)
}

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
