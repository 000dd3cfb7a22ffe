//! Motions as tables: one row a frame, `t` in seconds, in our axes (x forward, y left, z up) and SI units.
//!
//! - `t,<joint>,...`: joint positions of a robot, radians (metres for prismatic joints), as
//!   `handwave run --targets` writes them; with `x,y,z,roll,pitch,yaw` the root link in the world.
//! - `t,x,y,z,<joint>.rx,<joint>.ry,<joint>.rz,...`: a skeleton: the root joint's place in the world and
//!   rotation vectors of the joints in their parents' frames (of the root in the world). The bones come
//!   from another file, `--skeleton`.

use super::axes::{Axes, Axis};
use super::error::ImportFault;
use super::raw::{Raw, RawFrame, RawJoint, unwrapped};
use super::text::{fault, number};
use super::uneven::{self, Grid};
use super::{ImportOptions, Imported, MAX_JOINTS, check_size};
use crate::base::suggest::hint;
use crate::body::{RootPose, Skeleton};
use crate::motion::take::{Take, TakeBody};
use nalgebra::{UnitQuaternion, Vector3};
use std::sync::Arc;

/// Columns of the root.
const PLACE: [&str; 3] = ["x", "y", "z"];
const TURN: [&str; 3] = ["roll", "pitch", "yaw"];

struct Table {
    names: Vec<String>,
    times: Vec<f64>,
    /// Without the time.
    rows: Vec<Vec<f64>>,
}

/// Reads a table; `skeleton` is the one of `--skeleton`, where it is given.
///
/// # Errors
/// A line that is no such row, columns used twice, time that does not grow, rotation vectors without a
/// skeleton or of joints that it lacks.
pub(super) fn parse(
    text: &str,
    name: &str,
    skeleton: Option<&Arc<Skeleton>>,
    options: &ImportOptions,
) -> Result<Imported, ImportFault> {
    let table = Table::parse(text)?;
    let grid = Grid::of(&table.times, options.rate_hz);
    check_size(grid.frames, table.names.len())?;
    let mut warnings = Vec::new();
    if grid.uneven {
        warnings.push(format!(
            "{} rows resampled evenly to {} frames of {:.4} s",
            table.rows.len(),
            grid.frames,
            grid.dt_s
        ));
    }
    let is_skeleton = table.names.iter().any(|n| n.ends_with(".rx"));
    let take = match (is_skeleton, skeleton) {
        (true, Some(skeleton)) => table.skeleton(name, skeleton, &grid, options)?,
        (true, None) => {
            return Err(ImportFault::element(
                "the header",
                "rotation vectors, but no skeleton",
                "--skeleton FILE with the bones: a clip, BVH, ASF or glTF of the same joints",
            ));
        }
        (false, _) => table.joints(name, &grid, options),
    };
    Ok(Imported {
        takes: vec![take],
        warnings,
    })
}

impl Table {
    fn parse(text: &str) -> Result<Self, ImportFault> {
        let mut lines = text
            .trim_start_matches('\u{feff}')
            .lines()
            .enumerate()
            .map(|(i, line)| (i + 1, line.trim()))
            .filter(|(_, line)| !line.is_empty());
        let (line, header) = lines.next().unwrap_or((1, ""));
        let mut names: Vec<String> = (header.split(','))
            .map(|n| n.trim().trim_matches('"').to_owned())
            .collect();
        if names.first().map(String::as_str) != Some("t") || names.len() < 2 {
            return Err(fault(
                line,
                super::text::shown(header),
                "a header `t,<joint>,...` or `t,x,y,z,<joint>.rx,<joint>.ry,<joint>.rz,...`",
            )
            .into());
        }
        if names.len() > 8 * MAX_JOINTS {
            return Err(fault(
                line,
                format!("{} columns", names.len()),
                format!("at most {}", 8 * MAX_JOINTS),
            )
            .into());
        }
        names.remove(0);
        for (i, name) in names.iter().enumerate() {
            if name.is_empty() || names[..i].contains(name) {
                return Err(fault(
                    line,
                    format!("column {} called {name:?}", i + 2),
                    "a name of its own for each column",
                )
                .into());
            }
        }
        let (mut times, mut rows): (Vec<f64>, Vec<Vec<f64>>) = (Vec::new(), Vec::new());
        for (line, text) in lines {
            let cells: Vec<&str> = text.split(',').collect();
            if cells.len() != names.len() + 1 {
                return Err(fault(
                    line,
                    format!("{} cells", cells.len()),
                    format!("{}, as the header has", names.len() + 1),
                )
                .into());
            }
            let t = number(line, cells[0], "t")?;
            if let Some(last) = times.last().filter(|last| !(t > **last)) {
                return Err(fault(line, format!("t {t} after {last}"), "time that grows").into());
            }
            let row = (cells[1..].iter().zip(&names))
                .map(|(cell, name)| number(line, cell, name))
                .collect::<Result<Vec<f64>, _>>()?;
            times.push(t);
            rows.push(row);
            check_size(rows.len(), names.len())?;
        }
        Ok(Self { names, times, rows })
    }

