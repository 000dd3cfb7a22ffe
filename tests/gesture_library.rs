//! Gesture files as a library: listed, copied between files, removed, merged by a configuration.

mod support;

use handwave::gesture::GestureSet;
use support::folder::Folder;
use support::program::{Ended, handwave, refused, run_virtual};

fn gesture(args: &[&str]) -> Ended {
    handwave(&[&["gesture"], args].concat())
}

/// The bundled gestures in a file each, the second with its points in another order.
fn split(folder: &Folder) -> (String, String) {
    let hand = folder.text("gestures/hand.toml");
    let (one, two) = (folder.text("one.toml"), folder.text("two.toml"));
    let copy = |name: &str, into: &str| {
        gesture(&["copy", "--from", &hand, "--name", name, "--into", into]).expect(0);
    };
    copy("drum", &one);
    copy("splay", &two);
    let mut set = GestureSet::load(&folder.path("two.toml")).expect("copied");
    set.header.points.swap(1, 4);
    set.reference.swap(1, 4);
    for frame in &mut set.gestures[0].frames {
        frame.swap(1, 4);
    }
    set.about.author = Some("A. Performer".into());
    set.about.licence = Some("CC-BY-4.0".into());
    set.save(&folder.path("two.toml")).expect("writable");
    (one, two)
}

#[test]
fn what_does_not_go_together_is_refused_with_both_files() {
    let folder = Folder::of_configs();
    let (one, two) = split(&folder);
    let copy = |more: &[&str]| gesture(&[&["copy", "--from", &two], more].concat());
    refused(
        copy(&["--name", "spaly", "--into", &one]),
        2,
        &["two.toml has no gesture `spaly`", "splay"],
    );
    refused(
        copy(&["--name", "splay", "--as", "drum", "--into", &one]),
        2,
        &["one.toml has a gesture `drum` already", "--as", "--replace"],
    );
    refused(
        copy(&["--name", "splay", "--as", "a,b", "--into", &one]),
        2,
        &["no comma"],
    );
    refused(
        gesture(&["remove", "--gestures", &one, "--name", "splay"]),
        2,
        &["has no gesture `splay`"],
    );
    refused(
        gesture(&["list", &folder.text("nowhere.toml")]),
        2,
        &["cannot be read"],
    );
    folder.edit("two.toml", "\"palm\"", "\"wrist\"");
    refused(
        copy(&["--name", "splay", "--into", &one]),
        2,
        &[
            "two.toml",
            "one.toml",
            "only the first has wrist",
            "only the second has palm",
        ],
    );
    folder.edit("one.toml", "version = 1", "version = 1\nauthors = \"x\"");
    refused(gesture(&["list", &one]), 2, &["authors"]);
}

#[test]
fn a_gesture_wanders_between_files_and_keeps_its_maker() {
    let folder = Folder::of_configs();
    let (one, two) = split(&folder);
    let copied = gesture(&[
        "copy", "--from", &two, "--name", "splay", "--as", "spread", "--into", &one,
    ]);
    assert!(copied.expect(0).out.contains("copied `spread`"));
    let set = GestureSet::load(&folder.path("one.toml")).expect("a gesture file");
    let hand = GestureSet::load(&folder.path("gestures/hand.toml")).expect("bundled");
    assert_eq!(
        set.gestures[1].frames, hand.gestures[1].frames,
        "points in the order of the file"
    );
    assert!(
        set.gestures[1].source.contains("A. Performer, CC-BY-4.0"),
        "{}",
        set.gestures[1].source
    );
    // About survives, and the file is read and written without loss.
    let again = GestureSet::load(&folder.path("two.toml")).expect("a gesture file");
    assert_eq!(again.about.licence.as_deref(), Some("CC-BY-4.0"));
    assert_eq!(again.to_toml(), folder.read("two.toml"));
    let listed = gesture(&["list", &folder.text("."), "--json"])
        .expect(0)
        .out;
    let rows: Vec<serde_json::Value> = listed
        .lines()
        .map(|line| serde_json::from_str(line).expect("a row"))
        .collect();
    let names: Vec<&str> = rows.iter().filter_map(|r| r["gesture"].as_str()).collect();
    assert_eq!(
        names,
        ["drum", "spread", "splay"],
        "configurations are no gestures"
    );
    assert_eq!(rows[2]["author"], "A. Performer");
    let table = gesture(&["list", &one, &two]).expect(0).out;
    assert!(
        table.contains("CC-BY-4.0") && table.contains("spread"),
        "{table}"
    );
    gesture(&["remove", "--gestures", &one, "--name", "spread"]).expect(0);
    assert_eq!(
        GestureSet::load(&folder.path("one.toml"))
            .expect("a file")
            .gestures
            .len(),
        1
    );
}

#[test]
fn a_configuration_merges_its_gesture_files_or_names_both() {
    let folder = Folder::of_configs();
    split(&folder);
    folder.edit(
        "quadruped.toml",
        "file = \"gestures/hand.toml\" ",
        "file = \"one.toml\"\n[[gesture]]\nfile = \"two.toml\" ",
    );
    let config = folder.text("quadruped.toml");
    let targets = |name: &str, config: &[&str]| {
        let out = folder.text(name);
        run_virtual(&[config, &["--duration", "6", "--targets", &out]].concat()).expect(0);
        folder.read(name)
    };
    // The same gestures in two files and a shuffled order: the same motion to the last digit.
    assert!(
        targets("merged.csv", &[&config]) == targets("bundled.csv", &[]),
        "another motion"
    );
    folder.edit("two.toml", "name = \"splay\"", "name = \"drum\"");
    refused(
        run_virtual(&[&config]),
        2,
        &[
            "quadruped.toml:",
            "one.toml",
            "two.toml",
            "both define a gesture `drum`",
        ],
    );
    folder.edit("two.toml", "\"palm\"", "\"wrist\"");
    folder.edit("two.toml", "name = \"drum\"", "name = \"splay\"");
    refused(
        run_virtual(&[&config]),
        2,
        &["one.toml", "two.toml", "wrist"],
    );
}
