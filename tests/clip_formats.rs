//! Motion files of other programs: what comes in, what goes out, and what is refused.

mod support;

use handwave::body::{PoseSpace, Skeleton, SkeletonSpace};
use handwave::motion::export::{robot_to_gltf, skeleton_to_gltf, to_bvh, to_csv};
use handwave::motion::import::gltf::GltfFile;
use handwave::motion::import::{ImportOptions, open};
use handwave::motion::take::{Take, TakeBody};
use handwave::robot::RobotModel;
use nalgebra::{Isometry3, Matrix4, Point3, Rotation3, UnitQuaternion};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use support::data::shared_data;
use support::motion::{TINY_BVH, centimetres, fox, places, skeleton, through_file};

fn parse_gltf(path: &Path, options: &ImportOptions) -> GltfFile {
    let bytes = std::fs::read(path).expect("the file");
    GltfFile::parse(&bytes, "test", path.parent(), options).expect("a good glTF")
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
    // Frames as bound: rigid ones, metres and our axes, which undo the bind matrices.
    let bound: Vec<Matrix4<f64>> = (mesh.bones().iter())
        .map(|bone| {
            let frame = bone.inverse_bind.try_inverse().expect("invertible");
            let turn = frame.fixed_view::<3, 3>(0, 0).into_owned();
            let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(&turn));
            let place = frame.fixed_view::<3, 1>(0, 3).into_owned();
            Isometry3::from_parts(place.into(), turn).to_homogeneous() * bone.inverse_bind
        })
        .collect();
    let mut out = vec![Point3::origin(); mesh.positions().len()];
    mesh.deform(&bound, &mut out);
    (out.iter().zip(mesh.positions()))
        .map(|(a, b)| (a - b).norm())
        .fold(0.0, f64::max)
}

/// The mesh at rest: largest distance from the reference, and its size along x, y, z.
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
        let values = out.iter().map(|p| p[i]);
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
    // Nothing has a name, so that the feet say where ahead is: then he is wider than deep.
    let (_, [deep, wide, tall]) = at_rest(&file, [0.0, 0.0, 0.68]);
    assert!(
        deep < 0.5 && wide > 1.0 && (1.4..1.6).contains(&tall),
        "{deep:.2} m deep, {wide:.2} wide, {tall:.2} tall"
    );
}

/// Largest distance of joints of the same name between two takes, over every frame of both.
fn apart(a: &Take, b: &Take) -> f64 {
    assert_eq!(a.len(), b.len(), "frames");
    let pairs: Vec<(usize, usize)> = (skeleton(a).joints.iter().enumerate())
        .filter_map(|(i, joint)| Some((i, skeleton(b).joint(&joint.name)?)))
        .collect();
    assert_eq!(pairs.len(), skeleton(a).len(), "joints of {}", a.name);
    let frames = (0..a.len()).map(|k| {
        let (x, y) = (places(a, k), places(b, k));
        let far = pairs.iter().map(|(i, j)| (x[*i] - y[*j]).norm());
        far.fold(0.0, f64::max)
    });
    frames.fold(0.0, f64::max)
}

#[test]
fn a_bvh_keeps_its_joints_its_heading_and_its_right_angles() {
    let centimetres = centimetres();
    let take = through_file("tiny.bvh", TINY_BVH.as_bytes(), &centimetres);
    let names: Vec<&str> = (skeleton(&take).joints.iter())
        .map(|j| j.name.as_str())
        .collect();
    assert_eq!(
        names,
        ["Hips", "Leg_L", "Leg_L_end", "Leg_R", "Leg_R_end"],
        "a still root folds in"
    );
    // Faces z of the file by its left and right legs, walks that way and turns to its left.
    let [first, .., last] = &take.roots[..] else {
        panic!("three frames")
    };
    let (x, y) = (last.x_m - first.x_m, last.y_m - first.y_m);
    assert!(
        (x - 0.4).abs() < 1e-9 && (y - 0.1).abs() < 1e-9,
        "went {x}, {y} m"
    );
    let turned = (take.roots[1].yaw_rad - first.yaw_rad).to_degrees();
    assert!((turned - 45.0).abs() < 1e-9, "turned by {turned} degrees");
    let written = to_bvh(&take).expect("a skeleton");
    let again = through_file("again.bvh", written.as_bytes(), &centimetres);
    let off = apart(&take, &again);
    assert!(off < 1e-6, "{off} m off after a round");
}

