//! The file of a clip: JSON, one object.
//!
//! ```json
//! {
//!   "handwave": "clip", "version": 1, "name": "trot_long",
//!   "kind": "cycle",
//!   "joints": ["front_left_hip", "..."],
//!   "frequency_hz": 1.6,
//!   "root": {"forward_m": 0.12, "left_m": 0.0, "yaw_rad": 0.0},
//!   "segments": [{"name": "front_left", "joints": ["front_left_hip", "..."], "phase": 0.0, "duty": 0.5}],
//!   "body": [[0.0, 0.0, 0.15, 0.0, 0.0, 0.0], [0.0, 0.0, 0.15, 0.0, 0.0, 0.0]],
//!   "frames": [[0.0, 0.62, -1.24], [0.0, 0.61, -1.26]]
//! }
//! ```
//!
//! `kind` is `cycle` (frames evenly over one cycle, the last followed by the first; at least 8) or
//! `path` (frames evenly from progression 0 to 1; at least 2). Angles in radians, one number per
//! joint and frame. `root`: how far the body travels in one cycle (metres, radians). `segments`:
//! limbs with their own timeline, `phase` = fraction of the cycle at which the limb's cycle begins
//! (touch-down), `duty` = fraction of the cycle on the ground. `body` (robots that walk): the root link
//! over the ground. With `skeleton` the frames are poses of it: root place and a quaternion per joint.

use crate::body::{RootAdvance, Skeleton};
use serde::{Deserialize, Serialize};

#[allow(
    clippy::trivially_copy_pass_by_ref,
    reason = "serde passes a reference"
)]
fn is_zero(v: &f64) -> bool {
    *v == 0.0
}

/// Whether a clip repeats.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ClipKind {
    /// Repeats; indexed by phase.
    Cycle,
    /// Goes from a rest pose to an extreme pose; indexed by progression.
    Path,
}

/// A limb with a timeline of its own.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Segment {
    /// Limb name.
    pub name: String,
    /// Joints of the limb.
    pub joints: Vec<String>,
    /// Fraction of the cycle at which the limb's own cycle begins, 0..1.
    pub phase: f64,
    /// Fraction of the cycle in which the limb carries weight, 0..1.
    pub duty: f64,
}

/// The file form of a clip.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClipFile {
    /// Always `clip`.
    pub handwave: String,
    /// Format version, 1.
    pub version: u32,
    /// Name of the motion.
    pub name: String,
    /// Where it comes from: author, recording, licence.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub origin: String,
    /// Whether it repeats.
    pub kind: ClipKind,
    /// Joint names, in the order of each frame.
    pub joints: Vec<String>,
    /// The frequency that a cycle was made for, Hz.
    #[serde(default)]
    pub frequency_hz: f64,
    /// How long a path takes when it is played by the clock, seconds; 0: not said.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub duration_s: f64,
    /// Travel per cycle.
    #[serde(default)]
    pub root: RootAdvance,
    /// Limbs.
    #[serde(default)]
    pub segments: Vec<Segment>,
    /// The skeleton whose poses the frames are; absent for a robot's joints.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub skeleton: Option<Skeleton>,
    /// Per frame the root link over the ground in the travelling frame, which moves evenly along `root`:
    /// forward, left, height (m), roll, pitch, yaw (rad). Empty: not known.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub body: Vec<[f64; 6]>,
    /// Per frame how far the travelling frame is from that of the first frame: forward, left (m), yaw
    /// (rad), in the first one's axes. Empty: it travels evenly.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub way: Vec<[f64; 3]>,
    /// One row per frame: a number per joint, radians; with `skeleton` a pose of it.
    pub frames: Vec<Vec<f64>>,
}

