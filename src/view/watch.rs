//! What a view keeps of the cycles it has seen: names, sums and percentiles.

use crate::bus::dynamixel::model::Effort;
use crate::config::Character;
use crate::live::CycleRecord;
use crate::live::stats::{Microseconds, Percentiles};
use crate::puppet::Stage;

/// Names of what a record holds by index.
#[derive(Clone, Debug)]
pub struct Names {
    /// The character.
    pub character: String,
    /// Where poses come from.
    pub source: String,
    /// Joints with their servo ids.
    pub joints: Vec<(String, u8)>,
    /// Gestures.
    pub gestures: Vec<String>,
    /// Classes.
    pub classes: Vec<String>,
    /// Clips of each class.
    pub clips: Vec<Vec<String>>,
    /// Layers.
    pub layers: Vec<String>,
    /// What each joint's servo tells of its effort.
    pub efforts: Vec<Effort>,
    /// Position limits per joint, rad.
    pub limits: Vec<(f64, f64)>,
}

impl Names {
    /// Of a character.
    pub fn of(character: &Character) -> Self {
        Self {
            character: character.name.clone(),
            source: character.source.clone(),
            joints: character
                .joints
                .iter()
                .cloned()
                .zip(character.servos.iter().map(|s| s.id))
                .collect(),
            gestures: character
                .gestures
                .gestures
                .iter()
                .map(|g| g.name.clone())
                .collect(),
            classes: character.classes.iter().map(|c| c.name.clone()).collect(),
            clips: character.classes.iter().map(|c| c.clip_names()).collect(),
            layers: character.layer_names(),
            efforts: character.servos.iter().map(|s| s.model.effort).collect(),
            limits: character
                .limits
                .iter()
                .map(|l| (l.lower, l.upper))
                .collect(),
        }
    }
}

/// Sums over the cycles seen.
#[derive(Clone, Debug, Default)]
pub struct Watch {
    step: Microseconds,
    late: Microseconds,
    exchange: Microseconds,
    /// Replies missing so far.
    pub silent: u64,
    /// Frames damaged so far.
    pub damaged: u64,
    /// Cycles in which the envelope acted.
    pub held_back: u64,
    /// Cycles seen.
    pub cycles: u64,
}

impl Watch {
    /// Counts a cycle.
    pub fn count(&mut self, record: &CycleRecord) {
        self.cycles += 1;
        self.step.add(record.step_us);
        self.late.add(record.late_us);
        self.exchange.add(u64::from(record.bus.cycle_us));
        self.silent += u64::from(record.bus.silent);
        self.damaged += u64::from(record.bus.damaged);
        self.held_back += u64::from(record.held_back > 0);
    }

    /// Percentiles of step, lateness and bus exchange.
    pub fn percentiles(&self) -> [(&'static str, Percentiles); 3] {
        [
            ("step", self.step.percentiles()),
            ("late", self.late.percentiles()),
            ("bus", self.exchange.percentiles()),
        ]
    }
}

/// State of safety in words.
pub fn safety(record: &CycleRecord) -> String {
    let stage = match record.stage {
        Stage::Waiting => "waiting",
        Stage::Rising => "rising to the first pose",
        Stage::Playing => "playing",
        Stage::Settling => "settling",
        Stage::Lowering => "into the end pose",
        Stage::Done => "at rest",
    };
    let mut text = stage.to_string();
    if record.poses_lost {
        text += ", POSES LOST";
    }
    if record.held_back > 0 {
        text += ", ENVELOPE ACTS";
    }
    if record.bus.silent_mask != 0 {
        text += &format!(", {} SERVO SILENT", record.bus.silent_mask.count_ones());
    }
    if record.bus.alert_mask != 0 {
        text += &format!(", {} SERVO ERROR", record.bus.alert_mask.count_ones());
    }
    text
}
