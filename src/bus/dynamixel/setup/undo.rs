//! The undo file: what stood in a register before it was changed, one JSON object a line, written before the change.
//!
//! ```json
//! {"time":"2026-11-25T08:15:02Z","bus":"dynamixel:/dev/ttyUSB0@1000000","id":1,"baud":57600,"model":"xl430-w250","register":"id","address":7,"old":1,"new":11}
//! ```
//!
//! `id` and `baud` are where the servo answered when it was written to. A line `{"undone": ID}` says that
//! all lines above of the servo that ended up with that id were undone.

use super::SetupError;
use super::work::Place;
use serde::{Deserialize, Serialize};
use std::fs::{self, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

/// One register before and after a change.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct UndoEntry {
    /// When, UTC.
    pub time: String,
    /// The bus as written on the command line.
    pub bus: String,
    /// Id at which the servo was written to.
    pub id: u8,
    /// Baud rate at which it was written to.
    pub baud: u32,
    /// Model name.
    pub model: String,
    /// Register name.
    pub register: String,
    /// Its address.
    pub address: u16,
    /// What it held.
    pub old: i64,
    /// What it was to hold.
    pub new: i64,
}

#[derive(Serialize, Deserialize)]
#[serde(untagged)]
enum Line {
    Entry(UndoEntry),
    Undone { undone: u8 },
}

/// All changes of one servo, in the order in which they were made.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UndoGroup {
    /// Model name.
    pub model: String,
    /// Its changes, at least one.
    pub entries: Vec<UndoEntry>,
}

impl UndoGroup {
    /// Where the servo answers after the last change.
    pub fn place(&self) -> Place {
        let last = self.entries.last();
        last.map_or(
            Place {
                id: 1,
                baud: 57_600,
            },
            |entry| {
                Place {
                    id: entry.id,
                    baud: entry.baud,
                }
                .after(&entry.register, entry.new)
            },
        )
    }
}

/// An undo file.
#[derive(Clone, Debug)]
pub struct UndoFile {
    path: PathBuf,
}

impl UndoFile {
    /// The file at `path`; it need not exist.
    pub fn new(path: &Path) -> Self {
        Self { path: path.into() }
    }

    fn error(&self, problem: impl ToString) -> SetupError {
        SetupError::File {
            file: self.path.display().to_string(),
            problem: problem.to_string(),
        }
    }

    fn append(&self, line: &Line) -> Result<(), SetupError> {
        let mut text = serde_json::to_string(line).map_err(|e| self.error(e))?;
        text.push('\n');
        let mut file = OpenOptions::new()
            .create(true)
            .append(true)
            .open(&self.path)
            .map_err(|e| self.error(e))?;
        file.write_all(text.as_bytes())
            .and_then(|()| file.sync_data())
            .map_err(|e| self.error(e))
    }

    /// Appends `entry` and sees it on the disk.
    ///
    /// # Errors
    /// The file cannot be written; then the register must not be, either.
    pub fn note(&self, entry: UndoEntry) -> Result<(), SetupError> {
        self.append(&Line::Entry(entry))
    }

    /// Notes that what led to servo `id` was undone.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn note_undone(&self, id: u8) -> Result<(), SetupError> {
        self.append(&Line::Undone { undone: id })
    }

    /// What can be undone, one group a servo, in the order in which they were begun.
    ///
    /// # Errors
    /// The file cannot be read, or a line is no such entry.
    pub fn groups(&self) -> Result<Vec<UndoGroup>, SetupError> {
        let text = fs::read_to_string(&self.path).map_err(|e| self.error(e))?;
        groups(&text).map_err(|problem| self.error(problem))
    }
}

fn groups(text: &str) -> Result<Vec<UndoGroup>, String> {
    let mut groups: Vec<UndoGroup> = Vec::new();
    let lines: Vec<&str> = text.lines().collect();
    for (index, line) in lines.iter().enumerate() {
        if line.trim().is_empty() {
            continue;
        }
        let entry = match serde_json::from_str(line) {
            Ok(Line::Entry(entry)) => entry,
            Ok(Line::Undone { undone }) => {
                groups.retain(|group| group.place().id != undone);
                continue;
            }
            // The power went while the last line was written: nothing was changed by it.
            Err(_) if index + 1 == lines.len() && !text.ends_with('\n') => break,
            Err(error) => {
                return Err(format!(
                    "line {}: {error}; expected an object with time, bus, id, baud, model, register, address, old, new",
                    index + 1
                ));
            }
        };
        let place = Place {
            id: entry.id,
            baud: entry.baud,
        };
        // A line in the place where a servo was left belongs to that servo; else another one begins.
        let same = groups.iter_mut().rev().find(|group| {
            let from = group.entries.last().map(|last| Place {
                id: last.id,
                baud: last.baud,
            });
            group.model == entry.model
                && (group.place() == place || from == Some(place) && repeats(group, &entry))
        });
        match same {
            Some(group) => group.entries.push(entry),
            None => groups.push(UndoGroup {
                model: entry.model.clone(),
                entries: vec![entry],
            }),
        }
    }
    Ok(groups)
}

