//! Heading and height of the hand reach the robot as additive layers, on top of whatever it does.

mod support;

use handwave::pose::PoseSample;
use support::character::{Player, RATE_HZ, built_in};
use support::limits::LimitWatch;

/// Turns the whole hand about the vertical through the tracker and moves it up by `up_m`.
fn move_hand(sample: &mut PoseSample, yaw_rad: f64, up_m: f64) {
    let (sin, cos) = yaw_rad.sin_cos();
    for point in sample.points.iter_mut().flatten() {
        let [x, y, z] = *point;
        // y is up: counter-clockwise from above turns x towards -z.
        *point = [cos * x + sin * z, y + up_m, cos * z - sin * x];
    }
}

/// Plays until `until_s` of the performance; gives layer weights (heading, crouch) and targets.
fn play(yaw_rad: f64, up_m: f64, until_s: f64) -> (Vec<f64>, Vec<f64>) {
    let character = built_in();
    let begins_s = character.safety.ramp_s + 0.005;
    let mut player = Player::with(&character, begins_s, |_, sample| {
        move_hand(sample, yaw_rad, up_m);
    });
    while player.t_s() < begins_s + until_s {
        player.step(true);
    }
    let weights = player.puppet.animator().layers().iter();
    (
        weights.map(|l| l.weight()).collect(),
        player.positions().to_vec(),
    )
}

#[test]
fn the_drumming_hand_as_recorded_neither_turns_nor_lowers_the_robot() {
    // Later, in the splay, the recorded hand is turned by 0.7 rad, and the robot bows to the side.
    for until_s in [3.0, 16.0, 30.0] {
        let (weights, _) = play(0.0, 0.0, until_s);
        assert!(
            weights.iter().all(|w| w.abs() < 0.05),
            "heading and crouch {weights:?} at {until_s} s"
        );
    }
}

#[test]
fn a_turned_hand_turns_the_body_and_a_lowered_hand_lowers_it() {
    let (_, rest) = play(0.0, 0.0, 3.0);
    for (yaw_rad, sign) in [(0.6, 1.0), (-0.6, -1.0)] {
        let (weights, turned) = play(yaw_rad, 0.0, 3.0);
        assert!(
            (weights[0] - sign).abs() < 0.15,
            "heading {weights:?} for a hand turned by {yaw_rad}"
        );
        assert!(
            weights[1].abs() < 0.05,
            "crouch {weights:?} for a hand only turned"
        );
        // Over standing feet a body that turns swings its front legs sideways, joint 0 among them.
        let swing = turned[0] - rest[0];
        assert!(swing.abs() > 0.05, "front hip moved by {swing} rad");
    }
    let (weights, lowered) = play(0.0, -0.12, 3.0);
    assert!(
        weights[0].abs() < 0.05 && weights[1] > 0.9,
        "heading and crouch {weights:?}"
    );
    // Joint 2 is a knee: bent further by a crouch.
    assert!(
        lowered[2] < rest[2] - 0.2,
        "knee {} at rest, {} crouching",
        rest[2],
        lowered[2]
    );
}

#[test]
fn drumming_with_a_turned_and_lowered_hand_still_walks_inside_the_limits() {
    let character = built_in();
    let begins_s = character.safety.ramp_s + 0.005;
    // The hand sways in heading and height while it drums, a full sway every four seconds.
    let mut player = Player::with(&character, begins_s, |t, sample| {
        let sway = (t * std::f64::consts::TAU / 4.0).sin();
        move_hand(sample, 0.5 * sway, -0.04 + 0.04 * sway);
    });
    let mut watch = LimitWatch::new(&character.limits, 1.0 / RATE_HZ);
    let mut held_back = 0;
    let mut amplitude: f64 = 0.0;
    while player.t_s() < begins_s + 30.0 {
        player.step(true);
        watch
            .see(player.positions())
            .expect("targets inside the limits");
        held_back += usize::from(player.puppet.targets().held_back > 0);
        amplitude = amplitude.max(player.puppet.animator().played()[0].amplitude);
    }
    assert!(amplitude > 0.8, "drumming is read as {amplitude} at most");
    assert!(
        held_back <= 5,
        "the envelope acted in {held_back} of 6400 cycles"
    );
}
