//! Which clips belong in one class: real gaits of three bodies, the project's own clips, strangers.

mod support;

use handwave::motion::warp::{FeatureClip, match_pair};
use std::path::Path;
use support::data::shared_data;

/// A clip of the DeepMimic family: JSON with "Frames"; `skip` leading numbers are time and root, then
/// `columns` joint numbers follow (half-angle quaternions and hinge angles).
fn mimic(file: &Path, skip: usize, columns: usize, cyclic: bool) -> FeatureClip {
    let text = std::fs::read_to_string(file).expect("a motion file");
    let json: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let rows = json["Frames"].as_array().expect("frames");
    let mut frames: Vec<Vec<f64>> = rows
        .iter()
        .map(|row| {
            let numbers = row.as_array().expect("a row");
            numbers[skip..skip + columns]
                .iter()
                .map(|v| v.as_f64().expect("a number"))
                .collect()
        })
        .collect();
    if cyclic {
        // The last frame of a cycle is its first one again.
        frames.pop();
    }
    FeatureClip {
        name: file
            .file_stem()
            .expect("named")
            .to_string_lossy()
            .into_owned(),
        cyclic,
        duration_s: 1.0,
        frames,
        limbs: if columns == 12 {
            (0..4).map(|l| vec![3 * l, 3 * l + 1, 3 * l + 2]).collect()
        } else {
            Vec::new()
        },
    }
}

fn table(clips: &[FeatureClip]) {
    for a in clips {
        let row: Vec<String> = clips
            .iter()
            .map(|b| {
                let m = match_pair(a, b).expect("one body");
                format!(
                    "{:5.2}/{:4.2}/{:4.2}{}",
                    m.shape,
                    m.by_limb,
                    m.place,
                    if m.still { "s" } else { " " }
                )
            })
            .collect();
        println!("{:>24} {}", a.name, row.join("  "));
    }
}

#[test]
fn calibrate() {
    let Some(human) = shared_data("human_joint") else {
        return;
    };
    let Some(dog) = shared_data("quadruped") else {
        return;
    };
    for cyclic in [true] {
        println!("cyclic {cyclic}");
        table(
            &["walk", "jog", "run", "jump", "spin"]
                .map(|n| mimic(&human.join(format!("humanoid3d_{n}.txt")), 8, 36, cyclic)),
        );
        table(
            &["pace", "trot", "canter", "spin"]
                .map(|n| mimic(&dog.join(format!("dog3d/dog3d_{n}.txt")), 8, 76, cyclic)),
        );
        table(
            &[
                "trot0.txt",
                "trot1.txt",
                "pace0.txt",
                "leftturn0.txt",
                "jump0.json",
            ]
            .map(|n| mimic(&dog.join("a1").join(n), 7, 12, cyclic)),
        );
        table(
            &[
                "dog_pace",
                "dog_trot",
                "dog_backwards_pace",
                "dog_backwards_trot",
                "dog_spin",
                "inplace_steps",
                "runningman",
                "sidesteps",
                "turn",
                "hopturn",
            ]
            .map(|n| mimic(&dog.join(format!("laikago/{n}.txt")), 7, 12, cyclic)),
        );
    }
    use handwave::motion::clip::ClipFile;
    use handwave::robot::RobotModel;
    let dir = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
    let urdf = std::fs::read_dir(dir.join("robots"))
        .expect("x")
        .flatten()
        .map(|e| e.path())
        .collect::<Vec<_>>();
    println!("{urdf:?}");
    let q = urdf
        .iter()
        .find(|p| p.to_string_lossy().ends_with("pup.urdf"))
        .expect("quad");
    let q = if q.is_dir() {
        std::fs::read_dir(q)
            .expect("d")
            .flatten()
            .map(|e| e.path())
            .find(|p| p.extension().is_some_and(|e| e == "urdf"))
            .expect("urdf")
    } else {
        q.clone()
    };
    let model = RobotModel::from_urdf(&std::fs::read_to_string(q).expect("t")).expect("model");
    let space = handwave::body::JointSpace::of_robot(&model, false);
    let clips: Vec<FeatureClip> = [
        "stand",
        "trot_short",
        "trot_long",
        "walk_short",
        "walk_long",
        "heading",
        "bow",
        "crouch",
        "lie",
    ]
    .iter()
    .map(|n| {
        let f = ClipFile::from_json(
            &std::fs::read_to_string(dir.join(format!("clips/{n}.json"))).expect("f"),
        )
        .expect("c");
        println!("{} {:?}", f.name, f.kind);
        FeatureClip::from_clip(&f.for_space(&space).expect("b"), &space)
    })
    .collect();
    let (cycles, rest): (Vec<_>, Vec<_>) = clips.into_iter().partition(|c| c.cyclic);
    table(&cycles);
    println!(
        "{:?}",
        handwave::motion::warp::align(&cycles)
            .expect("a")
            .clips
            .iter()
            .map(|c| (
                c.name.clone(),
                c.offset_cycles,
                c.cost,
                c.limb_offsets.clone()
            ))
            .collect::<Vec<_>>()
    );
    table(&rest);
}
