//! Lines and numbers of text formats, with faults that name the line.

use crate::pose::LineFault;

/// Numbers beyond are no places, angles or times.
const LARGEST: f64 = 1e9;

/// A line at fault.
pub(super) fn fault(
    line: usize,
    found: impl Into<String>,
    allowed: impl Into<String>,
) -> LineFault {
    LineFault {
        line: line as u64,
        found: found.into(),
        allowed: allowed.into(),
    }
}

/// A piece of a file in quotes, cut where it is long.
pub(super) fn shown(text: &str) -> String {
    let mut short: String = text.chars().take(40).collect();
    if short.len() < text.len() {
        short.push_str("...");
    }
    format!("{short:?}")
}

/// A finite number of sensible size.
pub(super) fn number(line: usize, word: &str, what: &str) -> Result<f64, LineFault> {
    let value = word.trim().parse().ok();
    value
        .filter(|v: &f64| v.abs() <= LARGEST)
        .ok_or_else(|| fault(line, shown(word), format!("a number for {what}")))
}

/// Lines that hold something, with their numbers from 1; comments (`#`) are left out.
pub(super) fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    text.lines()
        .enumerate()
        .map(|(i, line)| (i + 1, line.trim()))
        .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
}