#[test]
fn bvh_comes_back_as_it_went_and_agrees_with_the_pose_stream() {
    let Some(folder) = shared_data("human_bvh") else {
        return;
    };
    for name in [
        "dataset-2_walk_normal_001",
        "dataset-1_dash_happy_001",
        "dataset-1_byebye_active_001",
    ] {
        let path = folder.join(format!("{name}.bvh"));
        let take = open(&path, &centimetres()).expect("BVH").takes.remove(0);
        let written = to_bvh(&take).expect("a skeleton");
        let again = through_file("again.bvh", written.as_bytes(), &centimetres());
        let off = apart(&take, &again);
        assert!(off < 1e-6, "{name}: {off} m off after a round");
        // The pose stream has its own kinematics: y up and facing z, in metres.
        let (poses, _) = handwave::pose::Recording::read(&path).expect("BVH");
        let mut worst = 0.0_f64;
        for (k, sample) in poses.samples.iter().enumerate() {
            let at = places(&take, k);
            for (name, point) in poses.header.points.iter().zip(&sample.points) {
                let [x, y, z] = point.expect("a place");
                let joint = skeleton(&take).joint(name).expect("the same joints");
                worst = worst.max((at[joint] - Point3::new(z, x, y)).norm());
            }
        }
        println!("{name}: round {off:.1e} m, from the pose stream {worst:.1e} m");
        assert!(worst < 1e-6, "{name}: {worst} m from the pose stream");
    }
}

#[test]
fn speeds_of_walks_and_runs_are_those_measured_elsewhere() {
    let Some(data) = shared_data("human_cmu").and_then(|p| Some(p.parent()?.to_owned())) else {
        return;
    };
    // Mean speed (m/s) and heights of the root (m), as the data's notes list them.
    let rows = [
        ("human_cmu/02_01.amc", 1.18, [0.93, 1.00]),
        ("human_cmu/02_02.amc", 1.63, [0.90, 0.99]),
        ("human_cmu/02_03.amc", 2.58, [0.90, 1.05]),
        ("human_cmu/02_04.amc", f64::NAN, [0.73, 1.47]),
        ("human_bvh/dataset-2_walk_normal_001.bvh", 1.11, [0.0, 0.0]),
        ("human_bvh/dataset-2_walk_elderly_001.bvh", 0.74, [0.0, 0.0]),
        ("human_bvh/dataset-2_run_normal_001.bvh", 3.60, [0.0, 0.0]),
        ("human_joint/humanoid3d_walk.txt", 0.98, [0.0, 0.0]),
        ("human_joint/humanoid3d_run.txt", 3.56, [0.0, 0.0]),
        ("quadruped/laikago/dog_trot.txt", 1.75, [0.0, 0.0]),
        ("quadruped/laikago/dog_pace.txt", 1.09, [0.0, 0.0]),
        ("quadruped/a1/trot0.txt", 1.17, [0.0, 0.0]),
        ("quadruped/a1/gallop_forward0.json", 1.99, [0.0, 0.0]),
        ("quadruped/dog3d/dog3d_trot.txt", 2.40, [0.0, 0.0]),
    ];
    for (name, speed, [low, high]) in rows {
        let take = open(&data.join(name), &ImportOptions::default())
            .expect(name)
            .takes
            .remove(0);
        let (Some(first), Some(last)) = (take.roots.first(), take.roots.last()) else {
            panic!("{name}: no frames")
        };
        let way = (last.x_m - first.x_m).hypot(last.y_m - first.y_m);
        let found = way / take.duration_s();
        println!("{name}: {found:.3} m/s");
        assert!(
            !((found / speed - 1.0).abs() > 0.02),
            "{name}: {found:.3} m/s, listed {speed}"
        );
        // Ahead is where it looks: the way lies forwards in the first heading.
        let ahead = first.to_local(Point3::new(last.x_m, last.y_m, 0.0)).x;
        assert!(
            !(speed > 0.5) || ahead > 0.9 * way,
            "{name}: {ahead:.2} of {way:.2} m ahead"
        );
        if high > 0.0 {
            let z = take.poses.iter().map(|p| p[2]);
            let (l, h) = z.fold((f64::MAX, f64::MIN), |(l, h), z| (l.min(z), h.max(z)));
            assert!(
                (l - low).abs() < 0.01 && (h - high).abs() < 0.01,
                "{name}: root {l:.3} to {h:.3} m, listed {low} to {high}"
            );
        }
    }
}

