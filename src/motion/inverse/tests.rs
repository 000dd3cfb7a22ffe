//! The inverse map on the figure of Casas 2013, on an arm of four joints and on what cannot be inverted.

use super::*;
use crate::robot::RobotModel;

const ARM: &str = include_str!("../../../configs/robots/open_manipulator_x.urdf");

fn arm() -> (RobotModel, usize) {
    let model = RobotModel::from_urdf(ARM).expect("the arm");
    let hand = model.link("end_effector_link").expect("its hand");
    (model, hand)
}

/// Joint positions blended from `poses`.
fn blend(poses: &[[f64; 5]], w: &[f64]) -> [f64; 5] {
    std::array::from_fn(|j| poses.iter().zip(w).map(|(p, w)| w * p[j]).sum())
}

#[test]
fn figure_3_2_is_inverted_within_a_sixth_of_a_tenth() {
    // Two reaches, low and high; w in tenths of the high one, h in metres.
    let height = |w: f64| ((-0.0006 * w + 0.0086) * w + 0.0554) * w + 1.0070;
    let map = InverseMap::new(2, 1, InverseOptions::default(), |w, p| {
        p[0] = height(10.0 * w[1]);
    })
    .expect("monotone");
    assert_eq!(map.monotone(), Some(Monotone::Yes));
    let mut w = [0.0; 2];
    for k in 0..=100 {
        let h = height(0.1 * f64::from(k));
        map.weights([h], &mut w);
        let printed = ((12.78 * h - 53.84) * h + 85.58) * h - 44.62;
        let gap = (10.0 * w[1] - printed).abs();
        assert!(gap < 0.15, "{gap} tenths off the printed inverse at {h} m");
        assert!((10.0 * w[1] - 0.1 * f64::from(k)).abs() < 0.01, "at {h} m");
    }
}

#[test]
fn the_height_of_a_reaching_hand_comes_back_within_two_percent() {
    let (model, hand) = arm();
    let poses = [
        [0.0, 0.6, 0.3, 0.4, 0.0],
        [0.0, -0.2, 0.2, -0.6, 0.0],
        [0.0, -1.2, 0.4, -0.4, 0.0],
    ];
    let map = InverseMap::new(3, 1, InverseOptions::default(), |w, p| {
        p[0] = model.link_pose(hand, &blend(&poses, w)).translation.z;
    })
    .expect("a reach");
    let found = map.round_trip();
    println!("1-D: {found:?} {:?} {:?}", map.range(0), map.monotone());
    assert!(found.max < 0.02 && found.trials > 100, "{found:?}");
    let mut w = [0.0; 3];
    for wish in [-9.0, f64::NAN, f64::NEG_INFINITY] {
        map.weights([wish], &mut w);
        let z = model.link_pose(hand, &blend(&poses, &w)).translation.z;
        assert!((z - map.range(0).0).abs() < 1e-9, "{wish} gives {z}");
    }
}

#[test]
fn reach_and_height_together_come_back_within_two_percent() {
    let (model, hand) = arm();
    let poses = [
        [0.0, 0.5, 0.4, 0.2, 0.0],
        [0.0, -0.6, 0.9, -0.2, 0.0],
        [0.0, -0.7, -0.3, 0.5, 0.0],
    ];
    let forward = |w: &[f64], p: &mut [f64]| {
        let at = model.link_pose(hand, &blend(&poses, w)).translation;
        p[0] = at.x;
        p[1] = at.z;
    };
    let map = InverseMap::new(3, 2, InverseOptions::default(), forward).expect("a plane");
    let found = map.round_trip();
    println!("2-D: {found:?} {:?} {:?}", map.range(0), map.range(1));
    assert!(found.max < 0.02, "{found:?}");
    // Far outside: still weights.
    let mut w = [0.0; 3];
    map.weights([9.0, -9.0], &mut w);
    let sum: f64 = w.iter().sum();
    assert!(
        (sum - 1.0).abs() < 1e-9 && w.iter().all(|w| *w >= 0.0),
        "{w:?}"
    );
}

