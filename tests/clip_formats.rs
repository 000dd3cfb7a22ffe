//! Motion files of other programs: what comes in, what goes out, and what is refused.

mod support;

use handwave::body::{PoseSpace, Skeleton, SkeletonSpace};
use handwave::motion::import::gltf::GltfFile;
use handwave::motion::import::{ImportOptions, open};
use handwave::motion::take::{Take, TakeBody};
use nalgebra::{Isometry3, Matrix4, Point3};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use support::data::shared_data;

fn fox() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/avatars/fox.glb")
}

fn centimetres() -> ImportOptions {
    ImportOptions {
        unit: Some("cm".parse().expect("a unit")),
        ..ImportOptions::default()
    }
}

fn skeleton(take: &Take) -> &Arc<Skeleton> {
    match &take.body {
        TakeBody::Skeleton(skeleton) => skeleton,
        other => panic!("no skeleton but {other:?}"),
    }
}

fn parse_gltf(path: &Path, options: &ImportOptions) -> GltfFile {
    let bytes = std::fs::read(path).expect("the file");
    GltfFile::parse(&bytes, "test", path.parent(), options).expect("a good glTF")
}

/// Places of all joints in the world at frame `k`.
fn places(take: &Take, k: usize) -> Vec<Point3<f64>> {
    let skeleton = skeleton(take);
    let mut frames = vec![Isometry3::identity(); skeleton.len()];
    skeleton.frames(&take.poses[k], &mut frames);
    let at = |f: &Isometry3<f64>| take.roots[k].to_world(Point3::from(f.translation.vector));
    frames.iter().map(at).collect()
}

#[test]
fn the_fox_stands_on_its_feet_looks_ahead_and_its_cycles_close() {
    let file = parse_gltf(&fox(), &centimetres());
    println!("{:?}", file.warnings);
    let skeleton = &file.skeleton;
    assert_eq!(
        skeleton.joints[0].name, "b_Hip_01",
        "still joints above fold in"
    );
    let mut rest = vec![0.0; skeleton.coordinates()];
    SkeletonSpace::new(Arc::clone(skeleton)).rest(&mut rest);
    let at = |name: &str| skeleton.position(&rest, skeleton.joint(name).expect("joint"));
    let ahead = at("b_Head_05").x - at("b_Hip_01").x;
    let left = at("b_LeftLeg01_015").y - at("b_RightLeg01_019").y;
    assert!(
        ahead > 0.5 && ahead < 0.9,
        "the head is {ahead:.3} m before the hip"
    );
    assert!(
        left > 0.1 && left < 0.2,
        "left leg {left:.3} m left of the right"
    );
    let durations: Vec<(String, f64, bool)> = (file.takes.iter())
        .map(|t| (t.name.clone(), t.duration_s(), t.wraps))
        .collect();
    for (take, (name, seconds)) in
        (durations.iter()).zip([("Survey", 3.417), ("Walk", 0.708), ("Run", 1.158)])
    {
        assert!(
            take.0 == name && (take.1 - seconds).abs() < 1e-3 && take.2,
            "{take:?}, expected {name} of {seconds} s that wraps"
        );
    }
    // In every frame of the walk some foot is near the ground, and none below it.
    let walk = &file.takes[1];
    for k in 0..walk.len() {
        let low = places(walk, k).iter().map(|p| p.z).fold(f64::MAX, f64::min);
        assert!(
            low.abs() < 0.06,
            "frame {k}: the lowest joint is {low:.3} m high"
        );
    }
}

#[test]
fn a_fragment_selects_one_animation_and_a_wrong_one_lists_all() {
    let with = |name: &str| PathBuf::from(format!("{}#{name}", fox().display()));
    let walk = open(&with("Walk"), &centimetres()).expect("Walk is there");
    assert_eq!(walk.takes.len(), 1);
    let message = open(&with("Wlak"), &centimetres())
        .expect_err("no Wlak")
        .to_string();
    assert!(
        message.contains("did you mean \"Walk\"?") && message.contains("Survey, Walk, Run"),
        "{message}"
    );
}

/// Largest distance of a vertex from the reference surface when every joint is as it was bound.
fn off_reference(file: &GltfFile) -> f64 {
    let mesh = file.skin.as_ref().expect("a skin");
    // Frames as bound: the inverses of the bind matrices, which need not be rigid.
    let bound: Vec<Matrix4<f64>> = (mesh.bones().iter())
        .map(|b| b.inverse_bind.try_inverse().expect("invertible") * b.inverse_bind)
        .collect();
    let mut out = vec![Point3::origin(); mesh.positions().len()];
    mesh.deform(&bound, &mut out);
    (out.iter().zip(mesh.positions()))
        .map(|(a, b)| (a - b).norm())
        .fold(0.0, f64::max)
}

