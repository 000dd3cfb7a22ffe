//! Removal of global motion: what the whole body does is split from what its parts do.
//!
//! Rhodin 2016, sections 8.1.1 and 9.4: a least-squares rigid fit of every pose to a reference
//! frame (orthogonal Procrustes), restricted to yaw about the vertical and translation in the
//! ground plane. With one angle the fit has a closed form, an arc tangent of two sums.
//!
//! Where the text leaves room:
//! - A hand has a body too: a point named `palm` (else `wrist`) is the **anchor**; the translation
//!   carries the anchor onto its place in the reference, and the yaw is fitted about it. Without an
//!   anchor the weighted centroid takes its place.
//! - Height is always a channel. It is removed from the pose of an anchored set (a hand floats at
//!   any height) and kept in that of others (a jump and a crouch are gestures of a body).
//! - Points that move in the gestures are poor witnesses of where the body is; a point's weight is
//!   the reciprocal of its variance in the references ([`GlobalFit::weigh`]).
//! - In an image (`dim` 2) there is no ground and no yaw: translation in the image is removed.
//! - With fewer than three points and no anchor there is no body to speak of: nothing is removed.

use super::PoseHeader;
use crate::base::angle::wrap_pi;
use std::f64::consts::PI;

/// What is removed; `None` asks for the default of the point set.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GlobalOptions {
    /// The point that is the body.
    pub anchor: Option<String>,
    /// Whether yaw is removed (default: 3-D with three points or more).
    pub yaw: Option<bool>,
    /// Whether height is removed (default: anchored sets and images).
    pub height: Option<bool>,
}

/// What was removed from one pose: controls of their own (heading, crouch, distance).
#[derive(Copy, Clone, Debug, Default, PartialEq)]
pub struct GlobalMotion {
    /// Rotation about the vertical from the reference frame, -pi..pi, counter-clockwise from above.
    pub yaw_rad: f64,
    /// Displacement of the body from its place in the reference frame along x, metres.
    pub x_m: f64,
    /// The same along z.
    pub z_m: f64,
    /// Height of the body (anchor or centroid) above the tracker's origin, metres.
    pub height_m: f64,
    /// Distance of the body from the tracker's origin, metres.
    pub distance_m: f64,
}

/// Fits poses to one reference frame.
#[derive(Clone, Debug)]
pub struct GlobalFit {
    reference: Vec<[f64; 3]>,
    weights: Vec<f64>,
    anchor: Option<usize>,
    translation: bool,
    yaw: bool,
    height: bool,
    /// What is left of a pose is enlarged by this.
    scale: f64,
}

impl GlobalFit {
    /// A fit to `reference` (one place per point of `header`, metres), all points weighing alike.
    ///
    /// # Errors
    /// The name of an anchor that the header does not have.
    pub fn new(
        header: &PoseHeader,
        reference: &[[f64; 3]],
        options: &GlobalOptions,
    ) -> Result<Self, String> {
        let find = |name: &str| header.points.iter().position(|point| point == name);
        let anchor = match &options.anchor {
            Some(name) => Some(find(name).ok_or_else(|| name.clone())?),
            None => find("palm").or_else(|| find("wrist")),
        };
        let points = header.points.len();
        let solid = header.dim == 3;
        let mut reference = reference.to_vec();
        reference.resize(points, [0.0; 3]);
        Ok(Self {
            reference,
            weights: vec![1.0; points],
            anchor,
            translation: points >= 3 || (anchor.is_some() && points > 1),
            yaw: options.yaw.unwrap_or(solid && points >= 3),
            height: options.height.unwrap_or(anchor.is_some() || !solid),
            scale: 1.0,
        })
    }

    /// Enlarges the poses that [`GlobalFit::remove`] leaves by `scale` from now on: about the body,
    /// and in height about the ground where height is kept. What is removed stays in metres.
    pub fn set_scale(&mut self, scale: f64) {
        self.scale = scale;
    }

