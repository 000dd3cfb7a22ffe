//! Channels mixed by the configuration: what is refused, what they are worth, and that they move the robot.

mod gesture_support;
mod support;

use gesture_support::{Path, header, pose, sample, wave_set};
use handwave::config::{self, Files};
use handwave::gesture::{DerivedChannel, DerivedChannelError, FrontEnd, FrontEndOptions};
use handwave::live::{session, source};
use handwave::pose::PoseHeader;
use support::character::Player;
use support::folder::Folder;
use support::program::{refused, run_virtual};

fn derived(name: &str, weights: &[(&str, f64)]) -> DerivedChannel {
    DerivedChannel {
        name: name.into(),
        weights: weights.iter().map(|(n, w)| ((*n).into(), *w)).collect(),
        offset: 0.0,
        range: None,
        smoothing_s: 0.0,
    }
}

/// The figure of the gesture tests with the channels `smile` and `frown`.
fn front() -> FrontEnd {
    let stream = PoseHeader {
        channels: vec!["smile".into(), "frown".into()],
        ..header()
    };
    let set = wave_set(Path::Loop);
    FrontEnd::new(&set, &stream, FrontEndOptions::default()).expect("points match")
}

fn push(front: &mut FrontEnd, t: f64, smile: Option<f64>, frown: Option<f64>) {
    let mut sample = sample(t, &pose(Path::Loop, 0.0, 0.0));
    sample.channels = vec![smile, frown];
    front.push(&sample).expect("a good sample");
}

#[test]
fn a_mix_that_cannot_be_is_refused_with_what_may_stand_there() {
    let unknown = front()
        .with_channel(&derived("emotion", &[("smlie", 1.0)]))
        .expect_err("no such channel")
        .to_string();
    for part in [
        "channel \"emotion\"",
        "\"smlie\"; did you mean \"smile\"?",
        "yaw",
        "frown",
    ] {
        assert!(unknown.contains(part), "no {part:?} in: {unknown}");
    }
    for taken in ["smile", "yaw", "yaw_rad"] {
        let error = front()
            .with_channel(&derived(taken, &[("smile", 1.0)]))
            .expect_err("taken");
        assert_eq!(
            error,
            DerivedChannelError::Taken {
                channel: taken.into()
            }
        );
    }
    let itself = front().with_channel(&derived("a", &[("a", 1.0)]));
    assert!(
        matches!(itself, Err(DerivedChannelError::Unknown { .. })),
        "{itself:?}"
    );
    let good = derived("emotion", &[("smile", 1.0)]);
    for (wrong, expected) in [
        (
            derived("emotion", &[]),
            "weights = {}; allowed: at least one",
        ),
        (
            derived("emotion", &[("smile", f64::NAN)]),
            "{ smile = NaN }; allowed: -1000 to 1000",
        ),
        (
            DerivedChannel {
                offset: f64::INFINITY,
                ..good.clone()
            },
            "offset = inf",
        ),
        (
            DerivedChannel {
                range: Some([1.0, 1.0]),
                ..good.clone()
            },
            "range = [1, 1]; allowed: two",
        ),
        (
            DerivedChannel {
                range: Some([f64::NAN, 1.0]),
                ..good.clone()
            },
            "range = [NaN, 1]",
        ),
        (
            DerivedChannel {
                smoothing_s: -0.1,
                ..good.clone()
            },
            "smoothing_s = -0.1; allowed: 0 to 2 s",
        ),
        (
            DerivedChannel {
                smoothing_s: 1e9,
                ..good.clone()
            },
            "smoothing_s",
        ),
    ] {
        let message = front()
            .with_channel(&wrong)
            .expect_err(expected)
            .to_string();
        assert!(message.contains(expected), "{message}");
    }
}

