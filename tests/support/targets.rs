//! Reads the file that `--targets` writes.

use super::limits::LimitWatch;
use handwave::robot::JointEnvelope;
use std::path::Path;

/// Joint targets, one row per control cycle.
#[derive(Clone, Debug)]
pub struct Targets {
    pub joints: Vec<String>,
    /// Times as written, in seconds.
    pub times: Vec<String>,
    pub rows: Vec<Vec<f64>>,
}

impl Targets {
    #[track_caller]
    pub fn read(path: &Path) -> Self {
        let text = std::fs::read_to_string(path).expect("a targets file");
        let mut lines = text.lines();
        let header = lines.next().expect("a header");
        let joints = header
            .strip_prefix("t,")
            .unwrap_or_else(|| panic!("the header begins with {header:?}"));
        let joints: Vec<String> = joints.split(',').map(str::to_owned).collect();
        let (mut times, mut rows) = (Vec::new(), Vec::new());
        for (index, line) in lines.enumerate() {
            let mut cells = line.split(',');
            times.push(cells.next().expect("a time").to_owned());
            let row: Vec<f64> = cells
                .map(|c| {
                    c.parse()
                        .unwrap_or_else(|e| panic!("row {index}: {c:?}: {e}"))
                })
                .collect();
            assert_eq!(row.len(), joints.len(), "row {index}: {line}");
            rows.push(row);
        }
        assert!(!rows.is_empty(), "no rows in {}", path.display());
        Self {
            joints,
            times,
            rows,
        }
    }

    /// One joint over time.
    pub fn joint(&self, index: usize) -> impl Iterator<Item = f64> + '_ {
        self.rows.iter().map(move |row| row[index])
    }

    /// Fails where a target leaves the limits; else the extremes.
    #[track_caller]
    pub fn expect_inside(&self, limits: &[JointEnvelope], rate_hz: f64) -> LimitWatch {
        let mut watch = LimitWatch::new(limits, 1.0 / rate_hz);
        for row in &self.rows {
            watch.see(row).unwrap_or_else(|e| panic!("{e}"));
        }
        watch
    }
}