/// Whether `entry` is the last change of `group` tried again, which did not come through the first time.
fn repeats(group: &UndoGroup, entry: &UndoEntry) -> bool {
    group.entries.last().is_some_and(|last| {
        last.register == entry.register && last.old == entry.old && last.new == entry.new
    })
}

/// Seconds since 1970 as `2026-11-25T08:15:02Z`; days become a date as in Howard Hinnant's `civil_from_days`.
pub fn utc(seconds: u64) -> String {
    let (days, second) = (seconds / 86_400, seconds % 86_400);
    let z = days + 719_468;
    let era = z / 146_097;
    let day_of_era = z % 146_097;
    let year = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year + year / 4 - year / 100);
    let month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month + 2) / 5 + 1;
    let month = if month < 10 { month + 3 } else { month - 9 };
    let year = year + era * 400 + u64::from(month <= 2);
    let (h, m, s) = (second / 3600, second / 60 % 60, second % 60);
    format!("{year:04}-{month:02}-{day:02}T{h:02}:{m:02}:{s:02}Z")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(id: u8, baud: u32, register: &str, old: i64, new: i64) -> UndoEntry {
        UndoEntry {
            time: "2026-01-01T00:00:00Z".into(),
            bus: "dynamixel:/dev/x@1000000".into(),
            id,
            baud,
            model: "xl430-w250".into(),
            register: register.into(),
            address: 0,
            old,
            new,
        }
    }

    fn file() -> (tempfile::TempDir, UndoFile) {
        let folder = tempfile::tempdir().expect("a folder");
        let file = UndoFile::new(&folder.path().join("undo.jsonl"));
        (folder, file)
    }

    #[test]
    fn times_are_dates() {
        assert_eq!(utc(0), "1970-01-01T00:00:00Z");
        assert_eq!(utc(951_827_696), "2000-02-29T12:34:56Z");
        assert_eq!(utc(1_764_059_301), "2025-11-25T08:28:21Z");
    }

    #[test]
    fn two_servos_out_of_the_box_are_two_groups() {
        let (_folder, file) = file();
        for id in [11, 12] {
            file.note(entry(1, 57_600, "return_delay_time", 250, 0))
                .expect("written");
            file.note(entry(1, 57_600, "id", 1, id)).expect("written");
            file.note(entry(id as u8, 57_600, "baud_rate", 1, 3))
                .expect("written");
        }
        let groups = file.groups().expect("a good file");
        let places: Vec<Place> = groups.iter().map(UndoGroup::place).collect();
        let at = |id| Place {
            id,
            baud: 1_000_000,
        };
        assert_eq!(places, [at(11), at(12)]);
        assert!(groups.iter().all(|g| g.entries.len() == 3), "{groups:?}");
        file.note_undone(11).expect("written");
        let left = file.groups().expect("a good file");
        assert_eq!(left.len(), 1);
        assert_eq!(left[0].place(), at(12));
    }

    #[test]
    fn a_step_that_was_tried_twice_stays_with_its_servo() {
        let (_folder, file) = file();
        file.note(entry(1, 57_600, "id", 1, 11)).expect("written");
        file.note(entry(1, 57_600, "id", 1, 11)).expect("written");
        assert_eq!(file.groups().expect("a good file").len(), 1);
    }

    #[test]
    fn a_bad_line_is_named_and_a_torn_last_one_is_not_minded() {
        let (_folder, file) = file();
        file.note(entry(1, 57_600, "id", 1, 11)).expect("written");
        let text = fs::read_to_string(&file.path).expect("a file");
        fs::write(&file.path, format!("{text}{}", &text[..20])).expect("written");
        assert_eq!(file.groups().expect("a torn line").len(), 1);
        fs::write(&file.path, format!("{text}{{\"id\":1}}\n{text}")).expect("written");
        let error = file.groups().expect_err("a bad line").to_string();
        assert!(
            error.contains("line 2") && error.contains("undo.jsonl"),
            "{error}"
        );
    }
}