/// The mesh at rest: largest distance from the reference, and the size of the reference along x, y, z.
fn at_rest(file: &GltfFile, root: [f64; 3]) -> (f64, [f64; 3]) {
    let mesh = file.skin.as_ref().expect("a skin");
    let mut frames = vec![Isometry3::identity(); file.skeleton.len()];
    file.skeleton
        .frames(&file.skeleton.rest_pose(root), &mut frames);
    let mut matrices = vec![Matrix4::zeros(); mesh.bones().len()];
    mesh.bone_matrices(&frames, &mut matrices);
    let mut out = vec![Point3::origin(); mesh.positions().len()];
    mesh.deform(&matrices, &mut out);
    let off = (out.iter().zip(mesh.positions())).map(|(a, b)| (a - b).norm());
    let size = [0, 1, 2].map(|i| {
        let values = mesh.positions().iter().map(|p| p[i]);
        let (low, high) = values.fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
        high - low
    });
    (off.fold(0.0, f64::max), size)
}

#[test]
fn the_fox_s_skin_is_the_reference_where_its_joints_are_as_bound() {
    let file = parse_gltf(&fox(), &centimetres());
    let off = off_reference(&file);
    assert!(off < 1e-6, "{off} m off as bound");
    // At rest with the hip where the file has it: 42.94 units up, 26.75 behind.
    let (off, size) = at_rest(&file, [-0.267485628, 0.0, 0.4293807218]);
    assert!(off < 1e-6, "{off} m off at rest");
    assert!(
        (size[0] - 1.55).abs() < 0.02
            && (size[1] - 0.25).abs() < 0.02
            && (size[2] - 0.79).abs() < 0.02,
        "the fox is {size:.2?} m, as its file says 1.55, 0.25, 0.79"
    );
    assert_eq!(file.skin.as_ref().expect("a skin").positions().len(), 1728);
}

#[test]
fn the_walking_fox_s_skin_lies_where_another_program_puts_it() {
    // Vertices of Walk at 0.253 s and of Run at 0 s, file axes and units, from an evaluation of the
    // file in double precision that shares no code with this one.
    let known = [
        (1, 15, 0, [2.35037258, 33.68526006, -22.72693056]),
        (1, 15, 500, [7.81808141, 25.05203407, -40.36916298]),
        (1, 15, 1000, [7.08717147, 27.22669596, 20.61695424]),
        (2, 0, 1700, [8.24929277, 12.88325856, -31.28992409]),
    ];
    let file = parse_gltf(&fox(), &centimetres());
    let mesh = file.skin.as_ref().expect("a skin");
    for (take, frame, vertex, [x, y, z]) in known {
        let take = &file.takes[take];
        let mut frames = vec![Isometry3::identity(); file.skeleton.len()];
        file.skeleton.frames(&take.poses[frame], &mut frames);
        let mut matrices = vec![Matrix4::zeros(); mesh.bones().len()];
        mesh.bone_matrices(&frames, &mut matrices);
        let mut out = vec![Point3::origin(); mesh.positions().len()];
        mesh.deform(&matrices, &mut out);
        let place = take.roots[frame].to_world(out[vertex]);
        let off = (place - Point3::new(0.01 * z, 0.01 * x, 0.01 * y)).norm();
        assert!(off < 1e-6, "{}, vertex {vertex}: {off} m off", take.name);
    }
}

#[test]
fn a_man_from_embedded_buffers_under_a_turned_armature_stands_upright() {
    let Some(folder) = shared_data("rigged_models") else {
        return;
    };
    let file = parse_gltf(&folder.join("cesium_man.gltf"), &ImportOptions::default());
    println!("{:?}", file.warnings);
    let take = &file.takes[0];
    assert!(
        (take.duration_s() - 2.0).abs() < 0.1,
        "{} s",
        take.duration_s()
    );
    let (low, high) =
        (places(take, 0).iter()).fold((f64::MAX, f64::MIN), |(l, h), p| (l.min(p.z), h.max(p.z)));
    assert!(
        low > -0.05 && low < 0.15 && high > 1.0 && high < 1.6,
        "joints from {low:.3} to {high:.3} m"
    );
    let off = off_reference(&file);
    assert!(off < 1e-6, "{off} m off as bound");
}
