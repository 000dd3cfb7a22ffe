//! The terminal view: takes the screen, draws, listens to keys, gives the screen back.

use super::draw::draw;
use super::watch::{Names, Watch};
use crate::config::Character;
use crate::live::{CycleRecord, StopSwitch};
use ratatui::DefaultTerminal;
use ratatui::crossterm::event::{self, Event, KeyCode, KeyModifiers};
use std::time::Duration;

/// The terminal while a run is shown on it.
pub struct Terminal {
    screen: DefaultTerminal,
    names: Names,
    watch: Watch,
    stop: StopSwitch,
}

impl Terminal {
    /// Takes the screen.
    pub fn open(character: &Character, stop: &StopSwitch) -> std::io::Result<Self> {
        Ok(Self {
            screen: ratatui::try_init()?,
            names: Names::of(character),
            watch: Watch::default(),
            stop: stop.clone(),
        })
    }

    /// The gestures are others now.
    pub fn rename_gestures(&mut self, names: &[String]) {
        self.names.gestures = names.to_vec();
    }

    /// Counts one cycle.
    pub fn count(&mut self, record: &CycleRecord) {
        self.watch.count(record);
    }

    /// Draws the newest cycle and handles keys: q, Esc and Ctrl-C press the stop switch, r asks for a
    /// re-arm.
    pub fn draw(&mut self, record: &CycleRecord) {
        while event::poll(Duration::ZERO).unwrap_or(false) {
            if let Ok(Event::Key(key)) = event::read() {
                let ctrl_c =
                    key.code == KeyCode::Char('c') && key.modifiers.contains(KeyModifiers::CONTROL);
                if key.is_press()
                    && (ctrl_c || matches!(key.code, KeyCode::Char('q') | KeyCode::Esc))
                {
                    self.stop.press();
                }
                if key.is_press() && key.code == KeyCode::Char('r') {
                    self.stop.ask_rearm();
                }
            }
        }
        let (names, watch) = (&self.names, &self.watch);
        // A terminal that cannot be drawn on must not stop the robot.
        let _ = self.screen.draw(|frame| draw(frame, names, watch, record));
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        ratatui::restore();
    }
}
