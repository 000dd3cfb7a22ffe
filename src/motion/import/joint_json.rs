//! Joint-space JSON: DeepMimic's humanoid and dog, quadruped robots (Laikago, A1), clips of our own.
//!
//! DeepMimic: `{"Loop": "wrap", "Frames": [[duration, x, y, z, w, x, y, z, ...]]}`, y up, x forward.
//! Quadrupeds: `{"LoopMode": "Wrap", "FrameDuration": s, "Frames": [[...]]}` of 19 or 61 numbers: place
//! (m), quaternion x y z w, twelve joints by leg (front right, front left, rear right, rear left), z up.
//! Of a loop the last frame is the first one again.

use super::axes::{Axes, Axis};
use super::deepmimic::{self, DOG, HUMANOID, Row, Turn};
use super::error::ImportFault;
use super::raw::{Raw, RawFrame, unwrapped};
use super::uneven::{self, Grid};
use super::{ImportOptions, Imported, check_size};
use crate::body::RootPose;
use crate::motion::clip::ClipFile;
use crate::motion::take::{Take, TakeBody};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use serde::Deserialize;
use std::sync::Arc;

/// Legs of the robots, in the order of their files.
const LEGS: [&str; 4] = ["FR", "FL", "RR", "RL"];
/// Joints of a leg in Unitree's URDFs.
const LEG_JOINTS: [&str; 3] = ["hip_joint", "thigh_joint", "calf_joint"];
/// Signs and offsets of the Laikago model that the files were made for:
/// `file = (urdf + offset) * direction`.
const LAIKAGO_DIRECTIONS: [f64; 12] =
    [-1.0, 1.0, 1.0, 1.0, 1.0, 1.0, -1.0, 1.0, 1.0, 1.0, 1.0, 1.0];
const LAIKAGO_OFFSETS: [f64; 3] = [0.0, -0.6, 0.66];

#[derive(Deserialize)]
struct File {
    #[serde(rename = "Loop", alias = "LoopMode", default)]
    loops: Option<String>,
    #[serde(rename = "FrameDuration", default)]
    frame_duration_s: Option<f64>,
    #[serde(rename = "Frames")]
    frames: Vec<Vec<f64>>,
}

/// Reads the text of a JSON motion.
///
/// # Errors
/// Not such JSON, frames of another width, numbers that are not finite, durations not above zero.
pub(super) fn parse(
    text: &str,
    name: &str,
    options: &ImportOptions,
) -> Result<Imported, ImportFault> {
    let json = |kind| move |source| ImportFault::Json { kind, source };
    let value: serde_json::Value = serde_json::from_str(text).map_err(json("a motion"))?;
    if value.get("handwave").is_some() {
        let file = ClipFile::from_json(text)
            .map_err(|e| ImportFault::element("the clip", e.to_string(), "a clip of version 1"))?;
        let mut take = Take::of_clip(&file);
        if !options.origin.is_empty() {
            take.origin.clone_from(&options.origin);
        }
        return Ok(Imported {
            takes: vec![take],
            warnings: Vec::new(),
        });
    }
    let file: File = serde_json::from_value(value)
        .map_err(json("a motion with \"Frames\", a list of lists of numbers"))?;
    let width = file.frames.first().map_or(0, Vec::len);
    check_size(file.frames.len(), width)?;
    for (k, frame) in file.frames.iter().enumerate() {
        let place = || format!("frame {k}");
        if frame.len() != width {
            return Err(ImportFault::element(
                place(),
                format!("{} numbers", frame.len()),
                format!("{width}, as in the first frame"),
            ));
        }
        if let Some(v) = frame.iter().find(|v| !(v.abs() < 1e9)) {
            return Err(ImportFault::element(
                place(),
                v.to_string(),
                "finite numbers",
            ));
        }
    }
    let wraps = file
        .loops
        .as_deref()
        .is_some_and(|l| l.eq_ignore_ascii_case("wrap"));
    match (file.frame_duration_s, width) {
        (Some(_), 19 | 61) => robot(&file, name, wraps, options),
        (None, w) if w == deepmimic::width(&HUMANOID) => {
            skeleton(&file, name, wraps, &HUMANOID, options)
        }
        (None, w) if w == deepmimic::width(&DOG) => skeleton(&file, name, wraps, &DOG, options),
        (duration, width) => Err(ImportFault::element(
            "the frames",
            format!(
                "{width} numbers each, {} FrameDuration",
                if duration.is_some() {
                    "with"
                } else {
                    "without"
                }
            ),
            format!(
                "{} (DeepMimic humanoid) or {} (DeepMimic dog) without, 19 or 61 (quadruped robot) with FrameDuration",
                deepmimic::width(&HUMANOID),
                deepmimic::width(&DOG)
            ),
        )),
    }
}

fn rotation(q: [f64; 4], place: &str) -> Result<UnitQuaternion<f64>, ImportFault> {
    let [x, y, z, w] = q;
    let q = Quaternion::new(w, x, y, z);
    if !((q.norm() - 1.0).abs() < 0.1) {
        return Err(ImportFault::element(
            place,
            format!("a quaternion of length {:.3}", q.norm()),
            "unit quaternions",
        ));
    }
    Ok(UnitQuaternion::new_normalize(q))
}

