//! Plain tables of points: one frame a line, x, y and z of every point, no header and no times.
//!
//! Cells are divided by commas, semicolons, tabs or spaces. An empty cell (between commas), `nan`
//! and `NaN`: the point was not seen.

use super::bvh::LengthUnit;
use super::json::{check_names, shown};
use super::{LineFault, PoseHeader, PoseSample, Recording};

/// What a table does not tell.
#[derive(Clone, Debug, PartialEq)]
pub struct TableOptions {
    /// Frames per second.
    pub rate_hz: f64,
    /// Names of the points in the order of columns; `p0`, `p1`, ... when empty.
    pub names: Vec<String>,
    /// Unit of length.
    pub unit: LengthUnit,
}

/// Whether `text` looks like a table without a header: its first line is three or more numbers.
pub fn is_table(text: &str) -> bool {
    let line = text.lines().find(|line| !line.trim().is_empty());
    let cells: Vec<Option<Option<f64>>> = line
        .map(|line| cells(line).map(number).collect())
        .unwrap_or_default();
    cells.len() >= 3 && cells.iter().all(Option::is_some)
}

/// Reads a table of points.
///
/// # Errors
/// The first line that is not as it should be, names that do not fit, no line at all.
pub fn parse(text: &str, options: &TableOptions) -> Result<Recording, LineFault> {
    let fault = |line: usize, found: String, allowed: String| LineFault {
        line: line as u64 + 1,
        found,
        allowed,
    };
    let mut names = options.names.clone();
    let mut samples = Vec::new();
    for (number_of_line, line) in text.trim_start_matches('\u{feff}').lines().enumerate() {
        if line.trim().is_empty() {
            continue;
        }
        let values: Vec<Option<f64>> = cells(line)
            .map(|cell| number(cell).ok_or_else(|| shown(cell)))
            .collect::<Result<_, _>>()
            .map_err(|found| fault(number_of_line, found, "numbers".into()))?;
        if !values.len().is_multiple_of(3) {
            return Err(fault(
                number_of_line,
                format!("{} numbers", values.len()),
                "x, y and z of every point: a multiple of 3".into(),
            ));
        }
        let count = values.len() / 3;
        if names.is_empty() {
            names = (0..count).map(|index| format!("p{index}")).collect();
        }
        if count != names.len() {
            let allowed = if options.names.is_empty() {
                format!("{} points, as in the first line", names.len())
            } else {
                format!("{} points, as many as names are given", names.len())
            };
            return Err(fault(number_of_line, format!("{count} points"), allowed));
        }
        let place = |xyz: &[Option<f64>]| match xyz {
            [Some(x), Some(y), Some(z)] => Some([*x, *y, *z].map(|v| v * options.unit.metres)),
            _ => None,
        };
        samples.push(PoseSample {
            t: samples.len() as f64 / options.rate_hz,
            points: values.chunks_exact(3).map(place).collect(),
            confidence: Vec::new(),
            channels: Vec::new(),
        });
    }
    if samples.is_empty() {
        return Err(fault(0, "an empty file".into(), "lines of numbers".into()));
    }
    check_names(&names)
        .map_err(|found| fault(0, found, "a name of its own for every point".into()))?;
    Ok(Recording {
        header: PoseHeader {
            points: names,
            dim: 3,
            channels: Vec::new(),
        },
        samples,
    })
}

/// The cells of a line; a divider at its end opens no cell.
fn cells(line: &str) -> impl Iterator<Item = &str> {
    let line = line.trim();
    let divider = [',', ';', '\t'].into_iter().find(|c| line.contains(*c));
    let line = divider.map_or(line, |divider| line.strip_suffix(divider).unwrap_or(line));
    line.split(move |c: char| divider.map_or(c == ' ', |divider| c == divider))
        .map(str::trim)
        .filter(move |cell| divider.is_some() || !cell.is_empty())
}

/// A number of a cell: outer `None` where it is none, inner where the point was not seen.
fn number(cell: &str) -> Option<Option<f64>> {
    if cell.is_empty() || cell.eq_ignore_ascii_case("nan") {
        return Some(None);
    }
    // Places beyond a thousand kilometres are no places.
    let value: f64 = cell.parse().ok()?;
    (value.abs() < 1e6).then_some(Some(value))
}