    /// Sets the weights from how much each point moves in `poses` (each a place per point).
    ///
    /// A point that moves by less than 1 % of the size of the reference frame gets the full weight.
    pub fn weigh<'a>(&mut self, poses: impl Iterator<Item = &'a [[f64; 3]]>) {
        let points = self.reference.len();
        let (mut sum, mut square) = (vec![[0.0; 3]; points], vec![0.0; points]);
        let mut count = 0.0;
        let mut local = vec![[0.0; 3]; points];
        for pose in poses {
            self.remove(pose, None, &mut local);
            count += 1.0;
            for (index, place) in local.iter().enumerate() {
                for axis in 0..3 {
                    sum[index][axis] += place[axis];
                    square[index] += place[axis] * place[axis];
                }
            }
        }
        if count == 0.0 {
            return;
        }
        let size = size_of(&self.reference);
        for index in 0..points {
            let mean: f64 = sum[index].iter().map(|s| (s / count) * (s / count)).sum();
            let variance = (square[index] / count - mean).max(0.0);
            let floor = (0.01 * size).powi(2).max(1e-12);
            self.weights[index] = floor / (variance + floor);
        }
    }

    /// Place, reference place and weight of every point that is seen.
    fn rows<'a>(
        &'a self,
        points: &'a [[f64; 3]],
        seen: Option<&'a [bool]>,
    ) -> impl Iterator<Item = (&'a [f64; 3], &'a [f64; 3], f64)> {
        (points.iter().zip(&self.reference))
            .zip(&self.weights)
            .enumerate()
            .filter(move |(index, _)| seen.is_none_or(|seen| seen.get(*index) == Some(&true)))
            .map(|(_, ((place, reference), weight))| (place, reference, *weight))
    }

    /// The body, in the pose and in the reference: the anchor, else the centroid of what is seen.
    fn bodies(&self, points: &[[f64; 3]], seen: Option<&[bool]>) -> ([f64; 3], [f64; 3]) {
        if let Some(index) = self.anchor
            && seen.is_none_or(|seen| seen.get(index) == Some(&true))
            && let (Some(body), Some(home)) = (points.get(index), self.reference.get(index))
        {
            return (*body, *home);
        }
        let (mut body, mut home, mut total) = ([0.0; 3], [0.0; 3], 0.0);
        for (place, reference, weight) in self.rows(points, seen) {
            total += weight;
            for axis in 0..3 {
                body[axis] += weight * place[axis];
                home[axis] += weight * reference[axis];
            }
        }
        if total > 0.0 {
            for axis in 0..3 {
                body[axis] /= total;
                home[axis] /= total;
            }
        }
        (body, home)
    }

    /// Where the body of a fully seen pose is: the anchor, else the weighted centroid, metres.
    pub fn body(&self, points: &[[f64; 3]]) -> [f64; 3] {
        self.bodies(points, None).0
    }

    /// How much higher than in the reference the body is, as far as height is removed, metres.
    pub fn removed_rise(&self, points: &[[f64; 3]]) -> f64 {
        let (body, home) = self.bodies(points, None);
        if self.height { body[1] - home[1] } else { 0.0 }
    }

    /// Writes the pose without its global motion to `out` and returns what was removed.
    ///
    /// `points` and `out` hold one place per point; points whose `seen` is false do not take part
    /// in the fit, but are carried along. Allocates nothing.
    pub fn remove(
        &self,
        points: &[[f64; 3]],
        seen: Option<&[bool]>,
        out: &mut [[f64; 3]],
    ) -> GlobalMotion {
        self.remove_leaning(points, seen, 0.0, out)
    }

    /// Yaw of the pose against the reference as fitted to the points that are seen, rad; 0 where
    /// yaw is not removed.
    pub fn yaw(&self, points: &[[f64; 3]], seen: Option<&[bool]>) -> f64 {
        let (body, home) = self.bodies(points, seen);
        let mut yaw = 0.0;
        if self.yaw {
            let (mut sine, mut cosine) = (0.0, 0.0);
            for (place, reference, weight) in self.rows(points, seen) {
                let (px, pz) = (place[0] - body[0], place[2] - body[2]);
                let (qx, qz) = (reference[0] - home[0], reference[2] - home[2]);
                sine += weight * (px * qz - pz * qx);
                cosine += weight * (px * qx + pz * qz);
            }
            yaw = sine.atan2(cosine);
        }
        yaw
    }

    /// As [`GlobalFit::remove`], where the points that are seen are known to make the yaw `lean_rad`
    /// larger than all of them would.
    pub fn remove_leaning(
        &self,
        points: &[[f64; 3]],
        seen: Option<&[bool]>,
        lean_rad: f64,
        out: &mut [[f64; 3]],
    ) -> GlobalMotion {
        let (body, home) = self.bodies(points, seen);
        let mut yaw = self.yaw(points, seen);
        if self.yaw && lean_rad != 0.0 {
            yaw = wrap_pi(yaw - lean_rad);
        }
        let (sin, cos) = yaw.sin_cos();
        let scale = self.scale;
        let rise = if self.height {
            scale * body[1] - home[1]
        } else {
            0.0
        };
        for (place, out) in points.iter().zip(out.iter_mut()) {
            if !self.translation {
                *out = place.map(|value| scale * value);
                continue;
            }
            let (x, z) = (scale * (place[0] - body[0]), scale * (place[2] - body[2]));
            *out = [
                x * cos - z * sin + home[0],
                scale * place[1] - rise,
                x * sin + z * cos + home[2],
            ];
        }
        GlobalMotion {
            yaw_rad: if yaw >= PI { -PI } else { yaw },
            x_m: body[0] - home[0],
            z_m: body[2] - home[2],
            height_m: body[1],
            distance_m: body.iter().map(|b| b * b).sum::<f64>().sqrt(),
        }
    }
}