#[test]
fn a_mix_is_offset_plus_weighted_channels_within_its_range() {
    let mut emotion = derived("emotion", &[("smile", 0.8), ("frown", -1.0)]);
    emotion.offset = 0.1;
    emotion.range = Some([-0.5, 0.7]);
    let twice = derived("twice", &[("emotion", 2.0), ("height", 1.0)]);
    let mut front = front()
        .with_channel(&emotion)
        .and_then(|front| front.with_channel(&twice))
        .expect("good mixes");
    let (emotion, twice) = (
        front.channel_index("emotion").expect("there"),
        front.channel_index("twice").expect("there"),
    );
    let height = front.channel_index("height").expect("there");
    let mut t = 0.0;
    for (smile, frown, expected) in [
        (Some(0.0), Some(0.0), 0.1),
        (Some(0.5), Some(0.2), 0.3),
        // What a sample does not carry stays as it was.
        (None, Some(0.1), 0.4),
        (Some(1.0), Some(0.0), 0.7),
        (Some(0.0), Some(1.0), -0.5),
    ] {
        t += 0.02;
        push(&mut front, t, smile, frown);
        let found = front.channel(emotion);
        assert!(
            (found - expected).abs() < 1e-12,
            "{smile:?} {frown:?}: {found}, not {expected}"
        );
        let sum = 2.0 * expected + front.channel(height);
        assert!(
            (front.channel(twice) - sum).abs() < 1e-12,
            "a mix of a mix and the height"
        );
    }
    front.reset();
    assert_eq!(front.channel(emotion), 0.0, "forgotten");
}

#[test]
fn a_smoothed_mix_follows_a_step_within_three_deviations_and_jitters_less() {
    let smoothed = DerivedChannel {
        smoothing_s: 0.2,
        ..derived("calm", &[("smile", 1.0)])
    };
    let mut front = front().with_channel(&smoothed).expect("a good mix");
    let calm = front.channel_index("calm").expect("there");
    let (mut last, mut largest_step) = (0.0, 0.0f64);
    let mut reached_s = f64::NAN;
    for k in 0..200 {
        let t = 0.01 * f64::from(k);
        push(&mut front, t, Some(f64::from(u8::from(t >= 1.0))), None);
        let value = front.channel(calm);
        largest_step = largest_step.max((value - last).abs());
        last = value;
        if value > 0.99 && reached_s.is_nan() {
            reached_s = t - 1.0;
        }
    }
    assert!(largest_step < 0.05, "a step of {largest_step:.3} in 10 ms");
    assert!(reached_s < 0.6, "99 % after {reached_s:.2} s");
}

/// The built-in quadruped with an emotion that lowers its body, and its performance with a face.
fn moody(folder: &Folder) -> String {
    folder.edit(
        "quadruped.toml",
        "[robot]\n",
        "[[channel]]
name = \"emotion\"
weights = { MouthSmileLeft = 0.5, MouthSmileRight = 0.5, MouthFrownLeft = -0.5, MouthFrownRight = -0.5 }
range = [-1.0, 1.0]
smoothing_s = 0.15

[[layer]]
name = \"mood\"
channel = \"emotion\"
clip = \"clips/crouch.json\"
range = [-0.1, -0.8]
one_sided = true

[robot]\n",
    );
    let part = "performances/drum_and_splay.jsonl";
    let text = folder.read(part);
    // Smiles for 8 s, frowns for 8 s, and so on.
    let mut lines = text.lines();
    let mut face = format!("{}\n", lines.next().expect("a header"));
    for line in lines {
        let value: serde_json::Value = serde_json::from_str(line).expect("a sample");
        let sad = (value["t"].as_f64().expect("a time") / 8.0) as u64 % 2 == 1;
        let (smile, frown) = if sad { (0.0, 0.9) } else { (0.7, 0.0) };
        let rest = line.strip_suffix('}').expect("an object");
        face += &format!(
            "{rest},\"ch\":{{\"MouthSmileLeft\":{smile},\"MouthSmileRight\":{smile},\"MouthFrownLeft\":{frown},\"MouthFrownRight\":{frown}}}}}\n"
        );
    }
    folder.write(part, &face);
    folder.text("quadruped.toml")
}

#[test]
fn a_frown_lowers_the_robot_and_a_smile_does_not() {
    let folder = Folder::of_configs();
    moody(&folder);
    let files = Files::Folder(folder.path(""));
    let character = config::load(files, "quadruped.toml").expect("a good configuration");
    let begins_s = character.safety.ramp_s + 0.005;
    let mut player = Player::new(&character, begins_s);
    let mood = |player: &Player| player.puppet.animator().layers()[2].weight();
    for (until_s, expected) in [(7.5, 0.0), (15.5, 1.0), (23.5, 0.0)] {
        while player.t_s() < begins_s + until_s {
            player.step(true);
        }
        let weight = mood(&player);
        assert!(
            (weight - expected).abs() < 0.02,
            "mood {weight:.3} at {until_s} s, not {expected}"
        );
    }
}