/// A motion of DeepMimic on its skeleton.
fn skeleton(
    file: &File,
    name: &str,
    wraps: bool,
    rows: &[Row],
    options: &ImportOptions,
) -> Result<Imported, ImportFault> {
    let mut times = Vec::with_capacity(file.frames.len());
    let mut frames = Vec::with_capacity(file.frames.len());
    let mut t_s = 0.0;
    for (k, frame) in file.frames.iter().enumerate() {
        let place = format!("frame {k}");
        times.push(t_s);
        t_s += frame[0];
        if !(frame[0] > 0.0) && k + 1 < file.frames.len() {
            return Err(ImportFault::element(
                place,
                format!("duration {} s", frame[0]),
                "above 0 s, but for the last frame",
            ));
        }
        let mut rotations = Vec::with_capacity(rows.len());
        let mut at = 4;
        for (_, _, _, turn) in rows {
            rotations.push(match turn {
                Turn::Fixed => UnitQuaternion::identity(),
                Turn::Hinge => UnitQuaternion::from_axis_angle(&Vector3::z_axis(), frame[at]),
                Turn::Ball => {
                    let q = &frame[at..at + 4];
                    rotation([q[1], q[2], q[3], q[0]], &place)?
                }
            });
            at += turn.numbers();
        }
        frames.push(RawFrame {
            place: Vector3::new(frame[1], frame[2], frame[3]),
            rotations,
        });
    }
    let mut warnings =
        vec!["bones are those of DeepMimic's own skeleton: the file holds none".to_owned()];
    let grid = Grid::of(&times, options.rate_hz);
    if grid.uneven {
        warnings.push(format!("resampled evenly to {} frames", grid.frames));
    }
    check_size(grid.frames, rows.len())?;
    let frames = uneven::frames(&times, &frames, &grid);
    let raw = Raw {
        name: name.to_owned(),
        joints: deepmimic::joints(rows),
        dt_s: grid.dt_s,
        frames,
        wraps,
    };
    let axes = Axes {
        up: options.up.unwrap_or(Axis::Y),
        forward: options.forward.unwrap_or(Axis::new(0, false)),
    };
    let axes = axes.checked()?;
    let body = Arc::new(raw.skeleton(axes, options.unit.map_or(1.0, |u| u.metres))?);
    Ok(Imported {
        takes: vec![raw.take(&body, axes, &options.origin)],
        warnings,
    })
}

/// A motion of a quadruped robot.
fn robot(
    file: &File,
    name: &str,
    wraps: bool,
    options: &ImportOptions,
) -> Result<Imported, ImportFault> {
    let dt_s = file.frame_duration_s.unwrap_or_default();
    if !(1e-4..=10.0).contains(&dt_s) {
        return Err(ImportFault::element(
            "FrameDuration",
            format!("{dt_s} s"),
            "0.0001 to 10 s",
        ));
    }
    let names = match &options.joints {
        Some(names) if names.len() == 12 => names.clone(),
        Some(names) => {
            return Err(ImportFault::element(
                "--joints",
                format!("{} names", names.len()),
                "12, by leg: front right, front left, rear right, rear left",
            ));
        }
        None => (LEGS.iter())
            .flat_map(|leg| LEG_JOINTS.iter().map(move |joint| format!("{leg}_{joint}")))
            .collect(),
    };
    let turns = (file.frames.iter().enumerate())
        .map(|(k, f)| rotation([f[3], f[4], f[5], f[6]], &format!("frame {k}")))
        .collect::<Result<Vec<_>, _>>()?;
    // Laikago's base stands on its side: which of the two frames is level at first?
    let laikago = UnitQuaternion::new_normalize(Quaternion::new(0.5, 0.5, 0.5, 0.5));
    let level = |q: UnitQuaternion<f64>| (q * Vector3::z()).z;
    let first = turns.first().copied().unwrap_or_default();
    let is_laikago = level(first * laikago.inverse()) > level(first);
    let mut warnings = Vec::new();
    if is_laikago {
        warnings.push(
            "the base is turned as Laikago's: joints brought to the zeros of its URDF".to_owned(),
        );
    }
    let (mut poses, mut roots): (Vec<_>, Vec<RootPose>) = (Vec::new(), Vec::new());
    for (frame, turn) in file.frames.iter().zip(turns) {
        let turn = if is_laikago {
            turn * laikago.inverse()
        } else {
            turn
        };
        let mut pose = frame[7..19].to_vec();
        if is_laikago {
            for (i, q) in pose.iter_mut().enumerate() {
                *q = *q * LAIKAGO_DIRECTIONS[i] - LAIKAGO_OFFSETS[i % 3];
            }
        }
        let (roll, pitch, yaw) = turn.euler_angles();
        roots.push(RootPose {
            x_m: frame[0],
            y_m: frame[1],
            yaw_rad: unwrapped(yaw, roots.last()),
        });
        pose.extend([0.0, 0.0, frame[2], roll, pitch, 0.0]);
        poses.push(pose);
    }
    Ok(Imported {
        takes: vec![Take {
            name: name.to_owned(),
            origin: options.origin.clone(),
            dt_s,
            body: TakeBody::Floating(names),
            poses,
            roots,
            wraps,
        }],
        warnings,
    })
}
