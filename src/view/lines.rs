//! A line of text every second, for logs and terminals that cannot do more.

use super::watch::{Names, Watch, safety};
use crate::base::print::say;
use crate::config::Character;
use crate::live::CycleRecord;

/// The line display.
pub struct Lines {
    names: Names,
    watch: Watch,
    next_s: f64,
}

impl Lines {
    /// For a character.
    pub fn new(character: &Character) -> Self {
        Self {
            names: Names::of(character),
            watch: Watch::default(),
            next_s: 0.0,
        }
    }

    /// The gestures are others now.
    pub fn rename_gestures(&mut self, names: &[String]) {
        self.names.gestures = names.to_vec();
    }

    /// Counts one cycle.
    pub fn count(&mut self, record: &CycleRecord) {
        self.watch.count(record);
    }

    /// Prints a line when a second has passed since the last.
    pub fn draw(&mut self, record: &CycleRecord) {
        if record.t_s < self.next_s || self.watch.cycles == 0 {
            return;
        }
        self.next_s = record.t_s + 1.0;
        let gestures: Vec<String> = self
            .names
            .gestures
            .iter()
            .zip(&record.gestures)
            .map(|(name, g)| format!("{name} {:.2} at {:.2} Hz", g.amplitude, g.frequency_hz))
            .collect();
        say(format_args!(
            "{:7.2} s  {:<12} {}  [{}]  missing replies {}",
            record.t_s,
            self.names
                .classes
                .get(record.active)
                .map_or("", String::as_str),
            gestures.join(", "),
            safety(record),
            self.watch.silent,
        ));
    }
}
