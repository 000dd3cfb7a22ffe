//! Transitions of the animator with small made-up classes: limits kept, nothing jumps, nothing stale comes back.

mod support;

use handwave::body::JointSpace;
use handwave::motion::Animator;
use handwave::motion::class::{ClassOptions, Drive, Example, MotionClass, Play};
use handwave::motion::clip::ClipFile;
use handwave::motion::graph::{Graph, GraphOptions};
use handwave::motion::layer::LayerInput;
use handwave::motion::range::JointRange;
use handwave::motion::weights::Parameters;
use handwave::robot::JointEnvelope;
use std::f64::consts::TAU;
use support::limits::LimitWatch;

const DT_S: f64 = 0.005;
const SPEED: f64 = 5.0;
const ACCELERATION: f64 = 60.0;

fn joints() -> Vec<String> {
    vec!["a".into(), "b".into()]
}

fn ranges() -> Vec<JointRange> {
    let range = JointRange {
        velocity: SPEED,
        acceleration: ACCELERATION,
    };
    vec![range; 2]
}

/// An example of frames of the two joints; `end_s`: a path of so many seconds, else a cycle.
fn example(frames: &[[f64; 2]], amplitude: f64, frequency_hz: f64, end_s: Option<f64>) -> Example {
    let kind = if end_s.is_some() { "path" } else { "cycle" };
    let json = serde_json::json!({
        "handwave": "clip", "version": 1, "name": "made up", "kind": kind, "joints": joints(),
        "frequency_hz": frequency_hz, "duration_s": end_s.unwrap_or(0.0), "frames": frames,
    });
    let clip = ClipFile::from_json(&json.to_string()).expect("a clip");
    Example {
        clip: clip.for_body(&joints()).expect("its joints"),
        parameters: Parameters::from([amplitude, frequency_hz]),
    }
}

/// A class that goes from zero to `end` with its gesture, or by the clock.
fn path(name: &str, end: [f64; 2], options: ClassOptions) -> MotionClass {
    let frames: Vec<[f64; 2]> = (0..=8)
        .map(|k| end.map(|v| v * f64::from(k) / 8.0))
        .collect();
    let examples = vec![example(&frames, 1.0, 0.0, Some(1.0))];
    MotionClass::new(name, examples, ranges(), options).expect("a class")
}

/// A class whose joints swing by `size`, standing at zero.
fn cycle(name: &str, size: [f64; 2], options: ClassOptions) -> MotionClass {
    let wave = |k: i32| size.map(|v| v * (TAU * f64::from(k) / 16.0).sin());
    let frames: Vec<[f64; 2]> = (0..16).map(wave).collect();
    let examples = vec![
        example(&[[0.0; 2]; 8], 0.0, 1.0, None),
        example(&frames, 1.0, 1.0, None),
    ];
    MotionClass::new(name, examples, ranges(), options).expect("a class")
}

fn all_edges(nodes: usize) -> Vec<(usize, usize, f64)> {
    (0..nodes)
        .flat_map(|a| {
            (0..nodes)
                .filter(move |b| *b != a)
                .map(move |b| (a, b, 1.0))
        })
        .collect()
}

/// An animator whose raw poses are held against the joints' limits.
struct Bench {
    animator: Animator,
    watch: LimitWatch,
    gestures: Vec<(f64, f64)>,
    drives: Vec<Drive>,
    pose: Vec<f64>,
    t_s: f64,
}

impl Bench {
    fn new(classes: Vec<MotionClass>, edges: &[(usize, usize, f64)]) -> Self {
        let n = classes.len();
        let graph = Graph::new(n, 0, edges, GraphOptions::default());
        let space = Box::new(JointSpace::fixed(&joints()));
        let nodes = classes.into_iter().map(Into::into).collect();
        let limit = JointEnvelope {
            lower: -3.0,
            upper: 3.0,
            velocity: SPEED,
            acceleration: ACCELERATION,
            jerk: f64::INFINITY,
        };
        Self {
            animator: Animator::new(space, nodes, graph, Vec::new(), &ranges()),
            watch: LimitWatch::new(&[limit, limit], DT_S),
            gestures: vec![(0.0, 1.0); n],
            drives: vec![Drive::default(); n],
            pose: vec![0.0; 2],
            t_s: 0.0,
        }
    }

