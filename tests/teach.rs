//! Teaching a gesture: what a performer does, what the state machine makes of it, and where it refuses.

mod gesture_support;

use gesture_support::{Path, Random, header, pose, sample, times, wave_set};
use handwave::gesture::{
    DefineError, Definition, GestureKind, GestureSet, Mark, TeachError, TeachOptions, TeachPhase,
    Teacher,
};
use handwave::pose::SampleFault;
use std::f64::consts::TAU;

const RATE_HZ: f64 = 60.0;

fn options(kind: GestureKind, count_down_s: f64, hands_free: bool) -> TeachOptions {
    TeachOptions {
        name: "wave".into(),
        source: "test".into(),
        kind,
        count_down_s,
        hands_free,
        longest_s: 20.0,
    }
}

fn teacher(options: TeachOptions) -> Teacher {
    let set = GestureSet::new(&header(), Vec::new());
    Teacher::new(&set, &header(), options).expect("points that match")
}

/// Shows `motion(t)` (a size and a phase) until the teacher is done; returns when, and what came out.
fn show(
    teacher: &mut Teacher,
    until: f64,
    path: Path,
    motion: impl Fn(f64) -> (f64, f64),
) -> (f64, Result<Definition, TeachError>) {
    let mut random = Random(0x5eed);
    for t in times(RATE_HZ, until, 0.1, 3) {
        let (size, phase) = motion(t);
        let mut pose = pose(path, size, phase);
        for place in pose.iter_mut().flatten() {
            *place += 0.0005 * random.normal();
        }
        teacher.push(&sample(t, &pose)).expect("a good sample");
        if let Some(outcome) = teacher.outcome() {
            return (t, outcome.clone());
        }
    }
    teacher.finish(until);
    (until, teacher.outcome().expect("finished").clone())
}

#[test]
fn bad_samples_are_refused_and_change_nothing() {
    let mut teacher = teacher(options(GestureKind::Cyclic, 0.0, false));
    let good = sample(1.0, &pose(Path::Loop, 0.0, 0.0));
    teacher.push(&good).expect("good");
    let mut short = good.clone();
    short.points.pop();
    assert!(matches!(
        teacher.push(&short),
        Err(SampleFault::PointCount {
            found: 5,
            expected: 6
        })
    ));
    let mut odd = good.clone();
    odd.t = 2.0;
    odd.points[0] = Some([f64::NAN, 0.0, 0.0]);
    assert_eq!(teacher.push(&odd), Err(SampleFault::NonFinite));
    assert!(matches!(
        teacher.push(&good),
        Err(SampleFault::TimeBackwards { .. })
    ));
    assert_eq!(teacher.held(), 1);
    assert_eq!(teacher.view().phase, TeachPhase::Waiting);
}

#[test]
fn a_set_of_another_tracker_is_refused_with_the_point() {
    let mut other = header();
    other.points[0] = "pelvis".into();
    let set = GestureSet::new(&header(), Vec::new());
    let refused = Teacher::new(&set, &other, options(GestureKind::Cyclic, 0.0, false));
    assert_eq!(
        refused.err(),
        Some(DefineError::MissingPoint {
            point: "hip".into()
        })
    );
}

#[test]
fn hands_free_a_wave_is_taught_after_the_count_down_within_four_periods() {
    for (path, period, begins) in [
        (Path::Loop, 1.0, 3.0),
        (Path::Line, 0.7, 3.0),
        (Path::Loop, 1.6, 4.5),
    ] {
        let mut teacher = teacher(options(GestureKind::Cyclic, 3.0, true));
        let (ended, outcome) = show(&mut teacher, 20.0, path, |t| {
            (
                ((t - begins) / 0.3).clamp(0.0, 1.0),
                TAU * (t - begins) / period,
            )
        });
        let found = outcome.expect("a clear wave");
        let error = (found.gesture.duration_s - period).abs() / period;
        println!(
            "{path:?} {period} s: {:.4} s, ended {:.2} s after its begin, closure {:.3}",
            found.gesture.duration_s,
            ended - begins,
            found.closure
        );
        assert!(
            error < 0.02,
            "{path:?}: {} s for {period} s",
            found.gesture.duration_s
        );
        assert!(found.closure < 0.15, "{path:?}: closure {}", found.closure);
        assert!(
            ended - begins < 4.0 * period + 0.5,
            "{path:?}: {} s",
            ended - begins
        );
        assert!(
            ended > 3.0 + 2.0 * period,
            "ended during the count-down: {ended}"
        );
    }
}

#[test]
fn the_count_down_counts_and_stillness_is_named() {
    let mut teacher = teacher(options(GestureKind::Cyclic, 2.0, false));
    let still = pose(Path::Loop, 0.0, 0.0);
    teacher.push(&sample(0.0, &still)).expect("good");
    assert_eq!(teacher.view().phase, TeachPhase::Waiting, "nobody asked");
    teacher.mark(0.5, Mark::Start);
    teacher.tick(1.5);
    let view = teacher.view();
    assert_eq!(view.phase, TeachPhase::CountDown);
    assert!((view.left_s - 1.0).abs() < 1e-9, "{view:?}");
    for k in 1..1500 {
        teacher
            .push(&sample(f64::from(k) / RATE_HZ, &still))
            .expect("good");
    }
    let Some(Err(TeachError::NothingMoved { seconds, .. })) = teacher.outcome() else {
        panic!("{:?}", teacher.outcome());
    };
    assert!((*seconds - 20.0).abs() < 0.2, "gave up after {seconds} s");
    // Once more.
    teacher.mark(25.0, Mark::Next);
    assert_eq!(teacher.view().phase, TeachPhase::CountDown);
    teacher.mark(25.0, Mark::Cancel);
    assert_eq!(teacher.outcome(), Some(&Err(TeachError::Cancelled)));
}

