//! A take: a motion as it was recorded, sampled evenly in time, before it becomes a clip.

use super::clip::{ClipFile, ClipKind};
use crate::body::{RootPose, Skeleton};
use nalgebra::Point3;
use std::sync::Arc;

/// Evenly sampled poses of a body and its way over the ground.
///
/// What importers give and exporters write; analysis and cutting work on it. Frames are at
/// `0, dt_s, 2 dt_s, ...`; metres, radians, x forward, y left, z up.
#[derive(Clone, Debug)]
pub struct Take {
    /// Name of the motion, usually that of its file.
    pub name: String,
    /// Where it comes from: author, recording, licence.
    pub origin: String,
    /// Time between frames, seconds, above zero.
    pub dt_s: f64,
    /// What the coordinates of a pose are.
    pub body: TakeBody,
    /// One pose per frame, free of the root's place and heading.
    pub poses: Vec<Vec<f64>>,
    /// The root's place and heading, one per frame; heading without jumps of a full turn.
    pub roots: Vec<RootPose>,
    /// The last frame is the first one, a cycle later.
    pub wraps: bool,
}

/// The body of a take.
#[derive(Clone, Debug)]
pub enum TakeBody {
    /// Joint positions of a robot that is bolted down.
    Joints(Vec<String>),
    /// Joint positions, then the six coordinates of the body over the ground
    /// (see [`crate::body::JointSpace`]).
    Floating(Vec<String>),
    /// Poses of a skeleton (see [`crate::body::SkeletonSpace`]).
    Skeleton(Arc<Skeleton>),
}

impl Take {
    /// Number of frames.
    pub fn len(&self) -> usize {
        self.poses.len()
    }

    /// Whether there is no frame.
    pub fn is_empty(&self) -> bool {
        self.poses.is_empty()
    }

    /// Time from the first to the last frame, seconds.
    pub fn duration_s(&self) -> f64 {
        self.dt_s * self.len().saturating_sub(1) as f64
    }

    /// Pose and root at `t_s` (clamped to the take): linear between frames, rotations along the
    /// shortest way at constant speed, the root along an arc.
    pub fn at(&self, t_s: f64) -> (Vec<f64>, RootPose) {
        let last = self.len().saturating_sub(1);
        let at = (t_s / self.dt_s).clamp(0.0, last as f64);
        let k = (at.floor() as usize).min(last.saturating_sub(1));
        let u = at - k as f64;
        let (Some(a), Some(mut root)) = (self.poses.get(k), self.roots.get(k).copied()) else {
            return (Vec::new(), RootPose::default());
        };
        let (Some(b), Some(next)) = (self.poses.get(k + 1), self.roots.get(k + 1)) else {
            return (a.clone(), root);
        };
        let mut pose: Vec<f64> = a.iter().zip(b).map(|(a, b)| a + u * (b - a)).collect();
        if let TakeBody::Skeleton(skeleton) = &self.body {
            for joint in 0..skeleton.len() {
                let (from, to) = (Skeleton::rotation(a, joint), Skeleton::rotation(b, joint));
                let between = from.try_slerp(&to, u, 1e-9).unwrap_or(from);
                Skeleton::set_rotation(&mut pose, joint, &between);
            }
        }
        root.travel(root.advance_to(next).scaled(u));
        (pose, root)
    }

    /// The part from `start_s` to `end_s` (clamped), as `frames` evenly spaced frames, at least two.
    pub fn part(&self, start_s: f64, end_s: f64, frames: usize) -> Self {
        let intervals = frames.max(2) - 1;
        let start_s = start_s.clamp(0.0, self.duration_s());
        let end_s = end_s.clamp(start_s, self.duration_s());
        let mut part = Self {
            poses: Vec::with_capacity(intervals + 1),
            roots: Vec::with_capacity(intervals + 1),
            dt_s: ((end_s - start_s) / intervals as f64).max(1e-9),
            wraps: self.wraps && start_s <= 0.0 && end_s >= self.duration_s(),
            ..self.clone()
        };
        for k in 0..=intervals {
            let (pose, root) = self.at(start_s + (end_s - start_s) * k as f64 / intervals as f64);
            part.poses.push(pose);
            part.roots.push(root);
        }
        part.keep_hemispheres();
        part
    }

    /// Chooses the signs of quaternions so that each lies next to that of the frame before.
    fn keep_hemispheres(&mut self) {
        if !matches!(self.body, TakeBody::Skeleton(_)) {
            return;
        }
        for k in 1..self.poses.len() {
            let (before, after) = self.poses.split_at_mut(k);
            let pairs = after[0][3..].chunks_exact_mut(4);
            for (q, last) in pairs.zip(before[k - 1][3..].chunks_exact(4)) {
                let dot: f64 = q.iter().zip(last).map(|(a, b)| a * b).sum();
                if dot < 0.0 {
                    q.iter_mut().for_each(|v| *v = -*v);
                }
            }
        }
    }

    /// The joint whose rotation (rad) or position differs most between the first and the last frame.
    pub fn gap(&self) -> Option<(String, f64)> {
        let (first, last) = (self.poses.first()?, self.poses.last()?);
        let gaps: Vec<(&String, f64)> = match &self.body {
            TakeBody::Joints(names) | TakeBody::Floating(names) => (names.iter().enumerate())
                .map(|(i, name)| (name, (first[i] - last[i]).abs()))
                .collect(),
            TakeBody::Skeleton(skeleton) => (skeleton.joints.iter().enumerate())
                .map(|(i, joint)| {
                    let turn = |pose: &[f64]| Skeleton::rotation(pose, i);
                    (&joint.name, turn(first).angle_to(&turn(last)))
                })
                .collect(),
        };
        let most = gaps.into_iter().max_by(|a, b| a.1.total_cmp(&b.1));
        most.map(|(name, gap)| (name.clone(), gap))
    }

