//! A file's axes: which way is up, which way the body faces, and the rotation into ours.

use super::error::ImportFault;
use super::raw::Raw;
use crate::base::suggest::hint;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use std::fmt;
use std::str::FromStr;

/// A direction along an axis of a file.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct Axis {
    /// 0 is x, 1 y, 2 z.
    pub index: usize,
    /// Against the axis.
    pub negative: bool,
}

impl Axis {
    /// Every direction with its name.
    pub const NAMED: [(&'static str, Self); 6] = [
        ("x", Self::new(0, false)),
        ("-x", Self::new(0, true)),
        ("y", Self::new(1, false)),
        ("-y", Self::new(1, true)),
        ("z", Self::new(2, false)),
        ("-z", Self::new(2, true)),
    ];

    /// Up as nearly every animation file has it.
    pub const Y: Self = Self::new(1, false);

    /// The direction of axis `index` (0 to 2).
    pub const fn new(index: usize, negative: bool) -> Self {
        Self { index, negative }
    }

    /// As a unit vector of the file.
    pub fn vector(self) -> Vector3<f64> {
        let mut v = Vector3::zeros();
        v[self.index] = if self.negative { -1.0 } else { 1.0 };
        v
    }
}

impl fmt::Display for Axis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sign = if self.negative { "-" } else { "" };
        write!(f, "{sign}{}", ["x", "y", "z"][self.index.min(2)])
    }
}

impl FromStr for Axis {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let names = Self::NAMED.map(|(name, _)| name);
        let found = Self::NAMED.iter().find(|(name, _)| *name == text);
        found.map(|(_, axis)| *axis).ok_or_else(|| {
            format!(
                "no axis {text:?}{} Allowed: {}",
                hint(text, names),
                names.join(", ")
            )
        })
    }
}

/// The axes of a file, settled.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct Axes {
    /// Up.
    pub up: Axis,
    /// Where the body at rest faces.
    pub forward: Axis,
}

impl Axes {
    /// The rotation that turns vectors of the file into ours: x forward, y left, z up.
    pub fn rotation(self) -> UnitQuaternion<f64> {
        let (forward, up) = (self.forward.vector(), self.up.vector());
        let left = up.cross(&forward);
        let rows = Matrix3::from_rows(&[forward.transpose(), left.transpose(), up.transpose()]);
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rows))
    }

    /// The axes, if forward is level.
    pub(super) fn checked(self) -> Result<Self, ImportFault> {
        if self.up.index == self.forward.index {
            return Err(ImportFault::element(
                "the axes",
                format!("up {}, forward {}", self.up, self.forward),
                "two different axes",
            ));
        }
        Ok(self)
    }

    /// The axes of a motion whose up is `up`: facing `forward` where it is given, else by left and
    /// right joints, else by travel, else `default`. The second value says how it was found.
    ///
    /// Pairs of joints come before travel: who walks backwards faces the other way.
    pub(super) fn find(
        up: Axis,
        forward: Option<Axis>,
        default: Axis,
        raw: &Raw,
    ) -> Result<(Self, &'static str), ImportFault> {
        let with = |forward| Self { up, forward };
        if let Some(forward) = forward {
            return Ok((with(forward).checked()?, "as told"));
        }
        let flat = |v: Vector3<f64>| v - up.vector() * v.dot(&up.vector());
        let places = raw.rest_places();
        let size = places.iter().fold(0.0, |m: f64, p| m.max(p.norm()));
        let left = flat(left_of_right(raw, &places));
        if left.norm() > 1e-3 * size {
            let ahead = nearest(left.cross(&up.vector()), up);
            return Ok((with(ahead), "left and right joints"));
        }
        if let Some(way) = travel(raw, up, size) {
            return Ok((with(nearest(way, up)), "direction of travel"));
        }
        let axis = if default.index == up.index {
            Axis::new((up.index + 1) % 3, false)
        } else {
            default
        };
        Ok((with(axis), "the format's usual axis"))
    }
}

