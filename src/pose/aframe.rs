//! A-Frame motion capture recordings (JSON): a headset and hand-held controllers, with their orientation.
//!
//! ```text
//! {"camera":{"poses":[{"position":{"x":0,"y":1.6,"z":0},"rotation":{"x":0,"y":180,"z":0},"timestamp":306686.1}, ...]},
//!  "left":{"poses":[...]},"right":{"poses":[...]}}
//! ```
//! Metres, y up, forward is -z; degrees, applied about y, then x, then z (the order A-Frame sets);
//! milliseconds. A point alone does not tell how it is turned: every device gives two, itself and
//! a tip ahead of it.

use super::{PoseHeader, PoseSample, Recording};
use nalgebra::{Rotation3, Vector3};
use serde::Deserialize;
use std::collections::BTreeMap;

/// How far ahead of a device its tip is, metres.
pub const TIP_M: f64 = 0.1;

/// A device's pose farther from the sample's time than this counts as not seen, milliseconds.
const APART_MS: f64 = 50.0;

#[derive(Deserialize)]
struct Device {
    #[serde(default)]
    poses: Vec<DevicePose>,
}

#[derive(Deserialize)]
struct DevicePose {
    position: Xyz,
    #[serde(default)]
    rotation: Xyz,
    timestamp: f64,
}

#[derive(Deserialize, Default)]
struct Xyz {
    x: f64,
    y: f64,
    z: f64,
}

impl DevicePose {
    /// Where the device is, and its tip.
    fn places(&self) -> [[f64; 3]; 2] {
        let Xyz { x, y, z } = self.rotation;
        let about = |axis, degrees: f64| Rotation3::from_axis_angle(&axis, degrees.to_radians());
        let rotation =
            about(Vector3::y_axis(), y) * about(Vector3::x_axis(), x) * about(Vector3::z_axis(), z);
        let place = Vector3::new(self.position.x, self.position.y, self.position.z);
        let tip = place + rotation * Vector3::new(0.0, 0.0, -TIP_M);
        [place.into(), tip.into()]
    }
}

/// Whether `text` looks like an A-Frame motion capture recording.
pub fn is_aframe(text: &str) -> bool {
    ["\"poses\"", "\"position\"", "\"timestamp\""]
        .iter()
        .all(|key| text.contains(key))
}

/// Reads an A-Frame motion capture recording: points `head` (the camera), `left`, `right` and what
/// else was recorded by its own name, and for each a `_tip` 0.1 m ahead of it.
///
/// Times are those of the head, or of the first device where there is none, from 0; the others are
/// taken at their nearest time, and count as not seen where that is over 50 ms away.
///
/// # Errors
/// What was expected and what was found.
pub fn parse(text: &str) -> Result<Recording, String> {
    let devices: BTreeMap<String, Device> = serde_json::from_str(text).map_err(|error| {
        format!("not an A-Frame motion capture recording ({error}); expected {{\"camera\":{{\"poses\":[{{\"position\",\"rotation\",\"timestamp\"}}, ...]}}, \"left\":..., \"right\":...}}")
    })?;
    let mut devices: Vec<(String, Vec<DevicePose>)> = devices
        .into_iter()
        .filter(|(_, device)| !device.poses.is_empty())
        .map(|(name, device)| match name.as_str() {
            "camera" => ("head".into(), device.poses),
            _ => (name, device.poses),
        })
        .collect();
    // The head first; the rest stays in the order of names.
    devices.sort_by_key(|(name, _)| name != "head");
    let Some((_, leader)) = devices.first() else {
        return Err(
            "no device with poses in it; record with the headset or a controller on".into(),
        );
    };
    let start = leader[0].timestamp;
    let mut samples: Vec<PoseSample> = Vec::new();
    let mut at = vec![0; devices.len()];
    for pose in leader {
        let t = (pose.timestamp - start) * 1e-3;
        if samples.last().is_some_and(|last| t <= last.t) {
            continue;
        }
        let mut points = Vec::with_capacity(2 * devices.len());
        for ((_, poses), at) in devices.iter().zip(&mut at) {
            let apart = |index: usize| (poses[index].timestamp - pose.timestamp).abs();
            while *at + 1 < poses.len() && apart(*at + 1) <= apart(*at) {
                *at += 1;
            }
            let places = poses[*at].places();
            let is_seen = apart(*at) <= APART_MS
                && places.as_flattened().iter().all(|value| value.is_finite());
            points.extend(places.map(|place| is_seen.then_some(place)));
        }
        samples.push(PoseSample {
            t,
            points,
            confidence: Vec::new(),
            channels: Vec::new(),
        });
    }
    let both = |(name, _): &(String, _)| [name.clone(), format!("{name}_tip")];
    Ok(Recording {
        header: PoseHeader {
            points: devices.iter().flat_map(both).collect(),
            dim: 3,
            channels: Vec::new(),
        },
        samples,
    })
}
