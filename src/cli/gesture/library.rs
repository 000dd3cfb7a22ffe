//! `handwave gesture list`, `copy` and `remove`: gesture files as a library.

use super::define::check_name;
use super::load;
use crate::cli::{ExitStatus, Failure, say, warn};
use crate::gesture::GestureSet;
use serde_json::json;
use std::path::{Path, PathBuf};

/// The files to list: as named, and what gesture files the named folders hold.
fn files(places: &[PathBuf]) -> Result<Vec<(PathBuf, GestureSet)>, Failure> {
    let mut found = Vec::new();
    for place in places {
        if !place.is_dir() {
            found.push((place.clone(), load(place)?));
            continue;
        }
        let unreadable = |e| Failure::input(format!("{}: cannot be read: {e}", place.display()));
        let mut inside: Vec<PathBuf> = std::fs::read_dir(place)
            .map_err(unreadable)?
            .filter_map(|entry| Some(entry.ok()?.path()))
            .filter(|path| path.extension().is_some_and(|e| e == "toml"))
            .collect();
        inside.sort();
        for path in inside {
            let text = std::fs::read_to_string(&path).unwrap_or_default();
            // Other TOML files lie about: configurations, recipes, gaits.
            if !text.contains("\"gestures\"") {
                continue;
            }
            match GestureSet::from_toml(&text, &path.display().to_string()) {
                Ok(set) => found.push((path, set)),
                Err(error) => warn(format_args!("left out: {error}")),
            }
        }
    }
    Ok(found)
}

pub(super) fn list(places: &[PathBuf], json: bool) -> Result<ExitStatus, Failure> {
    if places.is_empty() {
        return Err(Failure::input(
            "nothing to list: name gesture files or folders that hold some",
        ));
    }
    let files = files(places)?;
    let several = files.len() > 1;
    if !json && !several {
        header();
    }
    for (path, set) in &files {
        if !json && several {
            let about = [&set.about.author, &set.about.licence, &set.about.note];
            let about: Vec<&str> = about.iter().filter_map(|a| a.as_deref()).collect();
            say(format_args!(
                "{} ({} points{}{})",
                path.display(),
                set.header.points.len(),
                if about.is_empty() { "" } else { "; " },
                about.join(", ")
            ));
            header();
        }
        for gesture in &set.gestures {
            if json {
                let object = json!({
                    "file": path.display().to_string(),
                    "gesture": gesture.name, "kind": gesture.kind.name(),
                    "duration_s": gesture.duration_s, "frames": gesture.frames.len(),
                    "source": gesture.source, "points": set.header.points, "dim": set.header.dim,
                    "author": set.about.author, "licence": set.about.licence, "note": set.about.note,
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
    }
    Ok(ExitStatus::Done)
}

fn header() {
    say(format_args!(
        "{:<16} {:<10} {:>10} {:>7}  source",
        "gesture", "kind", "duration_s", "frames"
    ));
}

/// What `copy` is told.
pub(super) struct Copy<'a> {
    pub from: &'a Path,
    pub name: &'a str,
    pub new_name: Option<&'a str>,
    pub into: &'a Path,
    pub replace: bool,
}

pub(super) fn copy(what: &Copy<'_>) -> Result<ExitStatus, Failure> {
    let (from, into) = (
        what.from.display().to_string(),
        what.into.display().to_string(),
    );
    let new_name = what.new_name.unwrap_or(what.name);
    check_name(new_name)?;
    let theirs = load(what.from)?;
    let gesture = theirs.named(what.name, &from).map_err(Failure::input)?;
    let mut mine = if what.into.exists() {
        load(what.into)?
    } else {
        GestureSet {
            gestures: Vec::new(),
            ..theirs.clone()
        }
    };
    if mine.index_of(new_name).is_some() && !what.replace {
        return Err(Failure::input(format!(
            "{into} has a gesture `{new_name}` already; give another name with --as, or --replace it"
        )));
    }
    let mut gesture = (mine.adopt(&theirs, gesture, &into, &from)).map_err(Failure::input)?;
    gesture.name = new_name.into();
    let terms = [&theirs.about.author, &theirs.about.licence];
    let terms: Vec<&str> = terms.iter().filter_map(|a| a.as_deref()).collect();
    if !terms.is_empty() && theirs.about != mine.about {
        // Whoever made it stays named where the file has another author.
        gesture.source = format!("{} ({})", gesture.source, terms.join(", "));
    }
    mine.put(gesture);
    mine.save(what.into).map_err(Failure::input)?;
    say(format_args!(
        "{into}: copied `{new_name}` from {from} ({} gestures); `handwave gesture check` tells how well they go together",
        mine.gestures.len()
    ));
    Ok(ExitStatus::Done)
}

pub(super) fn remove(path: &Path, name: &str) -> Result<ExitStatus, Failure> {
    let file = path.display().to_string();
    let mut set = load(path)?;
    set.named(name, &file).map_err(Failure::input)?;
    set.gestures.retain(|gesture| gesture.name != name);
    set.save(path).map_err(Failure::input)?;
    say(format_args!(
        "{file}: removed `{name}` ({} gestures)",
        set.gestures.len()
    ));
    Ok(ExitStatus::Done)
}
