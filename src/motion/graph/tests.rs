//! Transitions of the graph by themselves: thresholds, aborts, routes, windows, interruptions.

use super::*;

const DT: f64 = 0.005;

fn graph() -> Graph {
    Graph::new(2, 0, &[(0, 1, 1.0), (1, 0, 1.0)], GraphOptions::default())
}

fn blend(_: usize, _: usize) -> Plan {
    Plan::Blend { span_s: 0.0 }
}

fn run<const N: usize>(graph: &mut Graph, activation: [f64; N], seconds: f64) -> Vec<Event> {
    let asks = activation.map(Ask::with);
    (0..(seconds / DT).round() as usize)
        .map(|_| graph.step(&asks, DT, &mut blend))
        .filter(|e| *e != Event::None)
        .collect()
}

#[test]
fn a_transition_starts_above_the_threshold_and_takes_half_a_second() {
    let mut g = graph();
    run(&mut g, [0.0, 0.19], 1.0);
    assert_eq!((g.active(), g.transition()), (0, None));
    run(&mut g, [0.0, 0.21], 0.45);
    assert!(g.transition().is_some_and(|t| t.to == 1));
    assert!(g.blend() > 0.9, "blend {}", g.blend());
    run(&mut g, [0.0, 0.21], 0.1);
    assert_eq!((g.active(), g.transition()), (1, None));
    assert_eq!(g.counts().completed, 1);
}

#[test]
fn it_waits_for_the_source_and_is_aborted_when_the_target_sinks() {
    let mut g = graph();
    run(&mut g, [0.3, 0.8], 2.0);
    assert_eq!(g.active(), 0, "the source gesture is still performed");
    assert!((g.blend() - 1.0).abs() < 1e-9, "blend {}", g.blend());
    run(&mut g, [0.3, 0.05], 0.8);
    assert_eq!((g.active(), g.transition()), (0, None));
    assert_eq!(g.counts().aborted, 1);
}

#[test]
fn a_blend_that_turns_round_has_no_step_in_its_speed() {
    let mut g = graph();
    run(&mut g, [0.0, 0.8], 0.25);
    let (mut last, mut speed) = (g.blend(), None::<f64>);
    let mut steepest: f64 = 0.0;
    for _ in 0..100 {
        run(&mut g, [0.0, 0.05], DT);
        let now = (g.blend() - last) / DT;
        last = g.blend();
        steepest = steepest.max(speed.map_or(0.0, |s| (now - s).abs()));
        speed = Some(now);
    }
    // Turning at once would be a step of twice the peak slope, 7.5 per second.
    assert!(
        steepest < 0.6,
        "the blend's speed steps by {steepest:.3} /s"
    );
    assert_eq!(g.counts().aborted, 1);
}

#[test]
fn with_nothing_performed_the_start_class_comes_back() {
    let mut g = graph();
    run(&mut g, [0.0, 1.0], 1.0);
    assert_eq!(g.active(), 1);
    run(&mut g, [0.0, 0.0], 1.7);
    assert_eq!(g.active(), 0);
    run(&mut g, [f64::NAN, f64::NAN], 3.0);
    assert_eq!(g.active(), 0, "not-a-number must not activate anything");
}

/// Classes in a row: 0 - 1 - 2.
fn row() -> Graph {
    let edges = [(0, 1, 1.0), (1, 0, 1.0), (1, 2, 1.0), (2, 1, 1.0)];
    Graph::new(3, 0, &edges, GraphOptions::default())
}

#[test]
fn a_class_without_an_edge_is_reached_through_another() {
    let mut g = row();
    let begun = run(&mut g, [0.0, 0.0, 0.9], 1.2);
    assert_eq!(begun, [Event::Began { to: 1 }, Event::Began { to: 2 }]);
    assert_eq!(g.active(), 2);
    // And back to the start by itself.
    run(&mut g, [0.0; 3], 2.5);
    assert_eq!(g.active(), 0);
}

#[test]
fn a_wish_waits_until_the_class_may_be_left() {
    let mut g = graph();
    let mut asks = [Ask::with(0.0), Ask::with(0.9)];
    asks[0].may_leave = false;
    for _ in 0..100 {
        assert_eq!(g.step(&asks, DT, &mut blend), Event::None);
    }
    assert_eq!(g.queued(), Some(1));
    asks[0].may_leave = true;
    assert_eq!(g.step(&asks, DT, &mut blend), Event::Began { to: 1 });
}

#[test]
fn a_third_class_interrupts_a_transition_that_is_given_up() {
    let edges: Vec<_> = (0..3)
        .flat_map(|a| (0..3).filter(move |b| *b != a).map(move |b| (a, b, 1.0)))
        .collect();
    let mut g = Graph::new(3, 0, &edges, GraphOptions::default());
    run(&mut g, [0.0, 0.9, 0.0], 0.3);
    let events = run(&mut g, [0.0, 0.02, 0.8], 0.02);
    assert_eq!(events, [Event::Jumped { to: 2 }]);
    assert_eq!((g.active(), g.counts().interrupted), (2, 1));
}

#[test]
fn a_planned_jump_waits_and_is_forgotten_when_given_up() {
    let mut g = graph();
    let mut plan = |_: usize, _: usize| Plan::Jump { wait_s: 0.2 };
    let asks = [0.0, 0.9].map(Ask::with);
    let mut jumped_at = None;
    for k in 0..100 {
        if g.step(&asks, DT, &mut plan) == (Event::Jumped { to: 1 }) {
            jumped_at = Some(f64::from(k) * DT);
        }
    }
    let at = jumped_at.expect("a jump");
    assert!((at - 0.2).abs() < 2.0 * DT, "jumped after {at} s");
    let mut g = graph();
    for _ in 0..10 {
        g.step(&asks, DT, &mut plan);
    }
    for _ in 0..100 {
        g.step(&[0.0, 0.0].map(Ask::with), DT, &mut plan);
    }
    assert_eq!((g.active(), g.counts().aborted), (0, 1));
}

#[test]
fn a_refused_transition_leaves_the_class_and_is_tried_again() {
    let mut g = graph();
    let mut tries = 0;
    for _ in 0..100 {
        let mut plan = |_: usize, _: usize| {
            tries += 1;
            Plan::Refuse
        };
        g.step(&[0.0, 0.9].map(Ask::with), DT, &mut plan);
    }
    assert_eq!(g.active(), 0);
    assert!((3..=6).contains(&tries), "{tries} plans in half a second");
}
