//! A table of servos: as text, or live on the terminal with what is hot or wrong in colour.

#[cfg(feature = "tui")]
use ratatui::{
    Frame,
    layout::{Constraint, Layout},
    style::{Color, Modifier, Style},
    text::Line,
    widgets::{Block, Cell as TuiCell, Row, Table},
};

/// How much a cell wants to be seen.
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// As it should be.
    #[default]
    Plain,
    /// Getting near a limit.
    Warm,
    /// Beyond it, or broken.
    Bad,
}

/// One cell.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Cell {
    /// What it says.
    pub text: String,
    /// How it looks.
    pub level: Level,
}

impl Cell {
    /// A cell that is as it should be.
    pub fn plain(text: impl ToString) -> Self {
        Self {
            text: text.to_string(),
            level: Level::Plain,
        }
    }

    /// The same cell, seen as `level`.
    pub fn at(self, level: Level) -> Self {
        Self { level, ..self }
    }
}

/// One column.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct Column {
    /// Its heading.
    pub name: &'static str,
    /// Numbers stand to the right.
    pub right: bool,
}

/// A table of servos, one row each.
#[derive(Clone, Debug, Default)]
pub struct ServoTable {
    /// Columns.
    pub columns: Vec<Column>,
    /// Rows, as many cells as columns.
    pub rows: Vec<Vec<Cell>>,
    /// What stands above.
    pub title: String,
    /// What stands below.
    pub footer: String,
}

impl ServoTable {
    fn widths(&self) -> Vec<usize> {
        let longest = |(index, column): (usize, &Column)| {
            let cells = self.rows.iter().filter_map(|row| row.get(index));
            cells
                .map(|cell| cell.text.chars().count())
                .chain([column.name.chars().count()])
                .max()
                .unwrap_or(0)
        };
        self.columns.iter().enumerate().map(longest).collect()
    }

    /// The table as lines of text, heading first.
    pub fn lines(&self) -> Vec<String> {
        let widths = self.widths();
        let line = |texts: &mut dyn Iterator<Item = &str>| {
            let cells = texts.zip(&self.columns).zip(&widths);
            let cells: Vec<String> = cells
                .map(|((text, column), &width)| match column.right {
                    true => format!("{text:>width$}"),
                    false => format!("{text:<width$}"),
                })
                .collect();
            cells.join("  ").trim_end().to_owned()
        };
        let heading = line(&mut self.columns.iter().map(|column| column.name));
        let rows = self
            .rows
            .iter()
            .map(|row| line(&mut row.iter().map(|cell| cell.text.as_str())));
        [heading].into_iter().chain(rows).collect()
    }

    /// Draws it on a terminal.
    #[cfg(feature = "tui")]
    pub fn draw(&self, frame: &mut Frame<'_>) {
        let style = |level: Level| match level {
            Level::Plain => Style::default(),
            Level::Warm => Style::default().fg(Color::Yellow),
            Level::Bad => Style::default()
                .fg(Color::White)
                .bg(Color::Red)
                .add_modifier(Modifier::BOLD),
        };
        let [body, foot] =
            Layout::vertical([Constraint::Min(3), Constraint::Length(1)]).areas(frame.area());
        let widths = self.widths();
        let aligned = |text: &str, index: usize| {
            let line = Line::from(text.to_owned());
            match self.columns.get(index).is_some_and(|column| column.right) {
                true => line.right_aligned(),
                false => line.left_aligned(),
            }
        };
        let heading = self.columns.iter().enumerate();
        let heading = Row::new(heading.map(|(i, c)| TuiCell::from(aligned(c.name, i))))
            .style(Style::default().add_modifier(Modifier::DIM));
        let rows =
            self.rows.iter().map(|row| {
                let cells = row.iter().enumerate();
                Row::new(cells.map(|(i, cell)| {
                    TuiCell::from(aligned(&cell.text, i)).style(style(cell.level))
                }))
            });
        let widths = widths
            .iter()
            .map(|w| Constraint::Length(u16::try_from(*w).unwrap_or(u16::MAX)));
        let table = Table::new(rows, widths)
            .header(heading)
            .column_spacing(2)
            .block(Block::bordered().title(format!(" {} ", self.title)));
        frame.render_widget(table, body);
        frame.render_widget(Line::from(format!(" {}", self.footer)), foot);
    }
}

/// The whole terminal with a table on it, until dropped.
#[cfg(feature = "tui")]
pub struct ServoScreen {
    screen: ratatui::DefaultTerminal,
}

#[cfg(feature = "tui")]
impl ServoScreen {
    /// Takes the screen; `None` where standard output is no terminal.
    pub fn open() -> Option<Self> {
        use std::io::IsTerminal;
        if !std::io::stdout().is_terminal() || !std::io::stdin().is_terminal() {
            return None;
        }
        ratatui::try_init().ok().map(|screen| Self { screen })
    }

    /// Draws `table`; true when q, Esc or Ctrl-C was pressed.
    pub fn show(&mut self, table: &ServoTable) -> bool {
        use ratatui::crossterm::event::{self, Event, KeyCode, KeyModifiers};
        let mut ends = false;
        while event::poll(std::time::Duration::ZERO).unwrap_or(false) {
            if let Ok(Event::Key(key)) = event::read() {
                let ctrl_c =
                    key.code == KeyCode::Char('c') && key.modifiers.contains(KeyModifiers::CONTROL);
                ends |= ctrl_c || matches!(key.code, KeyCode::Char('q') | KeyCode::Esc);
            }
        }
        // A terminal that cannot be drawn on is seen by the person before it.
        let _ = self.screen.draw(|frame| table.draw(frame));
        ends
    }
}

#[cfg(feature = "tui")]
impl Drop for ServoScreen {
    fn drop(&mut self) {
        ratatui::restore();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_stand_under_their_heading() {
        let table = ServoTable {
            columns: vec![
                Column {
                    name: "id",
                    right: true,
                },
                Column {
                    name: "model",
                    right: false,
                },
                Column {
                    name: "C",
                    right: true,
                },
            ],
            rows: vec![
                vec![Cell::plain(3), Cell::plain("xl430-w250"), Cell::plain(32)],
                vec![
                    Cell::plain(120),
                    Cell::plain("ax"),
                    Cell::plain("").at(Level::Bad),
                ],
            ],
            ..ServoTable::default()
        };
        assert_eq!(
            table.lines(),
            [" id  model        C", "  3  xl430-w250  32", "120  ax"]
        );
    }
}
