//! Takes as glTF 2.0: nodes of a skeleton or of a robot's links, one animation, a skin where there is one.
//!
//! glTF is in metres, y up, and faces z: ours turned by [`axes`]. The root node moves in the world, all
//! other nodes keep our local frames. Frames become keys with linear interpolation.

use super::{ExportError, body_in_world, check_frames, root_in_world};
use crate::body::{Skeleton, SkinnedMesh};
use crate::motion::take::{Take, TakeBody};
use crate::robot::RobotModel;
use crate::robot::model::JointKind;
use nalgebra::{Isometry3, Matrix4, Translation3, UnitQuaternion, Vector3};
use serde_json::{Value, json};

/// Numbers of glTF for the types of values.
const FLOAT: u32 = 5126;
const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;

/// The turn from our axes (x forward, z up) to those of glTF (z forward, y up).
fn axes() -> UnitQuaternion<f64> {
    // x to z, y to x, z to y: a third of a turn about the diagonal.
    let diagonal = Vector3::new(1.0, 1.0, 1.0);
    UnitQuaternion::from_scaled_axis(-diagonal.normalize() * (std::f64::consts::TAU / 3.0))
}

/// A glTF document and its one buffer.
#[derive(Clone, Debug)]
pub struct GltfScene {
    document: Value,
    buffer: Vec<u8>,
}

impl GltfScene {
    /// As one binary file (.glb).
    pub fn to_glb(&self) -> Vec<u8> {
        let mut json = self.document.to_string().into_bytes();
        json.resize(json.len().next_multiple_of(4), b' ');
        let mut out = b"glTF".to_vec();
        let put = |out: &mut Vec<u8>, v: usize| out.extend((v as u32).to_le_bytes());
        put(&mut out, 2);
        put(&mut out, 12 + 8 + json.len() + 8 + self.buffer.len());
        put(&mut out, json.len());
        out.extend(b"JSON");
        out.extend(&json);
        put(&mut out, self.buffer.len());
        out.extend(b"BIN\0");
        out.extend(&self.buffer);
        out
    }

    /// As text (.gltf), the buffer as a data URI.
    pub fn to_json(&self) -> String {
        let mut document = self.document.clone();
        document["buffers"][0]["uri"] = Value::String(format!(
            "data:application/octet-stream;base64,{}",
            base64(&self.buffer)
        ));
        format!("{document:#}\n")
    }
}

/// A skeleton's take, with the surface `skin` where it is given.
///
/// # Errors
/// A take of a robot or without frames; a surface of another skeleton.
pub fn skeleton_to_gltf(take: &Take, skin: Option<&SkinnedMesh>) -> Result<GltfScene, ExportError> {
    check_frames(take)?;
    let TakeBody::Skeleton(skeleton) = &take.body else {
        return Err(ExportError::Body {
            take: take.name.clone(),
            found: "a robot's joints",
            format: "glTF",
            allowed: "give the URDF of the robot (--urdf FILE)",
        });
    };
    let turn = axes();
    let rest = skeleton.rest_pose([0.0; 3]);
    let mut scene = Scene::default();
    for (i, joint) in skeleton.joints.iter().enumerate() {
        let local = Skeleton::rotation(&rest, i);
        let (place, local) = match joint.parent {
            None => (
                turn * root_in_world(&take.poses[0], &take.roots[0])
                    .translation
                    .vector,
                turn * local,
            ),
            Some(_) => (joint.offset_m.into(), local),
        };
        scene.node(&joint.name, joint.parent, place, local);
    }
    let frames = take.poses.iter().zip(&take.roots);
    let roots: Vec<Isometry3<f64>> = frames
        .map(|(pose, root)| turn * root_in_world(pose, root))
        .collect();
    let times = scene.times(take);
    let mut channels = Channels::default();
    let places: Vec<f64> = roots
        .iter()
        .flat_map(|f| f.translation.vector.data.0[0])
        .collect();
    channels.add(&mut scene, 0, "translation", times, &places);
    for i in 0..skeleton.len() {
        let turns = take.poses.iter().enumerate().map(|(k, pose)| match i {
            0 => roots[k].rotation,
            _ => Skeleton::rotation(pose, i),
        });
        channels.add(&mut scene, i, "rotation", times, &continuous(turns));
    }
    match skin {
        Some(skin) => scene.skin(skin, skeleton, take)?,
        None => {
            let joints: Vec<usize> = (0..skeleton.len()).collect();
            scene.skins.push(json!({"joints": joints, "skeleton": 0}));
        }
    }
    Ok(scene.finish(take, channels))
}