#[test]
fn a_walk_at_random_has_no_period() {
    let mut random = Random(7);
    let mut teacher = teacher(options(GestureKind::Cyclic, 0.0, true));
    let mut place = [0.0; 2];
    for t in times(RATE_HZ, 12.0, 0.0, 1) {
        for axis in &mut place {
            *axis = 0.98 * *axis + 0.05 * random.normal();
        }
        let pose = pose(
            Path::Loop,
            place[0].hypot(place[1]),
            place[1].atan2(place[0]),
        );
        teacher.push(&sample(t, &pose)).expect("good");
    }
    teacher.finish(12.0);
    assert!(
        matches!(teacher.outcome(), Some(Err(TeachError::NoPeriod { .. }))),
        "{:?}",
        teacher.outcome()
    );
}

#[test]
fn a_marked_single_period_is_taken_as_marked_and_too_short_a_one_refused() {
    for (end, expected) in [(2.0, Some(1.0)), (1.03, None)] {
        let mut teacher = teacher(options(GestureKind::Cyclic, 0.0, false));
        for t in times(RATE_HZ, 3.0, 0.0, 1) {
            if (1.0..1.0 + 0.9 / RATE_HZ).contains(&t) {
                teacher.mark(t, Mark::Next);
            }
            if t >= end {
                teacher.mark(t, Mark::Next);
                break;
            }
            teacher
                .push(&sample(t, &pose(Path::Loop, 1.0, TAU * t)))
                .expect("good");
        }
        match (teacher.outcome().expect("over"), expected) {
            (Ok(found), Some(period)) => {
                let error = found.gesture.duration_s - period;
                assert!(error.abs() < 0.05, "{error} s");
                teacher.mark(3.0, Mark::Next);
                assert!(teacher.accepted());
            }
            (Err(TeachError::TooShort { frames: 0..4 }), None) => {}
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn an_extreme_is_found_where_the_pose_rests_and_where_it_turns_back() {
    // The hand goes out in 0.5 s from 2.0 s on, stays, or comes back after 0.1 s.
    for (stays, latest) in [(true, 3.3), (false, 3.2)] {
        let mut teacher = teacher(options(GestureKind::NonCyclic, 1.0, true));
        let (ended, outcome) = show(&mut teacher, 8.0, Path::Line, |t| {
            let out = ((t - 2.0) / 0.5).clamp(0.0, 1.0);
            let back = if stays {
                0.0
            } else {
                ((t - 2.6) / 0.5).clamp(0.0, 1.0)
            };
            (out - back, 0.0)
        });
        let found = outcome.expect("a clear extreme").gesture;
        println!(
            "stays {stays}: {:.3} s, found at {ended:.2} s",
            found.duration_s
        );
        assert_eq!(found.kind, GestureKind::NonCyclic);
        assert!(
            (0.35..0.7).contains(&found.duration_s),
            "{}",
            found.duration_s
        );
        assert!(ended < latest, "found at {ended} s");
    }
}

#[test]
fn memory_is_bounded_however_long_nobody_marks() {
    let mut teacher = teacher(options(GestureKind::Cyclic, 0.0, false));
    let still = pose(Path::Loop, 0.0, 0.0);
    for k in 0..60_000 {
        teacher
            .push(&sample(f64::from(k) / 1000.0, &still))
            .expect("good");
        assert!(teacher.held() <= 3002, "{} samples held", teacher.held());
    }
}

#[test]
fn guidance_is_low_for_what_is_known_and_high_for_what_is_new() {
    let set = wave_set(Path::Loop);
    let mut teacher =
        Teacher::new(&set, &header(), options(GestureKind::Cyclic, 0.0, false)).expect("matches");
    let mut most_known: f64 = 0.0;
    for t in times(RATE_HZ, 2.0, 0.0, 1) {
        teacher
            .push(&sample(t, &pose(Path::Loop, 0.9, TAU * t)))
            .expect("good");
        most_known = most_known.max(teacher.view().movement);
    }
    let mut new = 0.0_f64;
    for t in times(RATE_HZ, 2.0, 0.0, 1) {
        // The head nods and the left hand moves: nothing known does that.
        let mut other = pose(Path::Loop, 0.0, 0.0);
        other[3][1] += 0.2 * (TAU * t).sin();
        other[2][2] += 0.1 * (TAU * t).sin();
        teacher.push(&sample(3.0 + t, &other)).expect("good");
        new = new.max(teacher.view().movement);
    }
    println!("novelty: the known wave {most_known:.3}, a new movement {new:.3}");
    assert!(most_known < 0.15, "the known wave reads {most_known}");
    assert!(new > 0.6, "the new movement reads {new}");
    assert_eq!(teacher.view().pose.and_then(|p| p.nearest), Some(0));
}