    fn column(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|n| n == name)
    }

    /// Three columns, if all are there.
    fn columns(&self, names: [&str; 3]) -> Option<[usize; 3]> {
        let [a, b, c] = names.map(|n| self.column(n));
        Some([a?, b?, c?])
    }

    /// A robot's joints; bolted down, or over the ground where the table tells place and turn.
    fn joints(&self, name: &str, grid: &Grid, options: &ImportOptions) -> Take {
        let body = self.columns(PLACE).zip(self.columns(TURN));
        let used = |i: &usize| body.is_some_and(|(p, t)| p.contains(i) || t.contains(i));
        let joints: Vec<usize> = (0..self.names.len()).filter(|i| !used(i)).collect();
        let names = joints.iter().map(|i| self.names[*i].clone()).collect();
        let (mut poses, mut roots): (Vec<Vec<f64>>, Vec<RootPose>) = (Vec::new(), Vec::new());
        for row in uneven::rows(&self.times, &self.rows, grid) {
            let mut pose: Vec<f64> = joints.iter().map(|i| row[*i]).collect();
            let mut root = RootPose::default();
            if let Some((place, turn)) = body {
                root.x_m = row[place[0]];
                root.y_m = row[place[1]];
                root.yaw_rad = unwrapped(row[turn[2]], roots.last());
                pose.extend([0.0, 0.0, row[place[2]], row[turn[0]], row[turn[1]], 0.0]);
            }
            poses.push(pose);
            roots.push(root);
        }
        Take {
            name: name.to_owned(),
            origin: options.origin.clone(),
            dt_s: grid.dt_s,
            body: match body {
                Some(_) => TakeBody::Floating(names),
                None => TakeBody::Joints(names),
            },
            poses,
            roots,
            wraps: false,
        }
    }

    /// A skeleton's rotation vectors; joints without columns stay at rest.
    fn skeleton(
        &self,
        name: &str,
        skeleton: &Arc<Skeleton>,
        grid: &Grid,
        options: &ImportOptions,
    ) -> Result<Take, ImportFault> {
        let mut known: Vec<Option<[usize; 3]>> = vec![None; skeleton.len()];
        for column in self.names.iter().filter(|n| !PLACE.contains(&n.as_str())) {
            let joint = [".rx", ".ry", ".rz"]
                .iter()
                .find_map(|s| column.strip_suffix(s));
            let index = joint.and_then(|joint| skeleton.joint(joint));
            let names = || skeleton.joints.iter().map(|j| j.name.as_str());
            let (Some(joint), Some(index)) = (joint, index) else {
                return Err(fault(
                    1,
                    format!(
                        "column {column:?}{}",
                        hint(joint.unwrap_or(column), names())
                    ),
                    "x, y, z, and rx, ry, rz of joints of the skeleton",
                )
                .into());
            };
            let all = [".rx", ".ry", ".rz"].map(|s| format!("{joint}{s}"));
            let [x, y, z] = &all;
            known[index] = self.columns([x, y, z]);
            if known[index].is_none() {
                return Err(fault(
                    1,
                    format!("column {column:?} without the others of its joint"),
                    all.join(", "),
                )
                .into());
            }
        }
        let place = self.columns(PLACE);
        let vector = |row: &[f64], at: [usize; 3]| Vector3::from(at.map(|i| row[i]));
        let rest = skeleton.rest_pose([0.0; 3]);
        let frames: Vec<RawFrame> = (self.rows.iter())
            .map(|row| RawFrame {
                place: place.map_or_else(Vector3::zeros, |at| vector(row, at)),
                rotations: (known.iter().enumerate())
                    .map(|(joint, at)| match at {
                        Some(at) => UnitQuaternion::from_scaled_axis(vector(row, *at)),
                        None => Skeleton::rotation(&rest, joint),
                    })
                    .collect(),
            })
            .collect();
        let raw = Raw {
            name: name.to_owned(),
            joints: (skeleton.joints.iter().enumerate())
                .map(|(i, j)| RawJoint {
                    name: j.name.clone(),
                    parent: j.parent,
                    offset: j.offset_m.into(),
                    rest: Skeleton::rotation(&rest, i),
                })
                .collect(),
            dt_s: grid.dt_s,
            frames: uneven::frames(&self.times, &frames, grid),
            wraps: false,
        };
        // Already in our axes and in metres.
        let ours = Axes {
            up: Axis::new(2, false),
            forward: Axis::new(0, false),
        };
        Ok(raw.take_in_metres(skeleton, ours, &options.origin))
    }
}
