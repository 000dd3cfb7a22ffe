//! Gaits for any legged robot: where feet are and what joints may do.
//!
//! Pup and PhantomX are bundled; five quadrupeds of others are tested where they lie beside the
//! repository.

mod gait_support;
mod support;

use gait_support::{Robot, bundled, feet, robots, strain, way};
use handwave::motion::clip::ClipFile;
use handwave::motion::gait::{GaitDescription, GaitName};
use std::path::Path;

/// Ways to go: straight on, along a curve, in place, sideways, backwards around a curve.
fn ways(robot: &Robot) -> Vec<(&'static str, [f64; 3])> {
    let leg = robot.legs[0].length(&robot.model);
    vec![
        ("straight", [0.4 * leg, 0.0, 0.0]),
        ("curve", [0.25 * leg, 0.0, 0.25]),
        ("in place", [0.0, 0.0, -0.3]),
        ("sideways", [0.0, 0.15 * leg, 0.0]),
        ("curve backwards", [-0.2 * leg, 0.05 * leg, 0.2]),
    ]
}

#[test]
fn feet_in_stance_stay_on_their_spot_in_the_world_on_every_robot() {
    // ANYmal C has the legs of ANYmal B; the next test has it.
    for robot in robots().iter().filter(|r| r.name != "anymal_c") {
        for gait in robot.gaits() {
            for (name, advance) in ways(robot) {
                let authored = robot.author(&way(gait, advance));
                let found = feet(robot, &authored.file);
                let what = format!("{} {gait:?} {name}: {found:?}", robot.name);
                assert!(found.slip_m < 2e-4, "{what}");
                assert!(found.off_ground_m < 2e-4, "{what}");
                assert!(found.scuff_m < 2e-4, "{what}");
                let lift = 0.12 * robot.legs[0].length(&robot.model);
                assert!(
                    (found.clearance_m - lift).abs() < 0.05 * lift,
                    "{what}, {lift} asked"
                );
            }
        }
    }
}

#[test]
fn limits_are_kept_at_the_frequency_said_and_the_seam_is_smooth() {
    for robot in robots() {
        for gait in robot.gaits() {
            for (name, advance) in ways(&robot) {
                let authored = robot.author(&way(gait, advance));
                let file = &authored.file;
                let clip = file.for_body(&file.joints).expect("own joints");
                let what = format!("{} {gait:?} {name}", robot.name);
                let (speed, outside) = strain(&robot, file, &clip);
                assert!(file.frequency_hz > 0.1, "{what}: {} Hz", file.frequency_hz);
                assert!(
                    speed < 0.9,
                    "{what}: {speed} of the speed limit at its tempo"
                );
                assert!(outside < 1e-6, "{what}: {outside} rad outside");
                for joint in 0..file.joints.len() {
                    let q = |u: f64| clip.sample(u, joint);
                    let jump = (q(1.0 - 1e-9) - q(0.0)).abs();
                    let bend = (q(1e-4) - 2.0 * q(0.0) + q(-1e-4)).abs() / 1e-8;
                    let most = clip.steepest(joint).1.max(1.0);
                    assert!(jump < 1e-6, "{what}: joint {joint} jumps by {jump} rad");
                    assert!(bend < 1.5 * most, "{what}: joint {joint} bends by {bend}");
                }
            }
        }
    }
}

#[test]
fn a_body_that_sways_leaves_its_feet_where_they_are() {
    let robot = Robot::from_text("pup", &bundled("pup.urdf"));
    let mut description = way(GaitName::Walk, [0.06, 0.0, 0.1]);
    description.sway_m = 0.01;
    description.sway_roll_rad = 0.05;
    description.bob_m = 0.004;
    let file = robot.author(&description).file;
    let lefts: Vec<f64> = file.body.iter().map(|row| row[1]).collect();
    let most = lefts.iter().fold(f64::NEG_INFINITY, |m, v| v.max(m));
    assert!((most - 0.01).abs() < 1e-4, "sways {most} m");
    // Farthest left while the left legs carry most: the middle of the right legs' swings.
    let k = lefts.iter().position(|v| *v == most).expect("a row") as f64;
    let u = k / lefts.len() as f64;
    let right_swing = |limb: &&handwave::motion::clip::Segment| {
        let since = (u - limb.phase).rem_euclid(1.0);
        limb.name.ends_with("right") && since >= limb.duty
    };
    let swinging = file.segments.iter().filter(right_swing).count();
    let left_down = file
        .segments
        .iter()
        .filter(|s| s.name.ends_with("left") && (u - s.phase).rem_euclid(1.0) < s.duty)
        .count();
    assert!(
        left_down == 2 && swinging >= 1,
        "at {u}: {left_down} left feet down, {swinging} right in the air"
    );
    // Rows are sampled at the frames, so only there the body is known.
    for (k, frame) in file.frames.iter().enumerate() {
        let u = k as f64 / file.frames.len() as f64;
        for (leg, limb) in robot.legs.iter().zip(&file.segments) {
            let foot = gait_support::root_at(&file, k) * leg.foot_position(&robot.model, frame);
            if (u - limb.phase).rem_euclid(1.0) < limb.duty {
                assert!(foot.z.abs() < 1e-6, "{} at {u}: {} m", leg.name, foot.z);
            }
        }
    }
}