#[test]
fn a_configuration_with_a_mood_plays_and_a_wrong_one_names_its_line() {
    let folder = Folder::of_configs();
    let config = moody(&folder);
    let ended = run_virtual(&[&config, "--duration", "12", "--json"]).expect(0);
    assert_eq!(ended.json()["envelope_cycles"], 0, "{}", ended.out);
    for (from, to, parts) in [
        (
            "MouthSmileRight = 0.5",
            "MouthSmileRihgt = 0.5",
            vec![
                "\"MouthSmileRihgt\"; did you mean \"MouthSmileRight\"?",
                "MouthFrownLeft",
            ],
        ),
        (
            "range = [-1.0, 1.0]",
            "range = [1.0, -1.0]",
            vec!["range = [1, -1]", "the lower first"],
        ),
        (
            "smoothing_s = 0.15",
            "smoothing_s = 15",
            vec!["smoothing_s = 15", "0 to 2 s"],
        ),
        (
            "smoothing_s = 0.15",
            "smothing_s = 0.15",
            vec!["did you mean \"smoothing_s\"?"],
        ),
        (
            "name = \"emotion\"",
            "name = \"yaw\"",
            vec!["\"yaw\" is there already"],
        ),
        (
            "channel = \"emotion\"",
            "channel = \"emotoin\"",
            vec!["did you mean \"emotion\"?"],
        ),
    ] {
        let folder = Folder::of_configs();
        let config = moody(&folder);
        folder.edit("quadruped.toml", from, to);
        let text = folder.read("quadruped.toml");
        let line = |part: &str| text[..text.find(part).expect(part)].matches('\n').count() + 1;
        let at = match to {
            "channel = \"emotoin\"" | "smothing_s = 0.15" => line(to),
            "name = \"yaw\"" => line(to),
            _ => line("name = \"emotion\""),
        };
        let place = format!("{config}:{at}: ");
        refused(
            run_virtual(&[&config]),
            2,
            &[&[place.as_str()], parts.as_slice()].concat(),
        );
    }
}

#[test]
fn gestures_over_channels_read_a_stream_of_channels_alone() {
    let folder = Folder::empty();
    // A mouth that opens and closes at 1.5 Hz while the brows rest.
    let mut text = String::from("t,ch.BrowInnerUp,ch.JawOpen\n");
    for k in 0..300 {
        let t = f64::from(k) / 30.0;
        let jaw = 0.4 - 0.4 * (t * 1.5 * std::f64::consts::TAU).cos();
        text += &format!("{t:.4},0.1,{jaw:.4}\n");
    }
    let face = folder.write("face.csv", &text);
    let (points, gestures, waves) = (
        folder.text("points.csv"),
        folder.text("g.toml"),
        folder.text("waves.csv"),
    );
    let define = |poses: &str| {
        support::program::handwave(&[
            "gesture", "define", "--poses", poses, "--name", "talk", "--start", "1", "--into",
            &gestures,
        ])
    };
    refused(define(&face), 2, &["channels", "--as-points"]);
    let import = [
        "poses",
        "import",
        &face,
        "--as-points",
        "JawOpen,BrowInnerUp",
        "--out",
        &points,
    ];
    support::program::handwave(&import).expect(0);
    define(&points).expect(0);
    for poses in [&points, &face] {
        let estimate = [
            "gesture",
            "estimate",
            "--gestures",
            &gestures,
            "--poses",
            poses,
            "--out",
            &waves,
        ];
        support::program::handwave(&estimate).expect(0);
        let rows = std::fs::read_to_string(&waves).expect("estimates");
        let last: Vec<&str> = rows.lines().last().expect("rows").split(',').collect();
        let [amplitude, frequency_hz]: [f64; 2] =
            [2, 3].map(|k| last[k].parse().expect("a number"));
        assert!(
            (frequency_hz.abs() - 1.5).abs() < 0.03,
            "{poses}: {frequency_hz} Hz"
        );
        assert!(
            (amplitude - 1.0).abs() < 0.1,
            "{poses}: amplitude {amplitude}"
        );
    }
    let reader =
        source::open(&format!("file:{face}"), &source::working_folder()).expect("a source");
    assert!(reader.header().points.is_empty());
    let built_in = support::character::built_in();
    let Err(error) = session::puppet(&built_in, reader.header(), 200.0) else {
        panic!("a hand's gestures over a face");
    };
    assert!(error.to_string().contains("no point palm"), "{error}");
}
