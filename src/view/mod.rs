//! What a person sees of a run: the terminal view, or a line now and then where there is no terminal.
//! Plots for reports are in `plot` (feature `plot`).

#[cfg(feature = "tui")]
mod draw;
mod lines;
#[cfg(feature = "plot")]
pub mod plot;
#[cfg(feature = "record")]
pub mod recorder;
pub mod servos;
#[cfg(feature = "tui")]
mod terminal;
#[cfg_attr(
    not(feature = "tui"),
    expect(dead_code, reason = "a line shows less than the terminal view")
)]
mod watch;

use crate::config::Character;
use crate::live::{CycleRecord, StopSwitch};
use lines::Lines;
#[cfg(feature = "tui")]
use terminal::Terminal;

/// How a run is shown.
pub enum Display {
    /// Not at all.
    Quiet,
    /// A line of text every second.
    Lines(Box<Lines>),
    /// The whole terminal.
    #[cfg(feature = "tui")]
    Terminal(Box<Terminal>),
}

impl Display {
    /// The best display that standard output allows. Keys on the terminal press `stop`.
    pub fn open(character: &Character, stop: &StopSwitch) -> Self {
        #[cfg(feature = "tui")]
        if std::io::IsTerminal::is_terminal(&std::io::stdout())
            && let Ok(terminal) = Terminal::open(character, stop)
        {
            return Display::Terminal(Box::new(terminal));
        }
        let _ = stop;
        Display::Lines(Box::new(Lines::new(character)))
    }

    /// Counts one cycle.
    pub fn count(&mut self, record: &CycleRecord) {
        match self {
            Display::Quiet => {}
            Display::Lines(lines) => lines.count(record),
            #[cfg(feature = "tui")]
            Display::Terminal(terminal) => terminal.count(record),
        }
    }

    /// The gestures are others now, with these names.
    pub fn rename_gestures(&mut self, names: &[String]) {
        match self {
            Display::Quiet => {}
            Display::Lines(lines) => lines.rename_gestures(names),
            #[cfg(feature = "tui")]
            Display::Terminal(terminal) => terminal.rename_gestures(names),
        }
    }

    /// Whether others may print lines beside it.
    pub fn shares_the_terminal(&self) -> bool {
        match self {
            Display::Quiet | Display::Lines(_) => true,
            #[cfg(feature = "tui")]
            Display::Terminal(_) => false,
        }
    }

    /// Shows the newest cycle.
    pub fn draw(&mut self, newest: &CycleRecord) {
        match self {
            Display::Quiet => {}
            Display::Lines(lines) => lines.draw(newest),
            #[cfg(feature = "tui")]
            Display::Terminal(terminal) => terminal.draw(newest),
        }
    }
}
