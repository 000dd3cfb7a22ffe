//! How well feet stand: the way each slides while the motion has it on the ground.

use super::record::CycleRecord;
use crate::body::{Feet, RobotFeet};
use crate::puppet::Stage;
use nalgebra::Point3;

/// Slides of feet over a run.
#[derive(Copy, Clone, Debug, Default, PartialEq)]
pub struct Slides {
    /// Stances of all feet.
    pub stances: u64,
    /// Farthest that a foot was from where it came down within one stance, metres, at the targets sent.
    pub targets_m: f64,
    /// The same at the joint positions measured: what servos lag behind is in it.
    pub measured_m: f64,
}

/// Watches the feet of a robot through its cycle records. Not for the control path: it is for who looks on.
pub struct Footing {
    feet: RobotFeet,
    /// Per foot: where it came down, at the targets and as measured.
    began: Vec<Option<[Point3<f64>; 2]>>,
    slides: Slides,
    pose: Vec<f64>,
}

impl Footing {
    /// For the feet of a robot.
    pub fn new(feet: RobotFeet) -> Self {
        Self {
            began: vec![None; feet.count()],
            slides: Slides::default(),
            pose: Vec::new(),
            feet,
        }
    }

    /// Slides so far.
    pub fn slides(&self) -> Slides {
        self.slides
    }

    /// Sees one cycle. Only what is played counts: in ramps the root is not told.
    pub fn see(&mut self, record: &CycleRecord) {
        if record.stage != Stage::Playing || record.body.is_empty() {
            self.began.fill(None);
            return;
        }
        for foot in 0..self.began.len() {
            if record.grounded >> foot & 1 == 0 {
                self.slides.stances += u64::from(self.began[foot].take().is_some());
                continue;
            }
            let sent = self.place(record, foot, |joint| record.targets[joint]);
            let measured = self.place(record, foot, |joint| record.states[joint].position);
            let [first, second] = *self.began[foot].get_or_insert([sent, measured]);
            let slid = |from: Point3<f64>, to: Point3<f64>| (to.xy() - from.xy()).norm();
            self.slides.targets_m = self.slides.targets_m.max(slid(first, sent));
            // A servo that has not answered yet has no position; it is passed over.
            self.slides.measured_m = self.slides.measured_m.max(slid(second, measured));
        }
    }

    /// Where `foot` is in the world with joints at `positions` under the animator's body.
    fn place(
        &mut self,
        record: &CycleRecord,
        foot: usize,
        position: impl Fn(usize) -> f64,
    ) -> Point3<f64> {
        self.pose.clear();
        self.pose.extend((0..record.targets.len()).map(position));
        self.pose.extend_from_slice(&record.body);
        record.root.to_world(self.feet.position(&self.pose, foot))
    }
}
