//! Animations of a glTF file: keys of a node's place, rotation and scale, at any time.

use super::super::error::ImportFault;
use super::buffers::Buffers;
use gltf::animation::{Interpolation, Property};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// Keys of one property of one node.
struct Track {
    times: Vec<f64>,
    /// Values per key; three times as many for cubic splines (in-tangent, value, out-tangent).
    values: Vec<f64>,
    width: usize,
    interpolation: Interpolation,
}

/// What an animation does to a node; what it leaves alone is as at rest.
#[derive(Default)]
pub(super) struct NodeTracks {
    translation: Option<Track>,
    rotation: Option<Track>,
    scale: Option<Track>,
}

/// Translation, rotation and scale of a node in its parent's frame.
#[derive(Copy, Clone, Debug)]
pub(super) struct Local {
    pub translation: Vector3<f64>,
    pub rotation: UnitQuaternion<f64>,
    pub scale: Vector3<f64>,
}

/// One animation: tracks by node, and when it begins and ends.
pub(super) struct Animation {
    pub name: String,
    pub nodes: Vec<NodeTracks>,
    pub start_s: f64,
    pub end_s: f64,
}

impl Animation {
    pub fn read(
        animation: &gltf::Animation<'_>,
        name: String,
        nodes: usize,
        buffers: &Buffers,
    ) -> Result<Self, ImportFault> {
        let mut tracks: Vec<NodeTracks> = Vec::new();
        tracks.resize_with(nodes, NodeTracks::default);
        let (mut start_s, mut end_s) = (f64::INFINITY, f64::NEG_INFINITY);
        for channel in animation.channels() {
            let node = channel.target().node().index();
            let (slot, width) = match channel.target().property() {
                Property::Translation => (&mut tracks[node].translation, 3),
                Property::Rotation => (&mut tracks[node].rotation, 4),
                Property::Scale => (&mut tracks[node].scale, 3),
                Property::MorphTargetWeights => continue,
            };
            let place = format!("animation {name}, node {node}");
            let track = Track::read(&channel.sampler(), width, &place, buffers)?;
            start_s = start_s.min(track.times[0]);
            end_s = track.times.last().map_or(end_s, |t| end_s.max(*t));
            *slot = Some(track);
        }
        if !start_s.is_finite() {
            (start_s, end_s) = (0.0, 0.0);
        }
        Ok(Self {
            name,
            nodes: tracks,
            start_s,
            end_s,
        })
    }

    /// Whether it turns, moves or scales the node.
    pub fn moves(&self, node: usize) -> bool {
        let tracks = &self.nodes[node];
        tracks.translation.is_some() || tracks.rotation.is_some() || tracks.scale.is_some()
    }

    /// The node at `t_s`; what is not animated as in `rest`.
    pub fn local(&self, node: usize, rest: &Local, t_s: f64) -> Local {
        let tracks = &self.nodes[node];
        let vector = |track: &Option<Track>, rest: Vector3<f64>| match track {
            Some(track) => {
                let v = track.at(t_s);
                Vector3::new(v[0], v[1], v[2])
            }
            None => rest,
        };
        let rotation = match &tracks.rotation {
            Some(track) => rotation_of(track.at(t_s)),
            None => rest.rotation,
        };
        Local {
            translation: vector(&tracks.translation, rest.translation),
            rotation,
            scale: vector(&tracks.scale, rest.scale),
        }
    }

    /// Every value that the scale of a node takes at its keys.
    pub fn scales(&self, node: usize) -> Vec<Vector3<f64>> {
        let Some(track) = &self.nodes[node].scale else {
            return Vec::new();
        };
        (0..track.times.len())
            .map(|k| Vector3::from_column_slice(track.value(k)))
            .collect()
    }
}

/// The rotation nearest to four numbers; none for numbers near zero.
pub(super) fn rotation_of(v: [f64; 4]) -> UnitQuaternion<f64> {
    let q = Quaternion::new(v[3], v[0], v[1], v[2]);
    UnitQuaternion::try_new(q, 1e-9).unwrap_or_else(UnitQuaternion::identity)
}