    /// The take as a clip of `frames` frames.
    ///
    /// A cycle lasts from the first frame to the last, which is taken for the first one a cycle later
    /// and not written; a path runs through all. The root's travel is the twist from the first frame to
    /// the last, its way is written frame by frame. Limbs are left to who knows the feet.
    pub fn to_clip(&self, kind: ClipKind, frames: usize) -> ClipFile {
        let even = match kind {
            ClipKind::Cycle => {
                let mut even = self.part(0.0, self.duration_s(), frames + 1);
                even.poses.truncate(frames);
                even.roots.truncate(frames);
                even
            }
            ClipKind::Path => self.part(0.0, self.duration_s(), frames),
        };
        let first = even.roots.first().copied().unwrap_or_default();
        let last = self.roots.last().copied().unwrap_or_default();
        let way = even.roots.iter().map(|root| {
            let p = first.to_local(Point3::new(root.x_m, root.y_m, 0.0));
            [p.x, p.y, root.yaw_rad - first.yaw_rad]
        });
        let joints = match &self.body {
            TakeBody::Joints(names) | TakeBody::Floating(names) => names.clone(),
            TakeBody::Skeleton(skeleton) => {
                skeleton.joints.iter().map(|j| j.name.clone()).collect()
            }
        };
        let (mut frames, mut body) = (even.poses, Vec::new());
        if let TakeBody::Floating(names) = &self.body {
            for frame in &mut frames {
                let mut six = [0.0; 6];
                let rest = frame.split_off(names.len().min(frame.len()));
                six.iter_mut().zip(rest).for_each(|(s, r)| *s = r);
                body.push(six);
            }
        }
        ClipFile {
            handwave: "clip".into(),
            version: 1,
            name: self.name.clone(),
            origin: self.origin.clone(),
            kind,
            joints,
            frequency_hz: match kind {
                ClipKind::Cycle => 1.0 / self.duration_s().max(1e-9),
                ClipKind::Path => 0.0,
            },
            duration_s: match kind {
                ClipKind::Cycle => 0.0,
                ClipKind::Path => self.duration_s(),
            },
            root: first.advance_to(&last),
            segments: Vec::new(),
            skeleton: match &self.body {
                TakeBody::Skeleton(skeleton) => Some(skeleton.as_ref().clone()),
                _ => None,
            },
            body,
            way: if matches!(self.body, TakeBody::Joints(_)) {
                Vec::new()
            } else {
                way.collect()
            },
            frames,
        }
    }

    /// A clip as a take: a cycle once, its last frame the first one again, further on by its travel;
    /// a cycle without frequency lasts one second, and so does a path without duration.
    pub fn of_clip(file: &ClipFile) -> Self {
        let n = file.frames.len();
        let mut poses = file.frames.clone();
        for (pose, body) in poses.iter_mut().zip(&file.body) {
            pose.extend(body);
        }
        let at = |k: usize| match file.way.get(k) {
            Some([x_m, y_m, yaw_rad]) => RootPose {
                x_m: *x_m,
                y_m: *y_m,
                yaw_rad: *yaw_rad,
            },
            None => {
                let intervals = match file.kind {
                    ClipKind::Cycle => n,
                    ClipKind::Path => n - 1,
                };
                let mut root = RootPose::default();
                root.travel(file.root.scaled(k as f64 / intervals.max(1) as f64));
                root
            }
        };
        let mut roots: Vec<RootPose> = (0..n).map(at).collect();
        let or_one = |v: f64| if v > 0.0 { v } else { 1.0 };
        let duration_s = match file.kind {
            ClipKind::Cycle => 1.0 / or_one(file.frequency_hz),
            ClipKind::Path => or_one(file.duration_s),
        };
        if file.kind == ClipKind::Cycle {
            poses.extend(poses.first().cloned());
            let mut end = RootPose::default();
            end.travel(file.root);
            roots.push(end);
        }
        let names = file.joints.clone();
        let mut take = Self {
            name: file.name.clone(),
            origin: file.origin.clone(),
            dt_s: duration_s / poses.len().saturating_sub(1).max(1) as f64,
            body: match &file.skeleton {
                Some(skeleton) => TakeBody::Skeleton(Arc::new(skeleton.clone())),
                None if !file.body.is_empty() => TakeBody::Floating(names),
                None => TakeBody::Joints(names),
            },
            poses,
            roots,
            wraps: file.kind == ClipKind::Cycle,
        };
        take.keep_hemispheres();
        take
    }

    /// The first `seconds` of the take; one that wraps goes round as often as needed, each cycle going on
    /// where the last ended.
    pub fn repeated(&self, seconds: f64) -> Self {
        let mut long = self.clone();
        let frames = ((seconds / self.dt_s).round() as usize).max(1) + 1;
        let (Some(start), Some(end)) = (self.roots.first(), self.roots.last()) else {
            return long;
        };
        let cycle = self.len() - 1;
        let round = start.advance_to(end);
        if self.wraps && cycle > 0 {
            while long.len() < frames {
                let k = long.len();
                let mut root = *start;
                root.travel(round.scaled((k / cycle) as f64));
                root.travel(start.advance_to(&self.roots[k % cycle]));
                long.poses.push(self.poses[k % cycle].clone());
                long.roots.push(root);
            }
        }
        long.poses.truncate(frames);
        long.roots.truncate(frames);
        long.wraps = self.wraps && long.len() == self.len();
        long.keep_hemispheres();
        long
    }
}
