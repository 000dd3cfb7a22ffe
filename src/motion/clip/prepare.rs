//! From a clip's file to a clip that can be sampled: parts matched by name, splines fitted.

use super::file::{ClipError, ClipFile, ClipKind};
use super::{Clip, Limb};
use crate::base::angle::wrap_pi;
use crate::body::{BODY, JointSpace, PoseSpace, RootPose, SkeletonSpace};
use crate::motion::spline::{Ends, Spline};
use std::f64::consts::PI;
use std::ops::Range;
use std::sync::Arc;

impl ClipFile {
    /// Prepares the clip for the joints `joints`, in that order, without a body over the ground.
    ///
    /// Every one of them must be in the clip; joints that the body lacks are an error too, so that a
    /// clip of another robot is found at load and not on the floor.
    pub fn for_body(&self, joints: &[String]) -> Result<Clip, ClipError> {
        self.for_space(&JointSpace::fixed(joints))
    }

    /// Prepares the clip for the poses of `space`, part by part, by name.
    ///
    /// Where the space has a body over the ground and the clip does not tell it, the body stays at
    /// zero: see [`ClipFile::body`].
    pub fn for_space(&self, space: &dyn PoseSpace) -> Result<Clip, ClipError> {
        let bad = |problem: String| ClipError::Content {
            clip: self.name.clone(),
            problem,
        };
        let own = self.parts();
        let strange = |name: &str| {
            let hint =
                crate::base::suggest::nearest(name, space.parts().iter().map(|p| p.name.as_str()))
                    .map(|n| format!("; did you mean {n}?"))
                    .unwrap_or_default();
            format!("joint {name} is not in the robot{hint}")
        };
        let mut columns: Vec<Option<usize>> = Vec::with_capacity(space.len());
        for part in space.parts() {
            // A skeleton's place is called root, and some have a joint of that name too.
            let same = |(name, _): &&(_, Range<usize>)| *name == part.name;
            let found = (own.iter().filter(same))
                .find(|(_, range)| range.len() == part.coordinates.len())
                .or_else(|| own.iter().find(same));
            match found {
                Some((_, range)) if range.len() == part.coordinates.len() => {
                    columns.extend(range.clone().map(Some));
                }
                Some((name, range)) => {
                    return Err(bad(format!(
                        "{name} has {} coordinates, the body has {}: one is a robot's, the other a skeleton's",
                        range.len(),
                        part.coordinates.len()
                    )));
                }
                None if part.name == BODY => columns.extend(part.coordinates.clone().map(|_| None)),
                None => {
                    return Err(bad(format!(
                        "has no joint {}, which the robot has",
                        part.name
                    )));
                }
            }
        }
        for (name, _) in &own {
            let known = space.parts().iter().any(|p| p.name == *name);
            if !known && name != BODY {
                return Err(bad(strange(name)));
            }
        }
        let width = self.frames.first().map_or(0, Vec::len);
        let body = self.turned_evenly();
        let value = |k: usize, column: &Option<usize>| match column {
            Some(c) if *c < width => self.frames[k][*c],
            Some(c) => body[k][*c - width],
            None => 0.0,
        };
        let mut frames: Vec<Vec<f64>> = (0..self.frames.len())
            .map(|k| columns.iter().map(|c| value(k, c)).collect())
            .collect();
        if self.skeleton.is_some() {
            self.keep_hemisphere(space, &mut frames).map_err(&bad)?;
        }
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
                let mut coordinates = Vec::new();
                for joint in &s.joints {
                    let part = space.parts().iter().find(|p| p.name == *joint);
                    let part =
                        part.ok_or_else(|| bad(format!("segment {}: {}", s.name, strange(joint))))?;
                    coordinates.extend(part.coordinates.clone());
                }
                Ok(Limb {
                    name: s.name.clone(),
                    coordinates,
                    phase: s.phase,
                    duty: s.duty,
                })
            })
            .collect::<Result<_, ClipError>>()?;
        Ok(Clip {
            name: self.name.clone(),
            kind: self.kind,
            frequency_hz: self.frequency_hz,
            duration_s: self.duration_s,
            root: self.root,
            limbs,
            spline: Spline::new(&frames, ends),
            way: self.rates(ends),
        })
    }

    /// The body's rows with angles that go on from row to row. They begin in -3/4..5/4 of half a turn, so that
    /// root links whose axes are turned by quarters look alike in all clips.
    fn turned_evenly(&self) -> Vec<[f64; 6]> {
        let mut rows = self.body.clone();
        let mut near = [0.25 * PI; 3];
        for row in &mut rows {
            for (angle, near) in row[3..].iter_mut().zip(&mut near) {
                *angle = *near + wrap_pi(*angle - *near);
                *near = *angle;
            }
        }
        rows
    }

    /// Parts of a frame, with the columns of each; the body's lie behind the frame's own.
    fn parts(&self) -> Vec<(String, Range<usize>)> {
        let mut parts: Vec<(String, Range<usize>)> = match &self.skeleton {
            Some(skeleton) => SkeletonSpace::new(Arc::new(skeleton.clone()))
                .parts()
                .iter()
                .map(|p| (p.name.clone(), p.coordinates.clone()))
                .collect(),
            None => (self.joints.iter().enumerate())
                .map(|(i, name)| (name.clone(), i..i + 1))
                .collect(),
        };
        if !self.body.is_empty() {
            let width = self.frames.first().map_or(0, Vec::len);
            parts.push((BODY.into(), width..width + 6));
        }
        parts
    }

    /// Chooses the signs of quaternions so that no joint turns the long way round between frames.
    fn keep_hemisphere(
        &self,
        space: &dyn PoseSpace,
        frames: &mut [Vec<f64>],
    ) -> Result<(), String> {
        let joints = space.parts().iter().filter(|p| p.coordinates.len() == 4);
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        for part in joints {
            let range = part.coordinates.clone();
            for k in 1..frames.len() {
                let (before, after) = frames.split_at_mut(k);
                let q = &mut after[0][range.clone()];
                if dot(&before[k - 1][range.clone()], q) < 0.0 {
                    q.iter_mut().for_each(|v| *v = -*v);
                }
            }
            if self.kind == ClipKind::Cycle
                && let (Some(first), Some(last)) = (frames.first(), frames.last())
                && dot(&first[range.clone()], &last[range.clone()]) < 0.0
            {
                return Err(format!(
                    "joint {} turns a full circle in one cycle; cut the cycle elsewhere or make it a path",
                    part.name
                ));
            }
        }
        Ok(())
    }

    /// How fast the travelling frame moves along the clip, per unit of it, when it does not move evenly.
    fn rates(&self, ends: Ends) -> Option<Spline> {
        let n = self.way.len();
        if n < 4 {
            return None;
        }
        let at = |k: usize| {
            let [x_m, y_m, yaw_rad] = self.way[k];
            RootPose { x_m, y_m, yaw_rad }
        };
        let mut total = RootPose::default();
        total.travel(self.root);
        // Twists between neighbours; a cycle goes on with the first frame, one round further.
        let place = |k: usize| match ends {
            Ends::Periodic if k >= n => {
                let mut on = total;
                on.travel(RootPose::default().advance_to(&at(k - n)));
                on
            }
            _ => at(k.min(n - 1)),
        };
        let (steps, intervals) = match ends {
            Ends::Periodic => (n, n as f64),
            Ends::AtRest => (n - 1, (n - 1) as f64),
        };
        let twist = |k: usize| {
            let a = place(k).advance_to(&place(k + 1));
            [a.forward_m, a.left_m, a.yaw_rad].map(|v| v * intervals)
        };
        let rates: Vec<Vec<f64>> = (0..n)
            .map(|k| {
                // At a frame: the mean of the steps before and after it.
                let (before, after) = match ends {
                    Ends::Periodic => (twist((k + n - 1) % n), twist(k)),
                    Ends::AtRest => (twist(k.saturating_sub(1)), twist(k.min(steps - 1))),
                };
                before
                    .iter()
                    .zip(after)
                    .map(|(a, b)| 0.5 * (a + b))
                    .collect()
            })
            .collect();
        Some(Spline::new(&rates, ends))
    }
}