#[test]
fn feet_stand_on_the_ground_whatever_format_they_come_from() {
    let Some(data) = shared_data("human_cmu").and_then(|p| Some(p.parent()?.to_owned())) else {
        return;
    };
    // File, a foot's joint, how high it may be when it stands (m): joints lie above the sole.
    for (name, foot, least, most) in [
        ("human_cmu/02_01.amc", "ltoes", -0.02, 0.05),
        (
            "human_bvh/dataset-2_walk_normal_001.bvh",
            "Toes_L",
            -0.02,
            0.05,
        ),
        ("human_joint/humanoid3d_walk.txt", "left_ankle", 0.03, 0.12),
        ("quadruped/dog3d/dog3d_trot.txt", "left_finger", -0.03, 0.08),
    ] {
        let take = open(&data.join(name), &ImportOptions::default())
            .expect(name)
            .takes
            .remove(0);
        let joint = skeleton(&take).joint(foot).expect("a foot");
        let low = (0..take.len())
            .map(|k| places(&take, k)[joint].z)
            .fold(f64::MAX, f64::min);
        println!("{name}: {foot} down to {low:.3} m");
        assert!(
            (least..most).contains(&low),
            "{name}: {foot} down to {low:.3} m"
        );
    }
}

#[test]
fn laikago_s_joints_are_those_of_its_urdf_and_its_feet_reach_the_ground() {
    let Some(data) = shared_data("quadruped").and_then(|p| Some(p.parent()?.to_owned())) else {
        return;
    };
    for (motion, urdf, radius) in [
        (
            "quadruped/laikago/dog_trot.txt",
            "robots/laikago/laikago.urdf",
            0.0265,
        ),
        (
            "quadruped/laikago/inplace_steps.txt",
            "robots/laikago/laikago.urdf",
            0.0265,
        ),
        ("quadruped/a1/trot0.txt", "robots/a1/a1.urdf", 0.02),
    ] {
        let text = std::fs::read_to_string(data.join(urdf)).expect("a URDF");
        let model = RobotModel::from_urdf(&text).expect("a URDF");
        let take = open(&data.join(motion), &ImportOptions::default())
            .expect(motion)
            .takes
            .remove(0);
        let TakeBody::Floating(names) = &take.body else {
            panic!("{motion}: no walking robot")
        };
        let order: Vec<usize> = (model.joint_names().iter())
            .map(|j| {
                names
                    .iter()
                    .position(|n| n == j)
                    .expect("the URDF's joints")
            })
            .collect();
        let feet: Vec<usize> = (["FR_foot", "FL_foot", "RR_foot", "RL_foot"].iter())
            .map(|f| model.link(f).expect("a foot"))
            .collect();
        let mut lowest = [f64::MAX; 4];
        for pose in &take.poses {
            let q: Vec<f64> = order.iter().map(|i| pose[*i]).collect();
            let body = Isometry3::from_parts(
                nalgebra::Translation3::new(0.0, 0.0, pose[14]),
                UnitQuaternion::from_euler_angles(pose[15], pose[16], 0.0),
            );
            for (low, foot) in lowest.iter_mut().zip(&feet) {
                let z = (body * model.link_pose(*foot, &q)).translation.z;
                *low = low.min(z - radius);
            }
        }
        println!("{motion}: soles down to {lowest:.3?} m");
        assert!(
            lowest.iter().all(|z| z.abs() < 0.06),
            "{motion}: soles down to {lowest:.3?} m"
        );
    }
}

#[test]
fn tables_come_back_to_the_digit() {
    let walk = parse_gltf(&fox(), &centimetres()).takes.remove(1);
    let folder = tempfile::tempdir().expect("a folder");
    let bones = folder.path().join("walk.bvh");
    std::fs::write(&bones, to_bvh(&walk).expect("a skeleton")).expect("written");
    let clip = folder.path().join("walk.json");
    let file = walk.to_clip(handwave::motion::clip::ClipKind::Cycle, 42);
    std::fs::write(&clip, file.to_json()).expect("written");
    let options = ImportOptions {
        skeleton: Some(clip),
        ..ImportOptions::default()
    };
    let text = to_csv(&walk).expect("frames");
    let again = through_file("walk.csv", text.as_bytes(), &options);
    let off = apart(&walk, &again);
    assert!(off < 1e-6, "{off} m off");
    // Digits may differ where a rotation vector nears a half turn, by as much as rounding does.
    let rows = |text: &str| -> Vec<f64> {
        let cells = text.lines().skip(1).flat_map(|l| l.split(','));
        cells.map(|c| c.parse().expect("a number")).collect()
    };
    let (a, b) = (rows(&text), rows(&to_csv(&again).expect("frames")));
    let off = a
        .iter()
        .zip(&b)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max);
    assert!(a.len() == b.len() && off < 3e-9, "{off} between tables");

    let table = "t,hip,knee,x,y,z,roll,pitch,yaw\n0.0,0.1,-0.2,0,0,0.3,0,0.01,0.02\n0.1,0.2,-0.3,0.1,0,0.3,0,0,0.1\n";
    let robot = through_file("robot.csv", table.as_bytes(), &ImportOptions::default());
    assert!(
        matches!(&robot.body, TakeBody::Floating(n) if n.len() == 2),
        "{:?}",
        robot.body
    );
    let written = to_csv(&robot).expect("frames");
    let again = through_file("robot.csv", written.as_bytes(), &ImportOptions::default());
    assert_eq!(written, to_csv(&again).expect("frames"));
}