/// A robot's take: the links of `model` as nodes.
///
/// # Errors
/// A take of a skeleton or without frames; a moving joint of the robot that the take lacks.
pub fn robot_to_gltf(take: &Take, model: &RobotModel) -> Result<GltfScene, ExportError> {
    check_frames(take)?;
    let (TakeBody::Joints(names) | TakeBody::Floating(names)) = &take.body else {
        return Err(ExportError::Body {
            take: take.name.clone(),
            found: "a skeleton",
            format: "glTF of a robot",
            allowed: "leave the URDF out",
        });
    };
    let columns = (model.joint_names().iter())
        .map(|joint| {
            names
                .iter()
                .position(|n| n == joint)
                .ok_or_else(|| ExportError::Joint {
                    take: take.name.clone(),
                    found: format!("no joint {joint}, which the robot has"),
                    allowed: format!("joints of the take: {}", names.join(", ")),
                })
        })
        .collect::<Result<Vec<usize>, _>>()?;
    let positions: Vec<Vec<f64>> = (take.poses.iter())
        .map(|pose| columns.iter().map(|c| pose[*c]).collect())
        .collect();
    let turn = axes();
    let root = |k: usize| match &take.body {
        TakeBody::Floating(names) => {
            let (place, [roll, pitch, yaw]) =
                body_in_world(&take.poses[k][names.len()..], &take.roots[k]);
            let rotation = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
            turn * Isometry3::from_parts(Translation3::from(place.coords), rotation)
        }
        _ => turn * Isometry3::identity(),
    };
    // Parents first: links in the order in which they are reached from the root.
    let mut order = vec![model.root];
    let mut at = 0;
    while at < order.len() {
        let link = order[at];
        order.extend(
            model
                .joints
                .iter()
                .filter(|j| j.parent == link)
                .map(|j| j.child),
        );
        at += 1;
    }
    let mut scene = Scene::default();
    let zero = vec![0.0; columns.len()];
    let mut moving = Vec::new();
    for (node, link) in order.iter().enumerate() {
        let (parent, frame) = match model.parent_joint[*link] {
            None => (None, root(0)),
            Some(j) => {
                let joint = &model.joints[j];
                if joint.kind != JointKind::Fixed {
                    moving.push((node, j));
                }
                let parent = order.iter().position(|l| *l == joint.parent);
                (parent, model.joint_transform(j, &zero))
            }
        };
        scene.node(
            &model.links[*link],
            parent,
            frame.translation.vector,
            frame.rotation,
        );
    }
    let times = scene.times(take);
    let mut channels = Channels::default();
    if matches!(take.body, TakeBody::Floating(_)) {
        let roots: Vec<Isometry3<f64>> = (0..take.len()).map(root).collect();
        let places: Vec<f64> = roots
            .iter()
            .flat_map(|f| f.translation.vector.data.0[0])
            .collect();
        channels.add(&mut scene, 0, "translation", times, &places);
        let turns = continuous(roots.iter().map(|f| f.rotation));
        channels.add(&mut scene, 0, "rotation", times, &turns);
    }
    for (node, j) in moving {
        let frames = positions.iter().map(|q| model.joint_transform(j, q));
        if model.joints[j].kind == JointKind::Prismatic {
            let places: Vec<f64> = frames
                .flat_map(|f| f.translation.vector.data.0[0])
                .collect();
            channels.add(&mut scene, node, "translation", times, &places);
        } else {
            let turns = continuous(frames.map(|f| f.rotation));
            channels.add(&mut scene, node, "rotation", times, &turns);
        }
    }
    Ok(scene.finish(take, channels))
}

/// The numbers of rotations, each on the side of the one before.
fn continuous(turns: impl Iterator<Item = UnitQuaternion<f64>>) -> Vec<f64> {
    let mut last = UnitQuaternion::identity();
    let mut numbers = Vec::new();
    for turn in turns {
        let q = turn.into_inner().coords;
        let sign = if q.dot(&last.coords) < 0.0 { -1.0 } else { 1.0 };
        last = UnitQuaternion::new_unchecked((q * sign).into());
        numbers.extend((q * sign).iter());
    }
    numbers
}

