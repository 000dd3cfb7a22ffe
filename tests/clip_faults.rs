//! Motion files with faults: named with their place, and no file, however spoiled, stops the program.

mod support;

use handwave::motion::export::{skeleton_to_gltf, to_bvh, to_csv};
use handwave::motion::import::gltf::GltfFile;
use handwave::motion::import::{ImportOptions, open};
use handwave::motion::take::Take;
use nalgebra::Point3;
use support::motion::{TINY_BVH, centimetres, fox, places, skeleton, through_file};
use support::program::{AT_MOST, Running};

/// What is said about a file that cannot be read.
fn message(name: &str, bytes: &[u8], options: &ImportOptions) -> String {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).expect("written");
    match open(&path, options) {
        Ok(_) => panic!("{name} was read"),
        Err(error) => error.to_string(),
    }
}

const TINY_ASF: &str = "# a leg
:version 1.10
:units
  mass 1.0
  length 0.45
  angle deg
:root
  order TX TY TZ RX RY RZ
  axis XYZ
  position 0 0 0
  orientation 0 0 0
:bonedata
  begin
    id 1
    name lfemur
    direction 0 -1 0
    length 8
    axis 0 0 20 XYZ
    dof rx ry rz
    limits (-160.0 20.0)
           (-70.0 70.0)
           (-60.0 70.0)
  end
  begin
    id 2
    name ltibia
    direction 0 -1 0
    length 7
    axis 0 0 0 XYZ
    dof rx
    limits (-10.0 170.0)
  end
:hierarchy
  begin
    root lfemur
    lfemur ltibia
  end
";

const TINY_AMC: &str = "#!OML:ASF leg.asf
:FULLY-SPECIFIED
:DEGREES
1
root 0 15 0 0 0 0
lfemur 0 0 0
ltibia 90
2
root 0 15 2 0 90 0
lfemur 0 0 0
ltibia 0
";

/// Writes skeleton and motion side by side and reads the motion.
fn leg(asf: &str, amc: &str) -> Result<Take, String> {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("leg.asf"), asf).expect("written");
    let path = folder.path().join("leg_01.amc");
    std::fs::write(&path, amc).expect("written");
    let imported = open(&path, &ImportOptions::default()).map_err(|e| e.to_string())?;
    Ok(imported.takes[0].clone())
}

#[test]
fn a_leg_of_an_asf_bends_about_its_bone_s_axes() {
    let take = leg(TINY_ASF, TINY_AMC).expect("good");
    let unit = 0.0254 / 0.45;
    // The shin turned by 90 degrees about x of the file: its end goes from down to backwards (-z),
    // which is -x of ours. The root is 15 units up, the knee 8 below it.
    let at = places(&take, 0);
    let tip = at[skeleton(&take).joint("ltibia_end").expect("a tip")];
    let off = (tip - Point3::new(-7.0 * unit, 0.0, 7.0 * unit)).norm();
    assert!(off < 1e-9, "the tip is at {tip:?}, {off} m off");
    let turned = take.roots[1].yaw_rad.to_degrees();
    assert!((turned - 90.0).abs() < 1e-9 && (take.roots[1].x_m - 2.0 * unit).abs() < 1e-12);
}