#[test]
fn more_clips_than_needed_give_sparse_weights_that_still_meet_the_wish() {
    // Five clips on a plane: speed and turn, bent a little.
    let clips = [[0.5, 0.0], [2.0, 0.0], [1.0, -0.8], [1.0, 0.8], [2.0, 0.5]];
    let forward = |w: &[f64], p: &mut [f64]| {
        for d in 0..2 {
            p[d] = clips.iter().zip(w).map(|(c, w)| w * c[d]).sum();
        }
        p[0] += 0.1 * p[1] * p[1];
    };
    let map = InverseMap::new(5, 2, InverseOptions::default(), forward).expect("a plane");
    let found = map.round_trip();
    println!("2-D, five clips: {found:?}");
    assert!(found.max < 0.02 && found.mean < 0.005, "{found:?}");
    let mut w = [0.0; 5];
    map.weights([1.3, 0.2], &mut w);
    assert!(w.iter().filter(|w| **w > 0.0).count() <= 3, "{w:?}");
}

#[test]
fn a_parameter_that_turns_back_is_restricted_or_levelled_and_said_so() {
    // Falls to -0.2, then rises to 1.
    let forward = |w: &[f64], p: &mut [f64]| p[0] = w[1] * w[1] * 1.8 - 0.8 * w[1];
    let map = InverseMap::new(2, 1, InverseOptions::default(), forward).expect("it rises in all");
    let Some(Monotone::Restricted { from, to, reached }) = map.monotone() else {
        panic!("{:?}", map.monotone());
    };
    assert!(
        from < -0.08 && to == 1.0 && reached.0 <= from,
        "{from}..{to}, {reached:?}"
    );
    assert!(map.round_trip().max < 0.02, "{:?}", map.round_trip());
    let options = InverseOptions {
        not_monotone: NotMonotone::Isotonic,
        ..InverseOptions::default()
    };
    let map = InverseMap::new(2, 1, options, forward).expect("it rises in all");
    let Some(Monotone::Isotonic { change }) = map.monotone() else {
        panic!("{:?}", map.monotone());
    };
    assert!(change > 0.01 && change < 0.2, "change {change}");
    let mut w = [0.0; 2];
    for k in 0..=20 {
        map.weights([-0.2 + 0.06 * f64::from(k)], &mut w);
        assert!((w[0] + w[1] - 1.0).abs() < 1e-12, "{w:?}");
    }
}

#[test]
fn what_has_no_inverse_is_refused() {
    let options = InverseOptions::default();
    let flat = InverseMap::new(2, 1, options, |_, p| p[0] = 0.3).map(|_| ());
    assert_eq!(
        flat,
        Err(InverseError::Flat {
            dimension: 0,
            value: 0.3
        })
    );
    let flat = InverseMap::new(3, 2, options, |w, p| {
        p[0] = w[1];
        p[1] = 0.5;
    })
    .map(|_| ());
    assert!(
        matches!(flat, Err(InverseError::Flat { dimension: 1, .. })),
        "{flat:?}"
    );
    let nan = InverseMap::new(2, 1, options, |w, p| p[0] = (w[1] - 0.5).sqrt()).map(|_| ());
    assert!(
        matches!(nan, Err(InverseError::NotFinite { dimension: 0, .. })),
        "{nan:?}"
    );
    assert_eq!(
        InverseMap::new(0, 1, options, |_, _| ()).map(|_| ()),
        Err(InverseError::Empty)
    );
    assert_eq!(
        InverseMap::new(2, 5, options, |_, _| ()).map(|_| ()),
        Err(InverseError::Dimensions { found: 5 })
    );
    let many = InverseMap::new(40, 4, options, |w, p| p.copy_from_slice(&w[..4])).map(|_| ());
    assert_eq!(
        many,
        Err(InverseError::TooMany {
            examples: 40,
            dimensions: 4
        })
    );
    let mut w = [0.0];
    InverseMap::new(1, 1, options, |_, p| p[0] = 0.3)
        .expect("one clip")
        .weights([2.0], &mut w);
    assert_eq!(w, [1.0]);
}