    /// Performs for `seconds`: per class the amplitude that its gesture goes to, and its frequency.
    #[track_caller]
    fn perform(&mut self, gestures: &[(f64, f64)], seconds: f64) {
        self.perform_watched(gestures, seconds, |_| {});
    }

    #[track_caller]
    fn perform_watched(
        &mut self,
        gestures: &[(f64, f64)],
        seconds: f64,
        mut watch: impl FnMut(&Self),
    ) {
        self.gestures.copy_from_slice(gestures);
        for _ in 0..(seconds / DT_S).round() as usize {
            self.step(DT_S);
            self.watch.see(&self.pose).unwrap_or_else(|e| {
                panic!("at {:.3} s, {:?}: {e}", self.t_s, self.animator.counts())
            });
            watch(self);
        }
    }

    fn step(&mut self, dt_s: f64) {
        self.t_s += dt_s;
        for (drive, (amplitude, frequency_hz)) in self.drives.iter_mut().zip(&self.gestures) {
            // An estimator follows within a tenth of a second.
            drive.amplitude += (amplitude - drive.amplitude) * (dt_s / 0.1);
            drive.frequency_hz = *frequency_hz;
            drive.phase_rad = (TAU * frequency_hz * self.t_s).rem_euclid(TAU);
        }
        let input = LayerInput::default();
        self.animator
            .step(&self.drives, &input, dt_s, &mut self.pose);
    }
}

#[test]
fn a_blend_between_far_poses_takes_as_long_as_the_joints_need() {
    let classes = vec![
        path("rest", [0.0; 2], ClassOptions::default()),
        path("left", [1.4, -1.0], ClassOptions::default()),
        path("right", [-1.4, 1.0], ClassOptions::default()),
    ];
    let mut bench = Bench::new(classes, &all_edges(3));
    // Both paths are at 0.9 of their way, so that the blend alone moves the joints.
    bench.perform(&[(0.0, 0.0), (0.9, 0.0), (0.85, 0.0)], 4.0);
    assert_eq!(bench.animator.active(), 1, "left is performed");
    bench.watch.speed = Default::default();
    bench.watch.acceleration = Default::default();
    let began = bench.t_s;
    let mut arrived = None;
    bench.perform_watched(&[(0.0, 0.0), (0.84, 0.0), (0.86, 0.0)], 3.0, |b| {
        if b.animator.transition().is_some_and(|(_, w)| w >= 1.0) {
            arrived.get_or_insert(b.t_s);
        }
    });
    let took = arrived.expect("the blend ends") - began;
    let extremes = bench.watch.extremes();
    println!("2.4 rad in {took:.2} s: {extremes}");
    assert!(took > 0.9, "2.4 rad in {took:.2} s");
    assert!(bench.watch.speed.share < 0.45, "{extremes}");
    assert!(bench.watch.acceleration.share < 0.45, "{extremes}");
}

/// Two paths far apart and a cycle to start from.
fn trio() -> Bench {
    let classes = vec![
        cycle("swing", [0.5, 0.4], ClassOptions::default()),
        path("left", [1.2, -1.0], ClassOptions::default()),
        path("right", [-1.2, 1.0], ClassOptions::default()),
    ];
    Bench::new(classes, &all_edges(3))
}

#[test]
fn a_transition_given_up_half_way_and_asked_for_again_keeps_the_limits() {
    let mut bench = trio();
    for pause in 1..40 {
        bench.perform(&[(0.5, 1.2), (1.0, 0.0), (0.0, 0.0)], 0.3);
        bench.perform(
            &[(0.5, 1.2), (0.0, 0.0), (0.0, 0.0)],
            0.2 + 0.02 * f64::from(pause),
        );
    }
    let counts = bench.animator.counts();
    println!("{counts:?}; {}", bench.watch.extremes());
    assert!(counts.aborted > 5, "{counts:?}");
}