#[test]
fn faults_of_files_name_the_place_what_was_found_and_what_is_allowed() {
    let none = ImportOptions::default();
    let bvh = TINY_BVH.replace("10 -5 0 0 30 0", "10 -5 0 0 x 0");
    let json = |frames: &str| {
        format!("{{\"LoopMode\": \"Wrap\", \"FrameDuration\": 0.02, \"Frames\": [{frames}]}}")
    };
    let level = "0, 0, 0.3, 0, 0, 0, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1";
    let long = json(&format!("[{level}], [{level}, 4]"));
    let short = json("[0, 0, 0.3]");
    let zero = json(&format!(
        "[{}]",
        level.replacen("0, 0, 0, 1,", "0, 0, 0, 0,", 1)
    ));
    let cases: [(&str, &str, &str); 13] = [
        ("a.bvh", &bvh, "line 33: found `x` in frame 1"),
        ("a.csv", "", "header `t,<joint>"),
        ("a.csv", "t,a,a\n0,1,2\n", "column 3 called \"a\""),
        (
            "a.csv",
            "t,a\n0,1\n0.1,nan\n",
            "line 3: found \"nan\"; allowed: a number for a",
        ),
        ("a.csv", "t,a\n0,1\n0,1\n", "line 3: found t 0 after 0"),
        ("a.csv", "t,a\n0,1,2\n", "line 2: found 3 cells"),
        ("a.csv", "t,a.rx,a.ry,a.rz\n0,1,2,3\n", "--skeleton FILE"),
        ("a.json", &long, "frame 1: found 20 numbers"),
        ("a.json", &short, "3 numbers each, with FrameDuration"),
        ("a.json", &zero, "frame 0: found a quaternion of length 0"),
        (
            "a.txt",
            "{\"Frames\": [[\"a\"]]}",
            "not the JSON of a motion",
        ),
        ("a.xyz", "what is this", "no known extension"),
        (
            "a.gltf",
            "{\"asset\": {\"version\": \"2.0\"}, \"nodes\": []}",
            "no skin and no animated node",
        ),
    ];
    for (name, text, expected) in cases {
        let found = message(name, text.as_bytes(), &none);
        assert!(
            found.contains(expected),
            "{name}: {found}\nwithout: {expected}"
        );
    }
    for (asf, amc, expected) in [
        (
            TINY_ASF.replace("dof rx ry rz", "dof rx rq"),
            TINY_AMC.into(),
            "line 19: found \"rq\"",
        ),
        (
            TINY_ASF.replace("lfemur ltibia", "lfemur tibia"),
            TINY_AMC.into(),
            "bone \"tibia\"",
        ),
        (
            TINY_ASF.replace("    lfemur ltibia\n", ""),
            TINY_AMC.into(),
            "bone ltibia that hangs on nothing",
        ),
        (
            TINY_ASF.into(),
            TINY_AMC.replace("ltibia 90", "ltibia 90 1"),
            "line 7: found 2 numbers for ltibia",
        ),
        (
            TINY_ASF.into(),
            TINY_AMC.replace("ltibia 90\n", ""),
            "line 4: found frame 1 without bone ltibia",
        ),
        (
            TINY_ASF.into(),
            TINY_AMC.replace("ltibia 0", "rtibia 0"),
            "line 11: found bone \"rtibia\"",
        ),
    ] {
        let found = leg(&asf, &amc).expect_err(expected);
        assert!(found.contains(expected), "{found}\nwithout: {expected}");
    }
    let glb = std::fs::read(fox()).expect("the fox");
    let cut = message("fox.glb", &glb[..90_000], &none);
    assert!(
        cut.contains("BIN chunk: found the end of the file"),
        "{cut}"
    );
    let sideways = ImportOptions {
        up: Some("z".parse().expect("an axis")),
        forward: Some("-z".parse().expect("an axis")),
        ..centimetres()
    };
    let found = message("a.bvh", TINY_BVH.as_bytes(), &sideways);
    assert!(found.contains("two different axes"), "{found}");
}

/// A text or binary with some bytes cut, changed or doubled.
fn spoiled(good: &[u8], edits: &[(u32, u8, u8)]) -> Vec<u8> {
    let mut bytes = good.to_vec();
    for (at, kind, value) in edits {
        if bytes.is_empty() {
            break;
        }
        let at = *at as usize % bytes.len();
        match kind % 5 {
            0 => bytes.truncate(at),
            1 => bytes[at] = *value,
            2 => bytes.insert(at, b"0-.{}[],eE\n \"9"[usize::from(*value) % 14]),
            3 => {
                let end = (at + usize::from(*value)).min(bytes.len());
                bytes.drain(at..end);
            }
            _ => {
                let end = (at + usize::from(*value)).min(bytes.len());
                let copy = bytes[at..end].to_vec();
                bytes.splice(at..at, copy);
            }
        }
    }
    bytes
}

