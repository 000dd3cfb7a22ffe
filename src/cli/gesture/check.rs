//! `handwave gesture list` and `check`: what a gesture file holds, and how well its gestures differ.

use super::load;
use crate::cli::{ExitStatus, Failure, say};
use crate::gesture::responses;
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
    if !json {
        say(format_args!(
            "{:<16} {:<16} {:>7} {:>8}  ",
            "plane of", "shown", "mean", "largest"
        ));
    }
    for response in table {
        let plane = &set.gestures[response.gesture].name;
        let shown = &set.gestures[response.shown].name;
        let confusable = response.gesture != response.shown && response.largest > 0.2;
        if json {
            let object = serde_json::json!({
                "gesture": plane, "shown": shown, "mean": response.mean,
                "largest": response.largest, "confusable": confusable,
            });
            say(format_args!("{object}"));
        } else {
            say(format_args!(
                "{plane:<16} {shown:<16} {:>7.3} {:>8.3}  {}",
                response.mean,
                response.largest,
                if confusable { "may be confused" } else { "" }
            ));
        }
    }
    Ok(ExitStatus::Done)
}
