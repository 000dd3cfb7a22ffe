//! A clip: one example motion in joint space, and its file.
//!
//! The file is JSON, one object:
//!
//! ```json
//! {
//!   "handwave": "clip", "version": 1, "name": "trot_long",
//!   "kind": "cycle",
//!   "joints": ["front_left_hip", "..."],
//!   "frequency_hz": 1.6,
//!   "root": {"forward_m": 0.12, "left_m": 0.0, "yaw_rad": 0.0},
//!   "segments": [{"name": "front_left", "joints": ["front_left_hip", "..."], "phase": 0.0, "duty": 0.5}],
//!   "frames": [[0.0, 0.62, -1.24], [0.0, 0.61, -1.26]]
//! }
//! ```
//!
//! `kind` is `cycle` (frames evenly over one cycle, the last followed by the first; at least 8) or
//! `path` (frames evenly from progression 0 to 1; at least 2). Angles in radians, one number per
//! joint and frame. `root`: how far the body travels in one cycle (metres, radians). `segments`:
//! limbs with their own timeline, `phase` = fraction of the cycle at which the limb's cycle begins
//! (touch-down), `duty` = fraction of the cycle on the ground.

use super::spline::{Ends, Spline};
use serde::{Deserialize, Serialize};

/// Whether a clip repeats.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ClipKind {
    /// Repeats; indexed by phase.
    Cycle,
    /// Goes from a rest pose to an extreme pose; indexed by progression.
    Path,
}

/// How far the body travels in one cycle, in its own frame.
#[derive(Copy, Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RootAdvance {
    /// Metres forwards.
    pub forward_m: f64,
    /// Metres to the left.
    pub left_m: f64,
    /// Radians counter-clockwise seen from above.
    pub yaw_rad: f64,
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
    /// Travel per cycle.
    #[serde(default)]
    pub root: RootAdvance,
    /// Limbs.
    #[serde(default)]
    pub segments: Vec<Segment>,
    /// One row per frame, radians.
    pub frames: Vec<Vec<f64>>,
    /// Per frame the pose of the root link over the ground in the travelling frame:
    /// `[forward_m, left_m, height_m, roll_rad, pitch_rad, yaw_rad]`; empty when not known.
    ///
    /// The travelling frame moves with the root advance, evenly over the cycle; x forward, y left, z up.
    /// The rotation is Rz(yaw) Ry(pitch) Rx(roll): pitch above zero is nose down.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub body: Vec<[f64; 6]>,
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

/// A clip ready to be sampled, in the joint order of a body.
#[derive(Clone, Debug)]
pub struct Clip {
    /// Name of the motion.
    pub name: String,
    /// Whether it repeats.
    pub kind: ClipKind,
    /// The frequency that a cycle was made for, Hz.
    pub frequency_hz: f64,
    /// Travel per cycle.
    pub root: RootAdvance,
    /// Limbs, as joint indices of the body.
    pub limbs: Vec<Limb>,
    spline: Spline,
}