/// Root mean square distance of the points from their centroid.
pub fn size_of(pose: &[[f64; 3]]) -> f64 {
    let count = pose.len().max(1) as f64;
    let mut square = 0.0;
    for axis in 0..3 {
        let mean = pose.iter().map(|p| p[axis]).sum::<f64>() / count;
        square += pose.iter().map(|p| (p[axis] - mean).powi(2)).sum::<f64>();
    }
    (square / count).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(points: &[&str]) -> PoseHeader {
        PoseHeader {
            points: points.iter().map(ToString::to_string).collect(),
            dim: 3,
            channels: Vec::new(),
        }
    }

    #[test]
    fn a_turned_and_moved_body_comes_back_to_the_reference() {
        let reference = [[0.0, 1.0, 0.0], [0.3, 1.4, 0.1], [-0.2, 0.2, 0.4]];
        let fit = GlobalFit::new(
            &header(&["a", "b", "c"]),
            &reference,
            &GlobalOptions::default(),
        )
        .expect("no anchor asked for");
        let yaw: f64 = 2.1;
        let moved = reference.map(|[x, y, z]| {
            [
                x * yaw.cos() + z * yaw.sin() + 3.0,
                y,
                -x * yaw.sin() + z * yaw.cos() - 1.0,
            ]
        });
        let mut out = [[0.0; 3]; 3];
        let motion = fit.remove(&moved, None, &mut out);
        assert!(
            (motion.yaw_rad - yaw).abs() < 1e-12,
            "yaw {}",
            motion.yaw_rad
        );
        for (out, reference) in out.iter().zip(&reference) {
            for axis in 0..3 {
                assert!(
                    (out[axis] - reference[axis]).abs() < 1e-12,
                    "{out:?} {reference:?}"
                );
            }
        }
    }

    #[test]
    fn an_unseen_point_does_not_pull_the_fit() {
        let reference = [
            [0.0, 1.0, 0.0],
            [0.3, 1.4, 0.1],
            [-0.2, 0.2, 0.4],
            [0.1, 0.5, -0.3],
        ];
        let names = header(&["a", "b", "c", "d"]);
        let fit = GlobalFit::new(&names, &reference, &GlobalOptions::default()).expect("no anchor");
        let mut moved = reference;
        moved[3] = [9.0, 9.0, 9.0];
        let mut out = [[0.0; 3]; 4];
        let seen = [true, true, true, false];
        let motion = fit.remove(&moved, Some(&seen), &mut out);
        assert!(motion.yaw_rad.abs() < 1e-12, "yaw {}", motion.yaw_rad);
        assert!((out[1][0] - 0.3).abs() < 1e-12, "{out:?}");
    }
}