proptest::proptest! {
    #![proptest_config(proptest::prelude::ProptestConfig {
        failure_persistence: None,
        ..Default::default()
    })]

    #[test]
    fn no_spoiled_file_makes_the_reader_panic(
        edits in proptest::collection::vec(proptest::prelude::any::<(u32, u8, u8)>(), 1..6),
    ) {
        let folder = tempfile::tempdir().expect("a folder");
        let read = |name: &str, bytes: &[u8], options: &ImportOptions| {
            let path = folder.path().join(name);
            std::fs::write(&path, bytes).expect("written");
            if let Ok(imported) = open(&path, options) {
                for take in &imported.takes {
                    assert!(take.poses.iter().flatten().all(|v| v.is_finite()), "{name}");
                    let _ = (to_bvh(take), to_csv(take));
                }
            }
        };
        let none = ImportOptions::default();
        let humanoid = format!(
            "{{\"Loop\": \"wrap\", \"Frames\": [[0.1, {}], [0, {}]]}}",
            "1, ".repeat(42) + "1", "0.5, ".repeat(42) + "1"
        );
        let walk = "t,x,y,z,Hips.rx,Hips.ry,Hips.rz\n0,0,0,1,0,0,0\n0.1,0.1,0,1,0,0,1\n0.4,0.1,0,1,0,0,1\n";
        read("a.bvh", &spoiled(TINY_BVH.as_bytes(), &edits), &none);
        std::fs::write(folder.path().join("leg.asf"), TINY_ASF).expect("written");
        read("leg.amc", &spoiled(TINY_AMC.as_bytes(), &edits), &none);
        std::fs::write(folder.path().join("leg.asf"), spoiled(TINY_ASF.as_bytes(), &edits)).expect("written");
        read("leg.amc", TINY_AMC.as_bytes(), &none);
        read("a.json", &spoiled(humanoid.as_bytes(), &edits), &none);
        std::fs::write(folder.path().join("bones.bvh"), TINY_BVH).expect("written");
        let bones = ImportOptions { skeleton: Some(folder.path().join("bones.bvh")), ..none.clone() };
        read("a.csv", &spoiled(walk.as_bytes(), &edits), &bones);
    }

    #[test]
    fn no_spoiled_gltf_makes_the_reader_panic(
        edits in proptest::collection::vec(proptest::prelude::any::<(u32, u8, u8)>(), 1..4),
        text in proptest::prelude::any::<bool>(),
    ) {
        static SMALL: std::sync::OnceLock<(Vec<u8>, Vec<u8>)> = std::sync::OnceLock::new();
        let (binary, json) = SMALL.get_or_init(|| {
            let take = through_file("tiny.bvh", TINY_BVH.as_bytes(), &centimetres());
            let scene = skeleton_to_gltf(&take, None).expect("a skeleton");
            (scene.to_glb(), scene.to_json().into_bytes())
        });
        let bytes = spoiled(if text { json } else { binary }, &edits);
        let _ = GltfFile::parse(&bytes, "spoiled", None, &ImportOptions::default());
    }
}

/// Runs `handwave clip ...` in `folder`.
fn clip(folder: &std::path::Path, args: &[&str]) -> support::program::Ended {
    let all: Vec<&str> = [&["clip"], args].concat();
    Running::start_in(folder, &all).wait(AT_MOST)
}

#[test]
fn a_motion_goes_in_and_out_by_the_command_line() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let fox = fox().display().to_string();
    let walk = format!("{fox}#Walk");
    // Three animations: which one is asked, with the names.
    let asked = clip(at, &["import", &fox, "--unit", "cm", "--out", "a.json"]).expect(2);
    assert!(asked.err.contains("Survey, Walk, Run"), "{asked:#?}");
    let from = ["--unit", "cm", "--origin", "Fox, CC BY 4.0"];
    let import = ["import", &walk, "--out", "walk.json", "--json"];
    let done = clip(at, &[&import[..], &from].concat()).expect(0);
    let told = done.json();
    assert_eq!(told["kind"], "cycle", "{told}");
    assert_eq!(told["joints"], 22, "{told}");
    for out in ["walk.bvh", "walk.csv", "walk.glb", "walk.gltf"] {
        clip(at, &["export", "walk.json", "--seconds", "2", "--out", out]).expect(0);
        let back = [
            "import",
            out,
            "--skeleton",
            "walk.json",
            "--out",
            "back.json",
            "--json",
        ];
        let back = clip(at, &back).expect(0);
        let seconds = back.json()["duration_s"].as_f64().expect("a number");
        assert!((seconds - 2.0).abs() < 0.02, "{out}: {seconds} s");
        assert!(
            back.err.contains("--origin"),
            "{out}: no word on the origin"
        );
    }
    let wrong = clip(at, &["export", "walk.json", "--out", "walk.fbx"]).expect(2);
    assert!(wrong.err.contains(".bvh, .csv, .glb, .gltf"), "{wrong:#?}");
    let wrong = [
        "import", &walk, "--out", "b.json", "--start", "0.5", "--end", "0.2",
    ];
    let wrong = clip(at, &wrong).expect(2);
    assert!(wrong.err.contains("must lie in 0 to 0.708 s"), "{wrong:#?}");
}