impl Track {
    fn read(
        sampler: &gltf::animation::Sampler<'_>,
        width: usize,
        place: &str,
        buffers: &Buffers,
    ) -> Result<Self, ImportFault> {
        let times = buffers.numbers(&sampler.input(), 1)?;
        let values = buffers.numbers(&sampler.output(), width)?;
        let interpolation = sampler.interpolation();
        let each = match interpolation {
            Interpolation::CubicSpline => 3,
            _ => 1,
        };
        if values.len() != times.len() * width * each {
            return Err(ImportFault::element(
                place,
                format!("{} values for {} keys", values.len() / width, times.len()),
                format!("{each} for each key"),
            ));
        }
        if let Some(k) = (1..times.len()).find(|k| !(times[*k] > times[*k - 1])) {
            return Err(ImportFault::element(
                place,
                format!("key {k} at {} s after {} s", times[k], times[k - 1]),
                "times that grow",
            ));
        }
        Ok(Self {
            times,
            values,
            width,
            interpolation,
        })
    }

    /// The numbers of key `k`.
    fn value(&self, k: usize) -> &[f64] {
        match self.interpolation {
            Interpolation::CubicSpline => self.part(3 * k + 1),
            _ => self.part(k),
        }
    }

    fn part(&self, index: usize) -> &[f64] {
        &self.values[index * self.width..(index + 1) * self.width]
    }

    /// The value at `t_s`, held before the first and after the last key (glTF 2.0, appendix C).
    fn at(&self, t_s: f64) -> [f64; 4] {
        let mut out = [0.0; 4];
        let after = self.times.partition_point(|t| *t <= t_s);
        if after == 0 || after == self.times.len() {
            let key = after.saturating_sub(1);
            out[..self.width].copy_from_slice(self.value(key));
            return out;
        }
        let key = after - 1;
        let span = self.times[after] - self.times[key];
        let u = (t_s - self.times[key]) / span;
        let (a, b) = (self.value(key), self.value(after));
        match self.interpolation {
            Interpolation::Step => out[..self.width].copy_from_slice(a),
            Interpolation::Linear if self.width == 4 => {
                let array = |v: &[f64]| [v[0], v[1], v[2], v[3]];
                let (a, b) = (rotation_of(array(a)), rotation_of(array(b)));
                let between = a.try_slerp(&b, u, 1e-9).unwrap_or(a);
                out = between.into_inner().coords.into();
            }
            Interpolation::Linear => {
                for i in 0..self.width {
                    out[i] = a[i] + u * (b[i] - a[i]);
                }
            }
            Interpolation::CubicSpline => {
                let leaving = self.part(3 * key + 2);
                let arriving = self.part(3 * after);
                let (u2, u3) = (u * u, u * u * u);
                for i in 0..self.width {
                    out[i] = (2.0 * u3 - 3.0 * u2 + 1.0) * a[i]
                        + span * (u3 - 2.0 * u2 + u) * leaving[i]
                        + (3.0 * u2 - 2.0 * u3) * b[i]
                        + span * (u3 - u2) * arriving[i];
                }
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn track(interpolation: Interpolation, values: Vec<f64>) -> Track {
        Track {
            times: vec![1.0, 3.0],
            values,
            width: 3,
            interpolation,
        }
    }

    #[test]
    fn keys_are_joined_as_their_interpolation_says() {
        let linear = track(Interpolation::Linear, vec![0.0, 1.0, 2.0, 4.0, 1.0, 0.0]);
        assert_eq!(linear.at(1.5)[..3], [1.0, 1.0, 1.5]);
        assert_eq!(
            linear.at(0.0)[..3],
            [0.0, 1.0, 2.0],
            "held before the first key"
        );
        assert_eq!(
            linear.at(9.0)[..3],
            [4.0, 1.0, 0.0],
            "held after the last key"
        );
        let step = track(Interpolation::Step, vec![0.0, 1.0, 2.0, 4.0, 1.0, 0.0]);
        assert_eq!(step.at(2.9)[..3], [0.0, 1.0, 2.0]);
        // x(t) = t^2 from 1 to 3: slopes 2 and 6; a cubic meets it exactly.
        let mut values = vec![0.0; 18];
        (values[3], values[6], values[9], values[12]) = (1.0, 2.0, 6.0, 9.0);
        let cubic = track(Interpolation::CubicSpline, values);
        let off = (cubic.at(2.0)[0] - 4.0).abs();
        assert!(off < 1e-12, "{off} off the parabola");
    }
}