/// Why a clip cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ClipError {
    /// Not the JSON of a clip.
    #[error("not a clip: {0}")]
    Json(#[from] serde_json::Error),
    /// Another kind of file, or a newer one.
    #[error("not a clip of version 1: \"handwave\" is {found:?}, \"version\" is {version}")]
    Version {
        /// Content of the `handwave` key.
        found: String,
        /// Content of the `version` key.
        version: u32,
    },
    /// A frame or number that cannot be used.
    #[error("clip {clip}: {problem}")]
    Content {
        /// Clip name.
        clip: String,
        /// What was found and what is allowed.
        problem: String,
    },
}

impl ClipFile {
    /// Parses and checks the JSON text of a clip.
    pub fn from_json(text: &str) -> Result<Self, ClipError> {
        let file: ClipFile = serde_json::from_str(text)?;
        if file.handwave != "clip" || file.version != 1 {
            return Err(ClipError::Version {
                found: file.handwave,
                version: file.version,
            });
        }
        file.check()?;
        Ok(file)
    }

    /// JSON text, one line per frame, numbers rounded to a micro-radian.
    pub fn to_json(&self) -> String {
        let round = |v: f64| (v * 1e6).round() / 1e6 + 0.0;
        let rows = |rows: &mut dyn Iterator<Item = &[f64]>| {
            let rows: Vec<String> = rows
                .map(|row| {
                    let numbers: Vec<f64> = row.iter().map(|v| round(*v)).collect();
                    format!(
                        "    {}",
                        serde_json::to_string(&numbers).unwrap_or_default()
                    )
                })
                .collect();
            format!("[\n{}\n  ]", rows.join(",\n"))
        };
        let mut head = self.clone();
        head.frames.clear();
        head.body.clear();
        head.way.clear();
        let mut text = serde_json::to_string_pretty(&head).unwrap_or_default();
        let mut tables = String::new();
        if !self.body.is_empty() {
            let body = rows(&mut self.body.iter().map(<[f64; 6]>::as_slice));
            tables += &format!("\"body\": {body},\n  ");
        }
        if !self.way.is_empty() {
            let way = rows(&mut self.way.iter().map(<[f64; 3]>::as_slice));
            tables += &format!("\"way\": {way},\n  ");
        }
        let frames = rows(&mut self.frames.iter().map(Vec::as_slice));
        tables += &format!("\"frames\": {frames}");
        text = text.replace("\"frames\": []", &tables);
        text.push('\n');
        text
    }