#[test]
fn a_turned_root_link_is_noticed_and_changes_nothing_but_the_body() {
    let straight = Robot::from_text("pup", &bundled("pup.urdf"));
    let description = way(GaitName::Walk, [0.06, 0.0, 0.1]);
    let expected = straight.author(&description).file;
    // A link above the body, turned against it.
    for (rpy, forward, up) in [
        ("0 0 1.5707963267948966", "y", "z"),
        ("0 0 3.141592653589793", "-x", "z"),
        ("1.5707963267948966 0 0", "x", "-y"),
        ("-1.5707963267948966 0 -1.5707963267948966", "-y", "x"),
    ] {
        let above = format!(
            r#"<link name="above"/><joint name="turned" type="fixed"><parent link="above"/><child link="body"/><origin rpy="{rpy}"/></joint></robot>"#
        );
        let text = bundled("pup.urdf").replace("</robot>", &above);
        let robot = Robot::from_text("turned pup", &text);
        let facing = (robot.facing.forward(), robot.facing.up());
        assert_eq!(facing, (forward, up), "{rpy}");
        let names: Vec<_> = robot.legs.iter().map(|l| &l.name).collect();
        let feet_of = |r: &Robot| -> Vec<String> {
            r.legs
                .iter()
                .map(|l| r.model.links[l.foot].clone())
                .collect()
        };
        assert_eq!(feet_of(&robot), feet_of(&straight), "{rpy}: {names:?}");
        let file = robot.author(&description).file;
        for (a, b) in file
            .frames
            .iter()
            .flatten()
            .zip(expected.frames.iter().flatten())
        {
            assert!((a - b).abs() < 1e-6, "{rpy}: joint {a} instead of {b}");
        }
        let found = feet(&robot, &file);
        assert!(
            found.slip_m < 2e-4 && found.off_ground_m < 2e-4,
            "{rpy}: {found:?}"
        );
    }
}

#[test]
fn shipped_clips_are_what_their_descriptions_make() {
    let clips = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/clips");
    let pup = Robot::from_text("pup", &bundled("pup.urdf"));
    let phantomx = Robot::from_text("phantomx", &bundled("phantomx.urdf"));
    let mut seen = 0;
    for entry in std::fs::read_dir(&clips).expect("clips") {
        let path = entry.expect("an entry").path();
        if path.extension().is_none_or(|e| e != "toml") {
            continue;
        }
        let name = path.file_stem().and_then(|n| n.to_str()).expect("a name");
        let text = std::fs::read_to_string(&path).expect("a description");
        let description =
            GaitDescription::from_toml(&text).unwrap_or_else(|e| panic!("{name}: {e}"));
        let robot = if name.starts_with("hexapod") {
            &phantomx
        } else {
            &pup
        };
        let made = robot.author(&description);
        assert!(
            made.stride_kept >= 1.0,
            "{name} is shortened to {}",
            made.stride_kept
        );
        let json = std::fs::read_to_string(path.with_extension("json")).expect("its clip");
        let shipped = ClipFile::from_json(&json).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(made.file.frames.len(), shipped.frames.len(), "{name}");
        assert_eq!(
            (made.file.root, &made.file.segments),
            (shipped.root, &shipped.segments),
            "{name}"
        );
        let rows = |f: &ClipFile| -> Vec<f64> {
            let body = f.body.iter().flatten();
            f.frames.iter().flatten().chain(body).copied().collect()
        };
        for (a, b) in rows(&made.file).iter().zip(rows(&shipped)) {
            assert!(
                (a - b).abs() < 3e-6,
                "{name}: {b} in the file, {a} when made again"
            );
        }
        seen += 1;
    }
    assert!(seen >= 30, "{seen} descriptions");
}
