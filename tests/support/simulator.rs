//! `handwave sim dynamixel` as a process of its own, and a look at its servos through `handwave bus read`.

use super::folder::Folder;
use super::program::{Running, handwave};

pub struct Simulator {
    pub process: Running,
    /// For `--bus`.
    pub bus: String,
    _folder: Folder,
}

impl Simulator {
    /// Servos such as `1-12`, ready for clients.
    #[track_caller]
    pub fn start(servos: &str) -> Self {
        let folder = Folder::empty();
        let link = folder.text("servos");
        let args = ["sim", "dynamixel", "--servos", servos, "--link", &link];
        let (process, line) = Running::start_and_hear(&args);
        assert_eq!(line.trim(), format!("ready {link}"));
        Self {
            process,
            bus: format!("dynamixel:{link}@1000000"),
            _folder: folder,
        }
    }

    /// A register of all twelve servos; `None` where one did not answer.
    pub fn registers(&self, name: &str) -> Option<Vec<i64>> {
        let ended = handwave(&["bus", "read", &self.bus, "1-12", name, "--json"]);
        let values: Vec<i64> = ended
            .out
            .lines()
            .filter_map(|line| serde_json::from_str::<serde_json::Value>(line).ok())
            .filter_map(|row| row["value"].as_i64())
            .collect();
        (ended.code == Some(0) && values.len() == 12).then_some(values)
    }
}