    fn check(&self) -> Result<(), ClipError> {
        let bad = |problem: String| {
            Err(ClipError::Content {
                clip: self.name.clone(),
                problem,
            })
        };
        let least = match self.kind {
            ClipKind::Cycle => 8,
            ClipKind::Path => 2,
        };
        if self.frames.len() < least {
            return bad(format!(
                "{} frames, at least {least} are needed",
                self.frames.len()
            ));
        }
        for (k, frame) in self.frames.iter().enumerate() {
            let wanted = match &self.skeleton {
                Some(_) => 3 + 4 * self.joints.len(),
                None => self.joints.len(),
            };
            if frame.len() != wanted {
                return bad(format!(
                    "frame {k} has {} numbers for {} joints; {wanted} are needed",
                    frame.len(),
                    self.joints.len()
                ));
            }
            if let Some(i) = frame.iter().position(|v| !v.is_finite()) {
                let joint = match &self.skeleton {
                    Some(_) => i.checked_sub(3).map_or("root", |i| &self.joints[i / 4]),
                    None => &self.joints[i],
                };
                return bad(format!(
                    "frame {k}, joint {joint}: {} is not a finite number",
                    frame[i]
                ));
            }
        }
        if let Some(skeleton) = &self.skeleton {
            skeleton
                .check()
                .or_else(|e| bad(format!("skeleton: {e}")))?;
            let known = skeleton.joints.iter().map(|j| &j.name);
            if !known.eq(&self.joints) {
                return bad("its joints are not those of its skeleton, in that order".into());
            }
        }
        let counts = [
            (
                "body",
                self.body.len(),
                self.body.iter().flatten().all(|v| v.is_finite()),
            ),
            (
                "way",
                self.way.len(),
                self.way.iter().flatten().all(|v| v.is_finite()),
            ),
        ];
        for (key, count, finite) in counts {
            if count != 0 && count != self.frames.len() {
                let frames = self.frames.len();
                return bad(format!("{key} has {count} rows for {frames} frames"));
            }
            if !finite {
                return bad(format!("{key} holds a number that is not finite"));
            }
        }
        if !(0.0..=3600.0).contains(&self.duration_s) {
            return bad(format!("duration_s {} is not in 0..3600", self.duration_s));
        }
        let root = [self.root.forward_m, self.root.left_m, self.root.yaw_rad];
        if root.iter().any(|v| !v.is_finite()) {
            return bad("its root advance is not finite".into());
        }
        for segment in &self.segments {
            if !(0.0..=1.0).contains(&segment.phase) || !(0.0..=1.0).contains(&segment.duty) {
                return bad(format!(
                    "segment {}: phase {} and duty {} must lie in 0..1",
                    segment.name, segment.phase, segment.duty
                ));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(frames: Vec<Vec<f64>>) -> ClipFile {
        ClipFile {
            handwave: "clip".into(),
            version: 1,
            name: "test".into(),
            origin: String::new(),
            kind: ClipKind::Path,
            joints: vec!["a".into(), "b".into()],
            frequency_hz: 0.0,
            duration_s: 0.0,
            skeleton: None,
            body: vec![],
            way: vec![],
            root: RootAdvance::default(),
            segments: vec![],
            frames,
        }
    }

    #[test]
    fn bad_frames_and_strange_joints_are_named() {
        let short = file(vec![vec![0.0, 0.0], vec![1.0]]).to_json();
        let message = ClipFile::from_json(&short)
            .expect_err("short row")
            .to_string();
        assert!(
            message.contains("frame 1 has 1 numbers for 2 joints"),
            "{message}"
        );
        let good = file(vec![vec![0.0, 0.5], vec![1.0, 0.5]]);
        let missing = good
            .for_body(&["a".into()])
            .expect_err("b is strange")
            .to_string();
        assert!(missing.contains("joint b is not in the robot"), "{missing}");
        let unknown = good.to_json().replace("\"kind\"", "\"kindd\"");
        assert!(ClipFile::from_json(&unknown).is_err());
    }

    #[test]
    fn json_round_trip_and_joint_order_of_the_body() {
        let good = file(vec![vec![0.0, 0.5], vec![1.0, 0.25]]);
        let back = ClipFile::from_json(&good.to_json()).expect("own output");
        assert_eq!(back, good);
        let clip = back
            .for_body(&["b".into(), "a".into()])
            .expect("same joints");
        let mut pose = [0.0; 2];
        clip.pose(1.0, &mut pose);
        assert_eq!(pose, [0.25, 1.0]);
    }

    #[test]
    fn a_root_link_that_looks_backwards_does_not_spin_between_frames() {
        use crate::body::{JointSpace, PoseSpace};
        let mut file = file((0..5).map(|k| vec![0.1 * f64::from(k), 0.0]).collect());
        let turn = |k: i32| std::f64::consts::PI + 0.04 * f64::from(k - 2);
        file.body = (0..5)
            .map(|k| {
                let yaw = crate::base::angle::wrap_pi(turn(k));
                [0.0, 0.0, 0.2, 0.0, 0.0, yaw]
            })
            .collect();
        let space = JointSpace::floating(&["a".into(), "b".into()]);
        let clip = file.for_space(&space).expect("a good clip");
        let mut pose = vec![0.0; space.len()];
        for k in 0..=40 {
            clip.pose(f64::from(k) / 40.0, &mut pose);
            let off = (pose[7] - turn(2)).abs();
            assert!(off < 0.1, "yaw {:.2} rad at {k}/40 of the way", pose[7]);
        }
    }
}
