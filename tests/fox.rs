//! The shipped avatar: a fox from a glTF file, played without servos.

mod support;

use handwave::body::Skeleton;
use handwave::config::{self, Character, Files};
use std::path::Path;
use support::character::{Player, RATE_HZ};
use support::folder::Folder;
use support::program::{refused, run_virtual};
use support::spectrum::dominant_hz;
use support::targets::Targets;

const FOX: &str = "configs/fox.toml";
/// No joint may turn farther in one cycle of 5 ms, rad: in the fastest run a paw flicks through 48 rad/s.
const MOST_RAD: f64 = 0.3;

fn fox() -> Character {
    let (files, name) = Files::of(&Path::new(env!("CARGO_MANIFEST_DIR")).join(FOX));
    config::load(files, &name).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn what_cannot_be_an_avatar_is_refused_with_file_and_key() {
    let folder = Folder::of_configs();
    let check = |from: &str, to: &str, parts: &[&str]| {
        let before = folder.read("fox.toml");
        folder.edit("fox.toml", from, to);
        refused(run_virtual(&[&folder.text("fox.toml")]), 2, parts);
        folder.write("fox.toml", &before);
    };
    let robot =
        "[robot]\nurdf = \"robots/pup.urdf\"\nacceleration_rad_s2 = 100.0\njoint = []\n\n[avatar]";
    check(
        "[avatar]",
        robot,
        &["fox.toml:", "avatar", "a robot or an avatar"],
    );
    check(
        "[avatar]",
        "[bus]\nbus = \"sim\"\n\n[avatar]",
        &["bus.bus", "no servos"],
    );
    check(
        "fox.glb#Walk",
        "fox.glb#Walc",
        &["class.clip.file", "Walc", "Survey, Walk, Run"],
    );
    check(
        "fox.glb#Walk\"",
        "fox.glb\"",
        &["3 animations", "fox.glb#NAME"],
    );
    check("@0..1.2", "@0..9.0", &["3.4", "length of Survey"]);
    check("@0..1.2", "@soon", &["@0.5..1.2"]);
    check(
        "\"b_LeftHand_011\"",
        "\"b_LeftHand_01\"",
        &["avatar.limb.end", "b_LeftHand_011"],
    );
    check(
        "joints = 3",
        "joints = 30",
        &["avatar.limb.end", "joints = 30"],
    );
    check("unit_m = 0.007", "unit_m = -1.0", &["avatar.unit_m", "-1"]);
    check(
        "\"avatars/fox.glb\"",
        "\"avatars/wolf.glb\"",
        &["avatar.model", "wolf.glb"],
    );
    check("fox.glb#Walk", "../clips/stand.json", &["class.clip.file"]);
    // Without anything to move.
    let text = folder.read("fox.toml");
    let start = text.find("[avatar]").expect("an avatar");
    let end = start + text[start..].find("\n]\n").expect("limbs") + 3;
    folder.write(
        "nothing.toml",
        &format!("{}{}", &text[..start], &text[end..]),
    );
    refused(
        run_virtual(&[&folder.text("nothing.toml")]),
        2,
        &["nothing to move", "[avatar]"],
    );
    // What only servos have.
    refused(run_virtual(&[FOX, "--bus", "sim"]), 2, &["avatar", "--bus"]);
    refused(
        run_virtual(&[FOX, "--fault", "1:silent@1s"]),
        2,
        &["avatar", "--fault"],
    );
}

#[test]
fn the_fox_walks_and_runs_to_the_drumming() {
    let folder = Folder::empty();
    let file = folder.path("fox.csv");
    let path = file.to_str().expect("a plain path");
    let ended = run_virtual(&[FOX, "--targets", path]).expect(0);
    assert!(ended.out.contains("none: an avatar"), "{}", ended.out);
    let targets = Targets::read(&file);
    assert_eq!(targets.joints.len(), 3 * 22 + 3, "{:?}", targets.joints);
    let head: Vec<&str> = targets.joints[..3].iter().map(String::as_str).collect();
    assert_eq!(head, ["b_Hip_01.rx", "b_Hip_01.ry", "b_Hip_01.rz"]);
    let tail: Vec<&str> = targets.joints[66..].iter().map(String::as_str).collect();
    assert_eq!(tail, ["x", "y", "z"]);
    assert_eq!(targets.times[..2], ["0.000000", "0.005000"]);
    for (k, rows) in targets.rows.windows(2).enumerate() {
        for (joint, (a, b)) in rows[0].iter().zip(&rows[1]).enumerate() {
            let step = (b - a).abs();
            let name = &targets.joints[joint];
            assert!(step < MOST_RAD, "row {k}: {name} goes from {a} to {b}");
        }
    }
    let column = |name: &str| {
        let found = targets.joints.iter().position(|j| j == name);
        found.unwrap_or_else(|| panic!("no column {name}"))
    };
    let legs = [
        "b_LeftLeg01_015.rz",
        "b_RightLeg01_019.rz",
        "b_LeftUpperArm_09.rz",
        "b_RightUpperArm_06.rz",
    ];
    // The performance begins after half a second of ramp; see performances/drum_and_splay.toml.
    for (from_s, to_s, hz) in [(14.0, 19.5, 0.952), (22.0, 27.5, 1.5)] {
        let rows = (from_s * RATE_HZ) as usize..(to_s * RATE_HZ) as usize;
        let signals: Vec<Vec<f64>> = legs
            .iter()
            .map(|leg| targets.joint(column(leg)).collect::<Vec<_>>()[rows.clone()].to_vec())
            .collect();
        let found = dominant_hz(&signals, RATE_HZ, (0.3, 4.0));
        assert!(
            (found - hz).abs() < 0.06,
            "legs at {found:.3} Hz, drumming at {hz} Hz"
        );
    }
    // It gets on faster when it runs, and stands still where it stood when nobody drums.
    let x = column("x");
    let way = |from_s: f64, to_s: f64| {
        let at = |t: f64| targets.rows[(t * RATE_HZ) as usize][x];
        (at(to_s) - at(from_s)) / (to_s - from_s)
    };
    let (walk, run, stand) = (way(14.0, 19.0), way(22.0, 27.0), way(38.0, 42.0));
    assert!(
        walk > 0.3 && run > 1.2 && stand.abs() < 1e-3,
        "{walk:.2}, {run:.2}, {stand:.4} m/s"
    );
    let z = column("z");
    let (low, high) = (targets.joint(z)).fold((f64::INFINITY, 0.0), |(l, h): (f64, f64), v| {
        (l.min(v), h.max(v))
    });
    assert!(
        low > 0.2 && high < 0.36,
        "the hip is {low:.3} to {high:.3} m high"
    );
}

#[test]
fn rotations_are_unit_quaternions_and_turn_steadily() {
    let character = fox();
    let skeleton = &character.body.avatar.as_ref().expect("an avatar").skeleton;
    let mut player = Player::new(&character, character.safety.ramp_s + 0.005);
    let mut last = player.positions().to_vec();
    let (mut farthest, mut off) = (0.0_f64, 0.0_f64);
    // Into the run.
    while player.t_s() < 24.0 {
        player.step(true);
        let now = player.positions();
        for joint in 0..skeleton.len() {
            let (a, b) = (
                Skeleton::rotation(&last, joint),
                Skeleton::rotation(now, joint),
            );
            off = off.max((b.norm() - 1.0).abs());
            let turned = a.angle_to(&b);
            assert!(turned.is_finite(), "cycle {}: joint {joint}", player.cycle);
            farthest = farthest.max(turned);
        }
        last.copy_from_slice(now);
    }
    assert!(off < 1e-9, "a quaternion is {off} off unit length");
    assert!(
        farthest < MOST_RAD,
        "a joint turns by {farthest} rad in a cycle"
    );
    println!("farthest turn in a cycle {farthest:.3} rad, length off by {off:.1e}");
}

#[test]
fn the_same_run_writes_the_same_bytes() {
    let folder = Folder::empty();
    let write = |name: &str| {
        let path = folder.text(name);
        run_virtual(&[FOX, "--duration", "7", "--targets", &path]).expect(0);
        folder.read(name)
    };
    let (first, second) = (write("a.csv"), write("b.csv"));
    assert!(
        first.lines().count() > 1400 && first == second,
        "two runs differ"
    );
}