/// A limb of a loaded clip.
#[derive(Clone, Debug, PartialEq)]
pub struct Limb {
    /// Limb name.
    pub name: String,
    /// Joint indices of the body.
    pub joints: Vec<usize>,
    /// Start of the limb's cycle, fraction of the clip's cycle.
    pub phase: f64,
    /// Fraction of the cycle on the ground.
    pub duty: f64,
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
        let mut text = serde_json::to_string_pretty(&head).unwrap_or_default();
        let mut tables = format!(
            "\"frames\": {}",
            rows(&mut self.frames.iter().map(Vec::as_slice))
        );
        if !self.body.is_empty() {
            tables += &format!(
                ",\n  \"body\": {}",
                rows(&mut self.body.iter().map(<[f64; 6]>::as_slice))
            );
        }
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
            if frame.len() != self.joints.len() {
                return bad(format!(
                    "frame {k} has {} numbers for {} joints",
                    frame.len(),
                    self.joints.len()
                ));
            }
            if let Some(j) = frame.iter().position(|v| !v.is_finite()) {
                return bad(format!(
                    "frame {k}, joint {}: {} is not a finite number",
                    self.joints[j], frame[j]
                ));
            }
        }
        if !self.body.is_empty() && self.body.len() != self.frames.len() {
            return bad(format!(
                "body has {} rows for {} frames; give one per frame, or none",
                self.body.len(),
                self.frames.len()
            ));
        }
        if let Some(k) = self
            .body
            .iter()
            .position(|row| row.iter().any(|v| !v.is_finite()))
        {
            return bad(format!(
                "body, frame {k}: {:?} are not six finite numbers",
                self.body[k]
            ));
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

    /// Prepares the clip for a body whose joints are `body`, in that order.
    ///
    /// Every joint of the body must be in the clip; joints that the body lacks are an error too,
    /// so that a clip of another robot is found at load and not on the floor.
    pub fn for_body(&self, body: &[String]) -> Result<Clip, ClipError> {
        let bad = |problem: String| ClipError::Content {
            clip: self.name.clone(),
            problem,
        };
        let column: Vec<usize> = body
            .iter()
            .map(|joint| {
                self.joints
                    .iter()
                    .position(|j| j == joint)
                    .ok_or_else(|| bad(format!("has no joint {joint}, which the robot has")))
            })
            .collect::<Result<_, _>>()?;
        if let Some(stranger) = self.joints.iter().find(|j| !body.contains(j)) {
            let hint = crate::base::suggest::nearest(stranger, body.iter().map(String::as_str))
                .map(|n| format!("; did you mean {n}?"))
                .unwrap_or_default();
            return Err(bad(format!("joint {stranger} is not in the robot{hint}")));
        }
        let mut frames: Vec<Vec<f64>> = self
            .frames
            .iter()
            .map(|f| column.iter().map(|c| f[*c]).collect())
            .collect();
        let ends = match self.kind {
            ClipKind::Cycle => Ends::Periodic,
            ClipKind::Path => {
                if let [first, last] = frames.as_slice() {
                    // Two frames are a straight way; a spline needs points along it.
                    frames = (0..=4)
                        .map(|k| {
                            let w = f64::from(k) / 4.0;
                            first
                                .iter()
                                .zip(last)
                                .map(|(a, b)| a + w * (b - a))
                                .collect()
                        })
                        .collect();
                }
                Ends::AtRest
            }
        };
        let limbs = self
            .segments
            .iter()
            .map(|s| {
                let joints = s
                    .joints
                    .iter()
                    .map(|joint| {
                        body.iter().position(|b| b == joint).ok_or_else(|| {
                            bad(format!(
                                "segment {}: joint {joint} is not in the robot",
                                s.name
                            ))
                        })
                    })
                    .collect::<Result<_, _>>()?;
                Ok(Limb {
                    name: s.name.clone(),
                    joints,
                    phase: s.phase,
                    duty: s.duty,
                })
            })
            .collect::<Result<_, ClipError>>()?;
        Ok(Clip {
            name: self.name.clone(),
            kind: self.kind,
            frequency_hz: self.frequency_hz,
            root: self.root,
            limbs,
            spline: Spline::new(&frames, ends),
        })
    }
}

impl Clip {
    /// Position of joint `joint` at `u`: fraction of the cycle (wrapped) or progression (clamped to 0..1).
    pub fn sample(&self, u: f64, joint: usize) -> f64 {
        self.spline.value(u, joint)
    }

    /// The whole pose at `u` into `out`.
    pub fn pose(&self, u: f64, out: &mut [f64]) {
        for (joint, out) in out.iter_mut().enumerate() {
            *out = self.spline.value(u, joint);
        }
    }

    /// Number of joints.
    pub fn joints(&self) -> usize {
        self.spline.coordinates()
    }

    /// Largest speed (per cycle or unit progression) and acceleration (per square of it) of `joint`.
    pub fn steepest(&self, joint: usize) -> (f64, f64) {
        self.spline.steepest(joint)
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
            root: RootAdvance::default(),
            segments: vec![],
            frames,
            body: vec![],
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
        let mut afloat = good.clone();
        afloat.body = vec![[0.0; 6]];
        let message = ClipFile::from_json(&afloat.to_json())
            .expect_err("one body row for two frames")
            .to_string();
        assert!(message.contains("1 rows for 2 frames"), "{message}");
        let unknown = good.to_json().replace("\"kind\"", "\"kindd\"");
        assert!(ClipFile::from_json(&unknown).is_err());
    }

    #[test]
    fn json_round_trip_and_joint_order_of_the_body() {
        let mut good = file(vec![vec![0.0, 0.5], vec![1.0, 0.25]]);
        good.body = vec![
            [0.0, 0.0, 0.2, 0.0, 0.0, 0.0],
            [0.0, 0.01, 0.1, 0.0, 0.3, 0.0],
        ];
        let back = ClipFile::from_json(&good.to_json()).expect("own output");
        assert_eq!(back, good);
        let clip = back
            .for_body(&["b".into(), "a".into()])
            .expect("same joints");
        let mut pose = [0.0; 2];
        clip.pose(1.0, &mut pose);
        assert_eq!(pose, [0.25, 1.0]);
    }
}