#[test]
fn gestures_that_alternate_five_times_a_second_for_a_minute_keep_the_limits() {
    let mut bench = trio();
    bench.perform(&[(1.0, 1.2), (0.0, 0.0), (0.0, 0.0)], 2.0);
    for k in 0..300 {
        let on = |node: usize| if k % 3 == node { 1.0 } else { 0.0 };
        bench.perform(&[(on(0), 1.2), (on(1), 0.0), (on(2), 0.0)], 0.2);
    }
    println!("{:?}; {}", bench.animator.counts(), bench.watch.extremes());
    for k in 0..150 {
        let on = |node: usize| if k % 2 == node % 2 { 1.0 } else { 0.0 };
        bench.perform(&[(0.0, 1.2), (on(1), 0.0), (on(2), 0.0)], 0.4);
    }
    println!("{:?}; {}", bench.animator.counts(), bench.watch.extremes());
}

#[test]
fn an_interruption_by_a_moving_class_steps_neither_place_nor_speed_and_fades() {
    let swing = |name, size| cycle(name, size, ClassOptions::default());
    let classes = || {
        vec![
            swing("swing", [0.5, 0.4]),
            path("left", [0.8, -0.8], ClassOptions::default()),
            swing("sway", [-0.6, 0.5]),
        ]
    };
    let mut steepest: f64 = 0.0;
    // At many phases of the two cycles.
    for k in 0..20 {
        let mut bench = Bench::new(classes(), &all_edges(3));
        bench.perform(
            &[(1.0, 1.0), (0.0, 0.0), (0.15, 1.0)],
            3.0 + 0.05 * f64::from(k),
        );
        bench.perform(&[(0.0, 1.0), (1.0, 0.0), (0.15, 1.0)], 0.2);
        bench.watch.acceleration = Default::default();
        bench.perform(&[(0.0, 1.0), (0.0, 0.0), (1.0, 1.0)], 3.0);
        let counts = bench.animator.counts();
        assert_eq!(
            (bench.animator.active(), counts.interrupted),
            (2, 1),
            "{counts:?}"
        );
        steepest = steepest.max(bench.watch.acceleration.value);
        // The difference is gone: what shows is the class itself.
        let own = bench.animator.played()[2];
        let swing = own.stride * own.phase_rad.sin();
        let off = (bench.pose[0] + 0.6 * swing)
            .abs()
            .max((bench.pose[1] - 0.5 * swing).abs());
        assert!(off < 2e-3, "{off} rad off the class after 3 s");
    }
    println!("acceleration at most {steepest:.1} rad/s^2 of {ACCELERATION}");
    assert!(
        steepest < 0.75 * ACCELERATION,
        "acceleration {steepest:.1} rad/s^2"
    );
}

fn once(leave: Vec<[f64; 2]>) -> ClassOptions {
    ClassOptions {
        play: Play::Once,
        leave,
        ..ClassOptions::default()
    }
}

/// A start class, a class that plays once (a second long) and another one.
fn with_once(leave: Vec<[f64; 2]>) -> Bench {
    let classes = vec![
        path("rest", [0.0; 2], ClassOptions::default()),
        path("wave", [0.3, 0.2], once(leave)),
        path("other", [-0.5, 0.4], ClassOptions::default()),
    ];
    Bench::new(classes, &all_edges(3))
}

#[test]
fn a_class_that_plays_once_plays_to_its_end_and_anew_only_after_a_release() {
    let mut bench = with_once(Vec::new());
    let mut furthest: f64 = 0.0;
    let mut plays = 0;
    let mut was = 0.0;
    let mut watch = |b: &Bench| {
        let progress = b.animator.played()[1].phase_rad / TAU;
        furthest = furthest.max(progress);
        plays += u32::from(was < 0.5 && progress >= 0.5);
        was = progress;
    };
    // A short gesture is enough.
    bench.perform_watched(&[(0.0, 0.0), (1.0, 0.0), (0.0, 0.0)], 0.3, &mut watch);
    bench.perform_watched(&[(0.0, 0.0), (0.0, 0.0), (0.0, 0.0)], 3.0, &mut watch);
    assert_eq!(bench.animator.active(), 0, "it returns");
    // Held for long it plays once.
    bench.perform_watched(&[(0.0, 0.0), (1.0, 0.0), (0.0, 0.0)], 8.0, &mut watch);
    assert_eq!(
        bench.animator.active(),
        0,
        "it returns while the gesture is held"
    );
    // Released and performed again on the way back, it plays again.
    bench.perform_watched(&[(0.0, 0.0), (0.0, 0.0), (0.0, 0.0)], 0.4, &mut watch);
    bench.perform_watched(&[(0.0, 0.0), (1.0, 0.0), (0.0, 0.0)], 1.4, &mut watch);
    assert!(
        bench
            .animator
            .transition()
            .is_some_and(|(t, _)| t.from == 1),
        "on its way back"
    );
    bench.perform_watched(&[(0.0, 0.0), (0.0, 0.0), (0.0, 0.0)], 0.25, &mut watch);
    bench.perform_watched(&[(0.0, 0.0), (1.0, 0.0), (0.0, 0.0)], 4.0, &mut watch);
    println!("furthest {furthest:.3}, {plays} plays");
    assert!(furthest >= 1.0, "ends at {furthest}");
    assert_eq!(plays, 4, "plays");
    assert_eq!(bench.animator.active(), 0);
}