/// What a document holds while it is put together.
#[derive(Default)]
struct Scene {
    nodes: Vec<Value>,
    /// Nodes at the top of the scene.
    tops: Vec<usize>,
    children: Vec<Vec<usize>>,
    skins: Vec<Value>,
    meshes: Vec<Value>,
    accessors: Vec<Value>,
    views: Vec<Value>,
    buffer: Vec<u8>,
}

#[derive(Default)]
struct Channels {
    channels: Vec<Value>,
    samplers: Vec<Value>,
}

impl Channels {
    fn add(&mut self, scene: &mut Scene, node: usize, path: &str, times: usize, values: &[f64]) {
        let width = if path == "rotation" { 4 } else { 3 };
        let output = scene.floats(values, width, None);
        self.channels.push(json!({
            "sampler": self.samplers.len(), "target": {"node": node, "path": path}
        }));
        self.samplers
            .push(json!({"input": times, "output": output, "interpolation": "LINEAR"}));
    }
}

impl Scene {
    fn node(
        &mut self,
        name: &str,
        parent: Option<usize>,
        place: Vector3<f64>,
        turn: UnitQuaternion<f64>,
    ) {
        let index = self.nodes.len();
        self.nodes.push(json!({
            "name": name,
            "translation": place.data.0[0],
            "rotation": <[f64; 4]>::from(turn.into_inner().coords),
        }));
        self.children.push(Vec::new());
        match parent {
            Some(parent) => self.children[parent].push(index),
            None => self.tops.push(index),
        }
    }

    fn times(&mut self, take: &Take) -> usize {
        let times: Vec<f64> = (0..take.len()).map(|k| k as f64 * take.dt_s).collect();
        self.floats(&times, 1, None)
    }

    /// Adds bytes and returns their view.
    fn view(&mut self, bytes: &[u8], target: Option<u32>) -> usize {
        self.buffer.resize(self.buffer.len().next_multiple_of(4), 0);
        let mut view = json!({
            "buffer": 0, "byteOffset": self.buffer.len(), "byteLength": bytes.len()
        });
        if let Some(target) = target {
            view["target"] = target.into();
        }
        self.buffer.extend(bytes);
        self.views.push(view);
        self.views.len() - 1
    }

    fn accessor(&mut self, view: usize, component: u32, kind: &str, count: usize) -> usize {
        self.accessors.push(json!({
            "bufferView": view, "componentType": component, "type": kind, "count": count
        }));
        self.accessors.len() - 1
    }

    /// Adds floats, `width` an element, with their bounds.
    fn floats(&mut self, values: &[f64], width: usize, target: Option<u32>) -> usize {
        let singles: Vec<f32> = values.iter().map(|v| *v as f32).collect();
        let bytes: Vec<u8> = singles.iter().flat_map(|v| v.to_le_bytes()).collect();
        let view = self.view(&bytes, target);
        let kind = match width {
            1 => "SCALAR",
            3 => "VEC3",
            4 => "VEC4",
            _ => "MAT4",
        };
        let accessor = self.accessor(view, FLOAT, kind, values.len() / width);
        if width <= 3 {
            let bound = |pick: fn(f32, f32) -> f32, from: f32| {
                let each = (0..width).map(|i| singles.iter().skip(i).step_by(width));
                each.map(|v| v.fold(from, |a, b| pick(a, *b)))
                    .collect::<Vec<f32>>()
            };
            self.accessors[accessor]["min"] = json!(bound(f32::min, f32::INFINITY));
            self.accessors[accessor]["max"] = json!(bound(f32::max, f32::NEG_INFINITY));
        }
        accessor
    }

