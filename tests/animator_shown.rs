//! What the shipped quadruped's performance shows: every class played, feet that do not slide.

mod support;

use handwave::body::Feet;
use support::character::{Player, RATE_HZ, built_in};

#[test]
fn the_performance_plays_every_class_and_feet_do_not_slide() {
    let character = built_in();
    let feet = character.body.feet.clone().expect("a quadruped has feet");
    let joints = character.joints.len();
    let mut player = Player::new(&character, character.safety.ramp_s + 0.005);
    let mut played = vec![0_u32; character.classes.len()];
    let mut began = vec![None; feet.count()];
    let (mut worst_m, mut stances, mut slid_m): (f64, u32, Vec<f64>) = (0.0, 0, vec![0.0; 4]);
    let mut held_back = 0_u32;
    while player.step(true) {
        let animator = player.puppet.animator();
        if player.puppet.stage() != handwave::puppet::Stage::Playing {
            continue;
        }
        played[animator.active()] += 1;
        held_back += u32::from(player.puppet.targets().held_back > 0);
        let mut pose = player.puppet.pose().to_vec();
        pose[..joints].copy_from_slice(player.positions());
        let pins = animator.pins().expect("pinned feet");
        for foot in 0..feet.count() {
            let at = animator.root().to_world(feet.position(&pose, foot));
            if pins.on_ground(foot) {
                let from = *began[foot].get_or_insert(at);
                slid_m[foot] = (at.xy() - from.xy()).norm();
                worst_m = worst_m.max(slid_m[foot]);
            } else if began[foot].take().is_some() {
                stances += 1;
            }
        }
    }
    let names: Vec<String> = (character.classes.iter().zip(&played))
        .map(|(c, n)| format!("{} {:.1} s", c.name, f64::from(*n) / RATE_HZ))
        .collect();
    println!(
        "{}; {stances} stances, worst slide {:.3} mm, envelope acted in {held_back} cycles, root {:?}",
        names.join(", "),
        1e3 * worst_m,
        player.puppet.animator().root()
    );
    assert!(played.iter().all(|n| *n > 100), "{names:?}");
    assert!(stances > 200, "{stances} stances");
    assert!(
        worst_m < 2e-3,
        "a foot slid {:.2} mm in one stance",
        1e3 * worst_m
    );
    assert_eq!(held_back, 0, "the envelope acted");
}