#[test]
fn a_wish_during_a_once_class_waits_and_the_latest_counts() {
    let mut bench = with_once(Vec::new());
    bench.perform(&[(0.0, 0.0), (1.0, 0.0), (0.0, 0.0)], 0.6);
    let mut left_at = None;
    let mut watch = |b: &Bench| {
        if b.animator.transition().is_some_and(|(t, _)| t.from == 1) {
            left_at.get_or_insert(b.animator.played()[1].phase_rad / TAU);
        }
    };
    bench.perform_watched(&[(0.9, 0.0), (0.0, 0.0), (0.0, 0.0)], 0.3, &mut watch);
    bench.perform_watched(&[(0.0, 0.0), (0.0, 0.0), (0.9, 0.0)], 2.5, &mut watch);
    assert_eq!(bench.animator.active(), 2, "{:?}", bench.animator.counts());
    assert_eq!(left_at, Some(1.0), "left at");
}

#[test]
fn a_once_class_gives_way_in_its_window_and_does_not_begin_again_while_held() {
    let mut bench = with_once(vec![[0.5, 0.7]]);
    bench.perform(&[(0.0, 0.0), (0.6, 0.0), (0.0, 0.0)], 0.35);
    let mut left_at = None;
    let mut watch = |b: &Bench| {
        if b.animator.transition().is_some_and(|(t, _)| t.from == 1) {
            left_at.get_or_insert(b.animator.played()[1].phase_rad / TAU);
        }
    };
    bench.perform_watched(&[(0.0, 0.0), (0.6, 0.0), (0.9, 0.0)], 0.25, &mut watch);
    bench.perform_watched(&[(0.0, 0.0), (0.15, 0.0), (0.9, 0.0)], 1.5, &mut watch);
    let at = left_at.expect("it is left");
    println!("left at {at:.3}");
    assert!((0.5..=0.71).contains(&at), "left at {at}");
    assert_eq!(bench.animator.active(), 2);
}

#[test]
fn a_cycle_is_left_in_its_window_over_the_seam_and_at_once_when_it_stands_still() {
    let options = ClassOptions {
        leave: vec![[0.9, 0.1]],
        ..ClassOptions::default()
    };
    for k in 0..10 {
        let classes = vec![
            cycle("swing", [0.5, 0.4], options.clone()),
            path("left", [0.4, -0.4], ClassOptions::default()),
        ];
        let mut bench = Bench::new(classes, &all_edges(2));
        bench.perform(&[(0.0, 1.0), (1.0, 0.0)], 0.1);
        assert!(
            bench.animator.transition().is_some(),
            "standing still it waits"
        );
        bench.perform(&[(0.0, 1.0), (0.0, 0.0)], 2.0);
        bench.perform(&[(0.5, 1.0), (0.0, 0.0)], 2.0 + 0.1 * f64::from(k));
        let mut left_at = None;
        bench.perform_watched(&[(0.5, 1.0), (1.0, 0.0)], 2.0, |b| {
            if b.animator.transition().is_some() {
                left_at.get_or_insert(b.animator.played()[0].phase_rad / TAU);
            }
        });
        let at = left_at.expect("it is left");
        assert!(!(0.12..0.9).contains(&at), "left at {at}");
    }
}