    /// Adds the surface, on nodes that are the joints of `skeleton`.
    fn skin(
        &mut self,
        skin: &SkinnedMesh,
        skeleton: &Skeleton,
        take: &Take,
    ) -> Result<(), ExportError> {
        const ARRAY: Option<u32> = Some(34962);
        const ELEMENTS: Option<u32> = Some(34963);
        let turn = axes().to_homogeneous();
        let back = turn.transpose();
        let mut joints: Vec<usize> = Vec::new();
        let mut matrices = Vec::new();
        for bone in skin.bones() {
            if bone.joint >= skeleton.len() {
                return Err(ExportError::Joint {
                    take: take.name.clone(),
                    found: format!("a surface on joint {}", bone.joint),
                    allowed: format!("one of the {} joints of the take", skeleton.len()),
                });
            }
            // A node may be in a skin once: a second bone of a joint gets a node of its own.
            if joints.contains(&bone.joint) {
                let name = format!("{}_bone{}", skeleton.joints[bone.joint].name, joints.len());
                let none = (Vector3::zeros(), UnitQuaternion::identity());
                self.node(&name, Some(bone.joint), none.0, none.1);
                joints.push(self.nodes.len() - 1);
            } else {
                joints.push(bone.joint);
            }
            let bind: Matrix4<f64> = bone.inverse_bind * back;
            matrices.extend(bind.as_slice());
        }
        let positions: Vec<f64> = (skin.positions().iter())
            .flat_map(|p| turn.transform_point(p).coords.data.0[0])
            .collect();
        let sets = skin.influences().iter();
        let weights: Vec<f64> = sets.clone().flatten().map(|i| i.weight).collect();
        let bones = sets.flatten().flat_map(|i| i.bone.to_le_bytes());
        let bones: Vec<u8> = bones.collect();
        let corners = skin.triangles().iter().flatten();
        let corners: Vec<u8> = corners.flat_map(|v| v.to_le_bytes()).collect();
        let position = self.floats(&positions, 3, ARRAY);
        let weight = self.floats(&weights, 4, ARRAY);
        let view = self.view(&bones, ARRAY);
        let joint = self.accessor(view, UNSIGNED_SHORT, "VEC4", skin.positions().len());
        let view = self.view(&corners, ELEMENTS);
        let index = self.accessor(view, UNSIGNED_INT, "SCALAR", skin.triangles().len() * 3);
        let bind = self.floats(&matrices, 16, None);
        self.meshes.push(json!({"primitives": [{
            "attributes": {"POSITION": position, "JOINTS_0": joint, "WEIGHTS_0": weight},
            "indices": index, "mode": 4
        }]}));
        self.skins
            .push(json!({"joints": joints, "skeleton": 0, "inverseBindMatrices": bind}));
        self.nodes
            .push(json!({"name": "surface", "mesh": 0, "skin": 0}));
        self.children.push(Vec::new());
        self.tops.push(self.nodes.len() - 1);
        Ok(())
    }

    fn finish(mut self, take: &Take, channels: Channels) -> GltfScene {
        for (node, children) in self.nodes.iter_mut().zip(&self.children) {
            if !children.is_empty() {
                node["children"] = json!(children);
            }
        }
        self.buffer.resize(self.buffer.len().next_multiple_of(4), 0);
        let mut document = json!({
            "asset": {"version": "2.0", "generator": "Handwave"},
            "scene": 0,
            "scenes": [{"nodes": self.tops}],
            "nodes": self.nodes,
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{"byteLength": self.buffer.len()}],
        });
        if !take.origin.is_empty() {
            document["asset"]["copyright"] = json!(take.origin);
        }
        let parts = [("skins", self.skins), ("meshes", self.meshes)];
        for (key, list) in parts.into_iter().filter(|(_, list)| !list.is_empty()) {
            document[key] = Value::Array(list);
        }
        if !channels.channels.is_empty() {
            document["animations"] = json!([{
                "name": take.name, "channels": channels.channels, "samplers": channels.samplers
            }]);
        }
        GltfScene {
            document,
            buffer: self.buffer,
        }
    }
}

fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for three in bytes.chunks(3) {
        let byte = |i: usize| u32::from(three.get(i).copied().unwrap_or(0));
        let bits = byte(0) << 16 | byte(1) << 8 | byte(2);
        for i in 0..4 {
            let letter = LETTERS[(bits >> (18 - 6 * i)) as usize & 63];
            text.push(if i <= three.len() {
                letter as char
            } else {
                '='
            });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn our_axes_become_those_of_gltf() {
        let turn = axes();
        let off = (turn * Vector3::x() - Vector3::z()).norm()
            + (turn * Vector3::y() - Vector3::x()).norm()
            + (turn * Vector3::z() - Vector3::y()).norm();
        assert!(off < 1e-12, "{off}");
    }

    #[test]
    fn bytes_become_base64_of_every_length() {
        for (bytes, text) in [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v")] {
            assert_eq!(base64(bytes.as_bytes()), text);
        }
    }
}