/// The axis next to `v`, not along `up`.
fn nearest(v: Vector3<f64>, up: Axis) -> Axis {
    let level = (0..3).filter(|i| *i != up.index);
    let index = level.max_by(|a, b| v[*a].abs().total_cmp(&v[*b].abs()));
    let index = index.unwrap_or((up.index + 1) % 3);
    Axis::new(index, v[index] < 0.0)
}

/// Sum of the ways from right joints to their left counterparts at rest.
fn left_of_right(raw: &Raw, places: &[Vector3<f64>]) -> Vector3<f64> {
    let names: Vec<String> = raw.joints.iter().map(|j| plain(&j.name)).collect();
    let mut sum = Vector3::zeros();
    for (i, name) in names.iter().enumerate() {
        for mirrored in mirror(name) {
            if let Some(other) = names.iter().position(|n| *n == mirrored) {
                sum += places[i] - places[other];
                break;
            }
        }
    }
    sum
}

/// A name in lower case without numbers, so that sides can be compared.
fn plain(name: &str) -> String {
    let kept = name.chars().filter(|c| !c.is_ascii_digit());
    let lower: String = kept.flat_map(char::to_lowercase).collect();
    lower.trim_matches(['_', '-', '.', ' ']).to_owned()
}

/// What the right counterpart of a left joint may be called; nothing for others.
fn mirror(name: &str) -> Vec<String> {
    if name.contains("left") {
        return vec![name.replace("left", "right")];
    }
    let separators = ['_', '-', '.', ' ', ':'];
    let mut found = Vec::new();
    let mut start = 0;
    for (end, c) in name.char_indices().chain([(name.len(), '_')]) {
        if separators.contains(&c) {
            if &name[start..end] == "l" {
                found.push(format!("{}r{}", &name[..start], &name[end..]));
            }
            start = end + c.len_utf8();
        }
    }
    if let Some(rest) = name.strip_prefix('l') {
        found.push(format!("r{rest}"));
    }
    found
}

/// Where the body travels, in the frame of the root at rest; `None` where it stays.
fn travel(raw: &Raw, up: Axis, size: f64) -> Option<Vector3<f64>> {
    let up = up.vector();
    let flat = |v: Vector3<f64>| v - up * v.dot(&up);
    let first = raw.frames.first()?;
    let far = |p: &Vector3<f64>| flat(p - first.place).norm() > 0.3 * size.max(1e-6);
    let end = raw.frames.iter().position(|f| far(&f.place))?;
    let way = flat(raw.frames[end].place - first.place);
    let rest = raw.joints.first()?.rest;
    let turn = first.rotations.first()? * rest.inverse();
    let heading = 2.0 * turn.imag().dot(&up).atan2(turn.w);
    Some(UnitQuaternion::from_scaled_axis(-heading * up) * way)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pair_of_axes_turns_right_handed() {
        for (_, up) in Axis::NAMED {
            for (_, forward) in Axis::NAMED {
                if up.index == forward.index {
                    continue;
                }
                let turn = Axes { up, forward }.rotation();
                let off = (turn * forward.vector() - Vector3::x()).norm()
                    + (turn * up.vector() - Vector3::z()).norm();
                assert!(off < 1e-12, "up {up}, forward {forward}: {off}");
            }
        }
    }

    #[test]
    fn left_joints_find_their_right_ones_whatever_they_are_called() {
        for (left, right) in [
            ("b_LeftUpperArm_09", "b_RightUpperArm_06"),
            ("UpperLeg_L", "UpperLeg_R"),
            ("lfemur", "rfemur"),
            ("arm_joint_L__4_", "arm_joint_R__2_"),
            ("mixamorig:LeftFoot", "mixamorig:RightFoot"),
        ] {
            let names = mirror(&plain(left));
            assert!(names.contains(&plain(right)), "{left}: {names:?}");
        }
        assert!(mirror(&plain("Spine_1")).is_empty());
    }
}