#[test]
fn a_way_leads_through_a_class_and_one_that_cannot_be_reached_is_left_alone() {
    let make = |name, end| path(name, end, ClassOptions::default());
    let classes = vec![
        make("rest", [0.0; 2]),
        make("between", [0.6, 0.0]),
        make("far", [1.2, 0.0]),
        make("island", [-1.0, 0.0]),
    ];
    let edges = [
        (0, 1, 1.0),
        (1, 0, 1.0),
        (1, 2, 1.0),
        (2, 1, 1.0),
        (3, 0, 1.0),
    ];
    let mut bench = Bench::new(classes, &edges);
    let g = |a: f64, b: f64, c: f64| [(0.0, 0.0), (a, 0.0), (b, 0.0), (c, 0.0)];
    bench.perform(&g(0.0, 0.0, 1.0), 2.0);
    assert_eq!(
        (bench.animator.active(), bench.animator.counts().completed),
        (0, 0)
    );
    bench.perform(&g(0.0, 1.0, 0.0), 2.5);
    assert_eq!(
        (bench.animator.active(), bench.animator.counts().completed),
        (2, 2)
    );
    // The class between is given up for one beyond it: the way goes on.
    let mut bench = {
        bench.perform(&g(0.0, 0.0, 0.0), 5.0);
        bench
    };
    assert_eq!(bench.animator.active(), 0);
    bench.perform(&g(1.0, 0.0, 0.0), 0.3);
    bench.perform(&g(0.0, 1.0, 0.0), 3.0);
    let counts = bench.animator.counts();
    assert_eq!(
        (bench.animator.active(), counts.interrupted),
        (2, 0),
        "{counts:?}"
    );
}

#[test]
fn an_interruption_whose_way_leads_back_through_the_source_does_not_jump() {
    // A star: the start class is in the middle.
    let star = [(0, 1, 1.0), (1, 0, 1.0), (0, 2, 1.0), (2, 0, 1.0)];
    for k in 0..12 {
        let classes = vec![
            path("rest", [0.0; 2], ClassOptions::default()),
            path("left", [0.8, 0.0], ClassOptions::default()),
            path("right", [-0.8, 0.0], ClassOptions::default()),
        ];
        let mut bench = Bench::new(classes, &star);
        let shown_s = 0.2 + 0.04 * f64::from(k);
        bench.perform(&[(0.0, 0.0), (1.0, 0.0), (0.0, 0.0)], shown_s);
        bench.perform(&[(0.0, 0.0), (0.0, 0.0), (1.0, 0.0)], 3.0);
        assert_eq!(bench.animator.active(), 2, "{:?}", bench.animator.counts());
    }
}

#[test]
fn held_time_and_drives_that_are_no_numbers_change_nothing() {
    let mut bench = trio();
    bench.perform(&[(1.0, 1.2), (0.0, 0.0), (0.0, 0.0)], 2.0);
    bench.perform(&[(0.0, 1.2), (1.0, 0.0), (0.0, 0.0)], 0.3);
    let (pose, counts) = (bench.pose.clone(), bench.animator.counts());
    for _ in 0..50 {
        bench.step(0.0);
    }
    let off = (pose[0] - bench.pose[0])
        .abs()
        .max((pose[1] - bench.pose[1]).abs());
    assert!(off < 1e-12, "the pose moves by {off} rad while time stands");
    assert_eq!(counts, bench.animator.counts());
    bench.perform(&[(0.0, 1.2), (1.0, 0.0), (0.0, 0.0)], 1.5);
    assert_eq!(bench.animator.active(), 1);
    for k in 0..400 {
        let nan = Drive {
            amplitude: f64::NAN,
            frequency_hz: f64::NAN,
            phase_rad: f64::NAN,
            extra: [f64::NAN; 2],
        };
        let drives = [nan; 3];
        bench
            .animator
            .step(&drives, &LayerInput::default(), DT_S, &mut bench.pose);
        assert!(bench.pose.iter().all(|v| v.is_finite()), "step {k}");
        bench
            .watch
            .see(&bench.pose)
            .unwrap_or_else(|e| panic!("{e}"));
    }
    assert_eq!(bench.animator.active(), 0, "nothing is performed");
}
