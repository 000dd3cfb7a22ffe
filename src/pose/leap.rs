//! Leap Motion recordings (LeapJS playback, decompressed JSON): millimetres, microseconds.
//!
//! Axes: x right, y up from the device, z towards the user; right-handed like ours. The first
//! hand of each frame is taken; a finger that a frame lacks was not seen.

use super::{PoseHeader, PoseSample, Recording};
use serde::Deserialize;

const FINGERS: [&str; 5] = ["thumb", "index", "middle", "ring", "pinky"];
const JOINTS: [&str; 3] = ["mcp", "pip", "dip"];

#[derive(Deserialize)]
struct LeapFile {
    frames: Vec<LeapFrame>,
}

#[derive(Deserialize)]
struct LeapFrame {
    timestamp: f64,
    #[serde(default)]
    hands: Vec<LeapHand>,
    #[serde(default)]
    pointables: Vec<LeapFinger>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct LeapHand {
    id: Option<i64>,
    palm_position: [f64; 3],
    confidence: Option<f64>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct LeapFinger {
    hand_id: Option<i64>,
    #[serde(rename = "type")]
    kind: Option<usize>,
    tip_position: [f64; 3],
    mcp_position: Option<[f64; 3]>,
    pip_position: Option<[f64; 3]>,
    dip_position: Option<[f64; 3]>,
}

fn metres(place: [f64; 3]) -> [f64; 3] {
    place.map(|value| value * 1e-3)
}

/// Whether `text` looks like a Leap Motion recording.
pub fn is_leap(text: &str) -> bool {
    text.contains("\"palmPosition\"") && text.contains("\"frames\"")
}

/// Reads a Leap Motion recording: palm and finger tips, with `joints` also the knuckles.
///
/// Time starts at 0. Frames without a hand are samples in which nothing was seen; frames not
/// later than the one before are dropped.
///
/// # Errors
/// What was found and what is allowed: not a Leap Motion recording, no hand in it.
pub fn parse(text: &str, joints: bool) -> Result<Recording, String> {
    let leap: LeapFile = serde_json::from_str(text).map_err(|error| {
        format!("not a Leap Motion recording ({error}); expected {{\"frames\":[{{\"timestamp\",\"hands\",\"pointables\"}}, ...]}}, decompressed")
    })?;
    let mut points = vec!["palm".to_owned()];
    points.extend(FINGERS.iter().map(|finger| format!("{finger}_tip")));
    if joints {
        for finger in FINGERS {
            points.extend(JOINTS.iter().map(|joint| format!("{finger}_{joint}")));
        }
    }
    let mut samples: Vec<PoseSample> = Vec::new();
    let mut start = None;
    for frame in &leap.frames {
        if !frame.timestamp.is_finite() {
            continue;
        }
        let t = (frame.timestamp - *start.get_or_insert(frame.timestamp)) * 1e-6;
        if samples.last().is_some_and(|last| t <= last.t) {
            continue;
        }
        let mut places = vec![None; points.len()];
        let mut confidence = Vec::new();
        if let Some(hand) = frame.hands.first() {
            places[0] = Some(metres(hand.palm_position));
            for finger in &frame.pointables {
                let Some(kind) = finger.kind.filter(|kind| *kind < FINGERS.len()) else {
                    continue;
                };
                if finger.hand_id.is_some() && finger.hand_id != hand.id {
                    continue;
                }
                places[1 + kind] = Some(metres(finger.tip_position));
                if joints {
                    let found = [
                        finger.mcp_position,
                        finger.pip_position,
                        finger.dip_position,
                    ];
                    for (joint, place) in found.into_iter().enumerate() {
                        places[6 + 3 * kind + joint] = place.map(metres);
                    }
                }
            }
            if let Some(value) = hand.confidence.filter(|value| *value < 1.0) {
                confidence = vec![value.max(0.0); points.len()];
            }
        }
        if places.iter().flatten().flatten().any(|v| !v.is_finite()) {
            continue;
        }
        samples.push(PoseSample {
            t,
            points: places,
            confidence,
            channels: Vec::new(),
        });
    }
    if !samples.iter().any(|sample| sample.points[0].is_some()) {
        return Err("no frame with a hand in it; record with the hand over the device".into());
    }
    Ok(Recording {
        header: PoseHeader {
            points,
            dim: 3,
            channels: Vec::new(),
        },
        samples,
    })
}