#[test]
fn uneven_times_become_even_ones() {
    let table = "t,hip\n0.0,0.0\n0.1,0.1\n0.2,0.2\n0.5,0.5\n0.6,0.6\n";
    let take = through_file("uneven.csv", table.as_bytes(), &ImportOptions::default());
    assert_eq!(take.len(), 7, "a frame every 0.1 s");
    let off = (take.poses.iter().enumerate())
        .map(|(k, p)| (p[0] - 0.1 * k as f64).abs())
        .fold(0.0, f64::max);
    assert!(off < 1e-9, "{off} rad off a straight line");
}

#[test]
fn the_fox_comes_back_from_gltf_with_its_skin() {
    let file = parse_gltf(&fox(), &centimetres());
    let walk = &file.takes[1];
    let scene = skeleton_to_gltf(walk, file.skin.as_ref()).expect("a skeleton");
    for (name, bytes) in [
        ("a.glb", scene.to_glb()),
        ("a.gltf", scene.to_json().into_bytes()),
    ] {
        let again = GltfFile::parse(&bytes, name, None, &ImportOptions::default())
            .expect("valid by the reader's checks");
        assert_eq!(again.takes.len(), 1);
        let take = &again.takes[0];
        let (mut turn, at) = (0.0_f64, apart(walk, take));
        for (a, b) in walk.poses.iter().zip(&take.poses) {
            for (i, joint) in file.skeleton.joints.iter().enumerate() {
                let j = again.skeleton.joint(&joint.name).expect("the same joints");
                turn = turn.max(Skeleton::rotation(a, i).angle_to(&Skeleton::rotation(b, j)));
            }
        }
        println!("{name}: {turn:.1e} rad, {at:.1e} m");
        assert!(turn < 1e-4 && at < 1e-5, "{name}: {turn} rad, {at} m off");
        let off = off_reference(&again);
        assert!(off < 1e-6, "{name}: the skin is {off} m off as bound");
        let skins = [file.skin.as_ref(), again.skin.as_ref()].map(|s| s.expect("a skin"));
        let apart = (skins[0].positions().iter().zip(skins[1].positions()))
            .map(|(a, b)| (a - b).norm())
            .fold(0.0, f64::max);
        assert!(apart < 1e-6, "{name}: vertices {apart} m off");
    }
}

#[test]
fn a_robot_in_gltf_has_its_links_where_its_kinematics_puts_them() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let urdf = std::fs::read_to_string(root.join("configs/robots/pup.urdf")).expect("a URDF");
    let model = RobotModel::from_urdf(&urdf).expect("a URDF");
    let names = model.joint_names();
    let poses: Vec<Vec<f64>> = (0..20)
        .map(|k| {
            let angle = |j: usize| 0.4 * (0.5 * k as f64 + j as f64).sin();
            let mut pose: Vec<f64> = (0..names.len()).map(angle).collect();
            pose.extend([0.0, 0.0, 0.15, 0.05, -0.1, 0.0]);
            pose
        })
        .collect();
    let roots = (0..20).map(|k| handwave::body::RootPose {
        x_m: 0.02 * f64::from(k),
        y_m: 0.01 * f64::from(k),
        yaw_rad: 0.05 * f64::from(k),
    });
    let take = Take {
        name: "waves".into(),
        origin: "made up".into(),
        dt_s: 1.0 / 60.0,
        body: TakeBody::Floating(names),
        roots: roots.collect(),
        poses,
        wraps: false,
    };
    let bytes = robot_to_gltf(&take, &model).expect("its robot").to_glb();
    let forward = ImportOptions {
        forward: Some("z".parse().expect("an axis")),
        ..ImportOptions::default()
    };
    let file = GltfFile::parse(&bytes, "robot", None, &forward).expect("valid");
    let again = &file.takes[0];
    let mut worst = 0.0_f64;
    for (k, pose) in take.poses.iter().enumerate() {
        let at = places(again, k);
        let body = UnitQuaternion::from_euler_angles(0.05, -0.1, 0.0);
        for (link, name) in model.links.iter().enumerate() {
            let joint = file.skeleton.joint(name).expect("the link");
            let local = body * Point3::from(model.link_pose(link, pose).translation.vector);
            let place = take.roots[k].to_world(Point3::new(local.x, local.y, local.z + 0.15));
            worst = worst.max((at[joint] - place).norm());
        }
    }
    assert!(worst < 1e-5, "a link is {worst} m off");
}
