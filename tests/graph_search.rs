//! The transition search: what it refuses, the lemma it rests on, and that it loses nothing.

mod search_support;
mod support;

use handwave::base::random::SplitMix;
use handwave::motion::search::{
    ClassSpec, ClipFeatures, DistanceTables, FeatureError, Form, Found, Hat, NoTransition,
    OptionsError, Search, SearchClass, SearchOptions, State, StoredTransitions, Synthesis, Target,
    calibrate, calibrate::random_requests,
};
use search_support::{class, motion, over, search, state, tenths};
use std::f64::consts::PI;
use std::sync::Arc;
use support::counting::{Counting, allocations};

#[global_allocator]
static COUNTING: Counting = Counting;

fn clip<'a>(positions: &'a [f64], width: usize) -> ClipFeatures<'a> {
    ClipFeatures {
        name: "clip",
        duration_s: 1.0,
        width,
        positions,
        root: &[],
        penalty: &[],
    }
}

fn one(spec: &ClassSpec, clip: ClipFeatures<'_>) -> Result<SearchClass, FeatureError> {
    SearchClass::new(spec, &[clip], Arc::new(Hat::corners(0)))
}

#[test]
fn features_that_cannot_be_compared_are_refused() {
    let spec = ClassSpec::new("bad", true, 1);
    let short = one(&spec, clip(&[0.0], 1)).expect_err("one frame has no velocity");
    assert!(
        matches!(short, FeatureError::TooShort { found: 1, .. }),
        "{short}"
    );
    for value in [f64::NAN, f64::INFINITY] {
        let error = one(&spec, clip(&[0.0, 1.0, value], 1)).expect_err("not finite");
        assert!(
            matches!(error, FeatureError::Number { frame: 2, .. }),
            "{error}"
        );
    }
    let ragged = one(&spec, clip(&[0.0, 1.0, 2.0], 2)).expect_err("one and a half frames");
    assert!(
        matches!(
            ragged,
            FeatureError::Size {
                found: 3,
                expected: 4,
                ..
            }
        ),
        "{ragged}"
    );
    let timeless = ClipFeatures {
        duration_s: 0.0,
        ..clip(&[0.0, 1.0], 1)
    };
    let error = one(&spec, timeless).expect_err("no duration");
    assert!(error.to_string().contains("duration_s"), "{error}");
    let none = SearchClass::new(&spec, &[], Arc::new(Hat::corners(1))).expect_err("no clips");
    assert!(
        matches!(
            none,
            FeatureError::Count {
                found: 0,
                expected: 2,
                ..
            }
        ),
        "{none}"
    );
    let wild = ClassSpec {
        lambda_v: f64::NAN,
        ..spec.clone()
    };
    let error = one(&wild, clip(&[0.0, 1.0], 1)).expect_err("lambda_v");
    assert!(
        matches!(
            error,
            FeatureError::Spec {
                what: "lambda_v",
                ..
            }
        ),
        "{error}"
    );
    let narrow = one(&spec, clip(&[0.0, 1.0], 1)).expect("good");
    let wide = one(&spec, clip(&[0.0, 1.0, 0.0, 1.0], 2)).expect("good");
    let error = DistanceTables::new(&narrow, &wide).expect_err("other features");
    assert!(
        matches!(
            error,
            FeatureError::Unlike {
                what: "features",
                ..
            }
        ),
        "{error}"
    );
}

#[test]
fn options_out_of_range_and_trellises_beyond_memory_are_refused() {
    let source = Arc::new(class(1, "a", 4, true, 2));
    let tables = Arc::new(DistanceTables::new(&source, &source).expect("same"));
    let made = |options| Search::new(source.clone(), source.clone(), tables.clone(), options);
    let wild = SearchOptions {
        delta_t: 0.0,
        ..SearchOptions::default()
    };
    let error = made(wild).expect_err("no step");
    assert!(
        matches!(
            error,
            OptionsError::Range {
                what: "delta_t",
                ..
            }
        ),
        "{error}"
    );
    let fine = SearchOptions {
        delta_w: 0.01,
        ..SearchOptions::default()
    };
    let error = made(fine).expect_err("1e8 nodes");
    assert!(matches!(error, OptionsError::TooLarge { .. }), "{error}");
}

#[test]
fn equal_poses_have_similarity_1_and_any_state_can_be_asked() {
    let still = vec![0.3; 20];
    let spec = ClassSpec::new("still", true, 2);
    let still = Arc::new(one(&spec, clip(&still, 2)).expect("good"));
    let tables = DistanceTables::new(&still, &still).expect("same");
    assert_eq!(tables.d_max(), 0.0);
    let mut search = over(&still, &still, SearchOptions::default());
    let odd = State::new(f64::NAN, &[f64::INFINITY]);
    let found = search
        .find(&odd, &Target::State(State::new(-7.3, &[])))
        .expect("equal poses");
    assert_eq!(found.similarity, 1.0);
    assert_ne!(found.depths, (0, 0), "a loop must move");
}

/// Random weights that sum to one; convex, or with one negative.
fn weights(random: &mut SplitMix, n: usize, negative: bool) -> Vec<f64> {
    let mut w: Vec<f64> = (0..n).map(|_| random.unit()).collect();
    if negative {
        w[0] = -0.5 * random.unit();
    }
    let sum: f64 = w.iter().sum();
    w.iter_mut().for_each(|w| *w /= sum);
    w
}

/// Features of a blend, from those at frames.
fn blended(class: &SearchClass, t: f64, w: &[f64]) -> Vec<f64> {
    let at = t * class.frames() as f64;
    let (k, part) = (at.floor() as usize, at.fract());
    let next = (k + 1) % class.frames();
    let mut out = vec![0.0; class.width()];
    for (i, w) in w.iter().enumerate() {
        let (a, b) = (class.feature(i, k), class.feature(i, next));
        for ((out, a), b) in out.iter_mut().zip(a).zip(b) {
            *out += w * ((1.0 - part) * a + part * b);
        }
    }
    out
}

#[test]
fn the_bound_holds_for_convex_weights_and_the_exact_form_for_all() {
    // Clips of about 0.2 m, velocities of the same size: distances up to some 0.2 m^2.
    let (a, b) = (class(1, "a", 2, true, 3), class(2, "b", 1, true, 3));
    let tables = DistanceTables::new(&a, &b).expect("same features");
    let mut random = SplitMix::new(4);
    let (mut over_bound, mut off): (f64, f64) = (f64::NEG_INFINITY, 0.0);
    let mut broken = 0;
    for trial in 0..100_000 {
        let negative = trial % 10 == 9;
        let (w, v) = (
            weights(&mut random, 4, negative),
            weights(&mut random, 2, false),
        );
        let (t, u) = (random.unit(), random.unit());
        let of = |form| tables.distance_of_weights(&a, &b, (t, &w), (u, &v), form);
        let (exact, bound) = (of(Form::Exact), of(Form::Bound));
        let (x, y) = (blended(&a, t, &w), blended(&b, u, &v));
        let brute: f64 = x.iter().zip(&y).map(|(x, y)| (x - y) * (x - y)).sum();
        off = off.max((exact - brute).abs());
        if negative {
            broken += usize::from(exact > bound + 1e-9);
        } else {
            over_bound = over_bound.max(exact - bound);
        }
    }
    assert!(
        over_bound <= 1e-12,
        "exact exceeds the bound by {over_bound:e} m^2"
    );
    assert!(off < 1e-10, "exact form off by {off:e} m^2");
    assert!(
        broken > 100,
        "with a negative weight the bound must be seen to fail: {broken} of 10000"
    );
}

/// A boom that swings in a plane; its parameter bends it by up to 90 degrees, along an arc.
struct Boom {
    length: f64,
    mount: f64,
}

impl Synthesis for Boom {
    fn width(&self) -> usize {
        2
    }

    fn duration_s(&self, _: &[f64]) -> f64 {
        1.0
    }

    fn features(&self, p: &[f64], t: f64, out: &mut [f64]) {
        let angle = 0.5 * PI * p[0] + 0.3 * (2.0 * PI * t).sin();
        out[0] = self.length * angle.cos() + self.mount;
        out[1] = self.length * angle.sin() + self.mount;
    }
}

#[test]
fn in_between_references_bring_the_similarity_to_that_of_curved_blends() {
    // The source's boom is 0.5 m long, the target's 0.2 m and mounted elsewhere.
    let spec = ClassSpec {
        frames: 20,
        ..ClassSpec::new("boom", true, 1)
    };
    let class = |steps: usize, length: f64, mount: f64| {
        SearchClass::subdivided(&spec, 1, steps, &Boom { length, mount }).expect("good")
    };
    // The truth: so many references that nothing is left to interpolate.
    let (fine_a, fine_b) = (class(16, 0.5, 0.0), class(16, 0.2, 0.4));
    let fine = DistanceTables::new(&fine_a, &fine_b).expect("same features");
    for form in [Form::Exact, Form::Bound] {
        let mut errors = Vec::new();
        for steps in [1, 2, 4] {
            let (a, b) = (class(steps, 0.5, 0.0), class(steps, 0.2, 0.4));
            let tables = DistanceTables::new(&a, &b).expect("same features");
            let mut random = SplitMix::new(9);
            let (mut worst, mut sum): (f64, f64) = (0.0, 0.0);
            for _ in 0..500 {
                let (from, to) = (tenths(&mut random), tenths(&mut random));
                // The parameters off the references.
                let shift = |s: State| State::new(s.t, &[s.parameters[0] + 0.05]);
                let (from, to) = (shift(from), shift(to));
                let here = tables.distance(&a, &b, &from, &to, form);
                let there = fine.distance(&fine_a, &fine_b, &from, &to, Form::Exact);
                let error = (here - there).abs() / fine.d_max();
                worst = worst.max(error);
                sum += error;
            }
            errors.push((worst, sum / 500.0));
        }
        println!("{form:?}: worst and mean error of the similarity {errors:.4?}");
        let [zero, one, two] = [errors[0], errors[1], errors[2]];
        for (zero, one, two) in [(zero.0, one.0, two.0), (zero.1, one.1, two.1)] {
            assert!(
                one < 0.4 * zero && two < 0.12 * zero,
                "{form:?}: {errors:?}"
            );
        }
    }
}

fn close(a: &Found, b: &Found) -> bool {
    let (a, b) = (a.cost.total(), b.cost.total());
    (a - b).abs() <= 1e-9 * b.abs().max(1.0)
}

/// Random requests on random classes: the search must cost what all pairs cost.
fn compare(parameters: usize, l_max: usize, requests: usize) {
    let mut random = SplitMix::new(31 + parameters as u64);
    let mut asked = 0;
    for (open, form, s_min, mu) in [
        (false, Form::Exact, 0.0, 0.0),
        (true, Form::Exact, 0.9, 0.0),
        (false, Form::Bound, 0.0, 0.0),
        (true, Form::Bound, 0.85, 40.0),
    ] {
        for kappa in [300.0, 5000.0] {
            let options = SearchOptions {
                l_max,
                kappa,
                form,
                s_min,
                mu,
                max_latency_s: (s_min > 0.0).then_some(0.7),
                ..SearchOptions::default()
            };
            let mut search = search(parameters, open, 2, options);
            for _ in 0..requests.div_ceil(8) {
                let (from, to) = (state(&mut random), state(&mut random));
                let targets = [
                    Target::State(to),
                    Target::Entry {
                        parameters: to.parameters,
                        between: [0.0, 0.6],
                    },
                ];
                let target = targets[usize::from(asked % 8 == 7)];
                let fast = search.find(&from, &target);
                let all = search.exhaustive(&from, &target);
                asked += 1;
                match (&fast, &all) {
                    (Ok(fast), Ok(all)) => assert!(
                        close(fast, all),
                        "P={parameters}, {options:?}, {from:?} to {target:?}: {fast:?}, all pairs {all:?}"
                    ),
                    (Err(fast), Err(all)) => assert!(
                        (fast.best_similarity - all.best_similarity).abs() < 1e-9,
                        "{fast:?}, all pairs {all:?}"
                    ),
                    _ => panic!("{fast:?}, all pairs {all:?}"),
                }
            }
        }
    }
    println!("P={parameters}, depth {l_max}: {asked} requests");
}

#[test]
fn the_search_finds_what_all_pairs_find_with_one_parameter() {
    compare(1, 8, 1000);
}

#[test]
fn the_search_finds_what_all_pairs_find_with_two_parameters() {
    compare(2, 3, 1000);
    compare(2, 8, 8);
}

#[test]
fn the_search_finds_what_all_pairs_find_with_three_and_four_parameters() {
    compare(3, 3, 16);
    compare(4, 2, 8);
    compare(0, 10, 100);
}

#[test]
fn a_deeper_trellis_never_costs_more_and_a_dearer_latency_never_lasts_longer() {
    let mut random = SplitMix::new(77);
    let requests: Vec<(State, State)> = (0..100)
        .map(|_| (state(&mut random), state(&mut random)))
        .collect();
    let kappa = 3000.0;
    let mut before = vec![f64::INFINITY; requests.len()];
    for l_max in [1, 3, 5, 8, 10, 12] {
        let options = SearchOptions {
            l_max,
            kappa,
            ..SearchOptions::default()
        };
        let mut search = search(2, false, 2, options);
        for ((from, to), before) in requests.iter().zip(&mut before) {
            let cost = search
                .find(from, &Target::State(*to))
                .expect("found")
                .cost
                .total();
            assert!(
                cost <= *before + 1e-9,
                "depth {l_max}: {cost}, less deep {before}"
            );
            *before = cost;
        }
    }
    let mut before = vec![f64::INFINITY; requests.len()];
    for lambda in [0.5, 2.0, 5.0, 10.0, 40.0] {
        let options = SearchOptions {
            lambda,
            kappa,
            ..SearchOptions::default()
        };
        let mut search = search(2, false, 2, options);
        for ((from, to), before) in requests.iter().zip(&mut before) {
            let found = search.find(from, &Target::State(*to)).expect("found");
            assert!(
                found.latency_s <= *before + 1e-9,
                "lambda {lambda}: {} s, cheaper latency {before} s",
                found.latency_s
            );
            *before = found.latency_s;
        }
    }
}

#[test]
fn routes_lead_from_the_present_over_the_jump_to_the_target_in_legal_steps() {
    let mut search = search(2, true, 3, SearchOptions::default());
    let mut random = SplitMix::new(5);
    for _ in 0..200 {
        let (from, to) = (state(&mut random), state(&mut random));
        let found = search.find(&from, &Target::State(to)).expect("found");
        let (first, second) = (
            search.source_route().to_vec(),
            search.target_route().to_vec(),
        );
        let params = |s: &State| s.parameters[..2].to_vec();
        let (start, end) = (first[0], second[second.len() - 1]);
        assert_eq!(
            (start.state.t, params(&start.state)),
            (from.t, params(&from))
        );
        assert_eq!((end.state.t, params(&end.state)), (to.t, params(&to)));
        assert_eq!(first[first.len() - 1].state, found.exit);
        assert_eq!(second[0].state, found.entry);
        assert_eq!((first.len() - 1, second.len() - 1), found.depths);
        assert_eq!(first[0].at_s, 0.0);
        assert!((second[0].at_s - found.exit_after_s).abs() < 1e-12);
        assert!((end.at_s - found.latency_s).abs() < 1e-12);
        for (route, class) in [(&first, search.source()), (&second, search.target())] {
            for pair in route.windows(2) {
                let mut w = vec![0.0; class.references()];
                class.weights(&pair[0].state, &mut w);
                let mut mean_s = 0.5 * class.duration_s(&w);
                class.weights(&pair[1].state, &mut w);
                mean_s += 0.5 * class.duration_s(&w);
                let mut step = pair[1].state.t - pair[0].state.t;
                if class.cyclic {
                    step = step.rem_euclid(1.0);
                }
                assert!(step > 0.0 && step < 0.1 + 1e-9, "step of {step}");
                let took = pair[1].at_s - pair[0].at_s;
                assert!((took - step * mean_s).abs() < 1e-12, "{took} s for {step}");
                for d in 0..2 {
                    let moved = pair[1].state.parameters[d] - pair[0].state.parameters[d];
                    assert!(moved.abs() < 0.1 + 1e-9, "parameter {d} moved {moved}");
                }
            }
        }
        let similarity = search.tables().similarity(
            search.source(),
            search.target(),
            &found.exit,
            &found.entry,
            Form::Exact,
        );
        assert!((similarity - found.similarity).abs() < 1e-9);
    }
}

#[test]
fn where_nothing_is_similar_or_soon_enough_the_best_there_is_is_told() {
    let strict = SearchOptions {
        s_min: 0.9999,
        ..SearchOptions::default()
    };
    let mut search = search(1, false, 4, strict);
    let target = Target::State(State::new(0.3, &[0.5]));
    let error = search
        .find(&State::default(), &target)
        .expect_err("classes differ");
    let NoTransition {
        best_similarity, ..
    } = error;
    assert!(best_similarity > 0.5 && best_similarity < 0.9999, "{error}");
    assert!(search.source_route().is_empty());
    let lax = SearchOptions {
        s_min: best_similarity - 1e-9,
        ..strict
    };
    search.set_weights(&lax).expect("good");
    let found = search
        .find(&State::default(), &target)
        .expect("as similar as was told");
    assert!(
        (found.similarity - best_similarity).abs() < 1e-9,
        "{found:?}"
    );
    let hasty = SearchOptions {
        max_latency_s: Some(found.latency_s - 1e-6),
        ..lax
    };
    search.set_weights(&hasty).expect("good");
    search
        .find(&State::default(), &target)
        .expect_err("no time for it");
}

#[test]
fn entering_anywhere_costs_no_more_than_any_state_and_a_loop_moves() {
    let mut random = SplitMix::new(6);
    let mut edge = search(1, true, 2, SearchOptions::default());
    for _ in 0..100 {
        let (from, to) = (state(&mut random), state(&mut random));
        let frame = (to.t * 19.0).round() / 19.0;
        let to = State { t: frame, ..to };
        let state = edge.find(&from, &Target::State(to)).expect("found");
        let free = Target::Entry {
            parameters: to.parameters,
            between: [0.0, 1.0],
        };
        let free = edge.find(&from, &free).expect("found");
        // A state that is entered directly is one of the free entries.
        if state.depths.1 == 0 {
            assert!(free.cost.total() <= state.cost.total() + 1e-9);
        }
        assert_eq!(free.latency_s, free.exit_after_s);
        assert_eq!(edge.target_route().len(), 1);
        let late = Target::Entry {
            parameters: to.parameters,
            between: [0.5, 0.8],
        };
        let late = edge.find(&from, &late).expect("found");
        assert!((0.5..=0.8).contains(&late.entry.t), "{}", late.entry.t);
    }
    let class = Arc::new(class(3, "walk", 1, true, 2));
    let mut turn = over(&class, &class, SearchOptions::default());
    let here = State::new(0.4, &[0.5]);
    let found = turn.find(&here, &Target::State(here)).expect("found");
    assert_ne!(found.depths, (0, 0), "{found:?}");
}

#[test]
fn moving_a_clip_rigidly_over_the_ground_changes_nothing() {
    let made = |place: Option<(f64, f64, f64)>| {
        let mut random = SplitMix::new(21);
        let built = |random: &mut SplitMix, place: Option<(f64, f64, f64)>| {
            let clips: Vec<(Vec<f64>, Vec<f64>)> = (0..2)
                .map(|_| {
                    let speed = 0.2 + 0.3 * random.unit();
                    let turn = random.unit() - 0.5;
                    let positions = motion(random, 20, 3, true);
                    // A clip that walks a bend of its own, placed somewhere else.
                    let root = (0..20).flat_map(|k| {
                        let s = f64::from(k) * 0.05;
                        let (x, y, yaw) = (speed * s, 0.1 * s * s, 6.0 * turn * s);
                        let (px, py, angle) = place.unwrap_or_default();
                        let (sin, cos) = angle.sin_cos();
                        let turned = [cos * x - sin * y + px, sin * x + cos * y + py];
                        // As an angle is usually given: within half a turn.
                        let yaw = (yaw + angle + PI).rem_euclid(2.0 * PI) - PI;
                        [turned[0], turned[1], yaw]
                    });
                    (positions, root.collect())
                })
                .collect();
            let clips: Vec<ClipFeatures<'_>> = clips
                .iter()
                .map(|(positions, root)| ClipFeatures {
                    root,
                    ..clip(positions, 3)
                })
                .collect();
            let spec = ClassSpec {
                frames: 20,
                ..ClassSpec::new("walk", true, 3)
            };
            Arc::new(SearchClass::new(&spec, &clips, Arc::new(Hat::corners(1))).expect("good"))
        };
        let source = built(&mut random, place);
        let target = built(&mut random, None);
        over(&source, &target, SearchOptions::default())
    };
    let (mut here, mut there) = (made(None), made(Some((3.0, -7.0, 2.4))));
    let mut worst: f64 = 0.0;
    for ks in 0..20 {
        for kd in 0..20 {
            let (a, b) = (here.tables().block(ks, kd), there.tables().block(ks, kd));
            worst = a
                .iter()
                .zip(b)
                .map(|(a, b)| (a - b).abs())
                .fold(worst, f64::max);
        }
    }
    assert!(worst < 1e-9, "tables differ by {worst:e}");
    let mut random = SplitMix::new(8);
    for _ in 0..100 {
        let (from, to) = (state(&mut random), state(&mut random));
        let a = here.find(&from, &Target::State(to)).expect("found");
        let b = there.find(&from, &Target::State(to)).expect("found");
        assert_eq!((a.exit, a.entry), (b.exit, b.entry));
        assert!((a.cost.total() - b.cost.total()).abs() < 1e-9 * a.cost.total());
    }
    // The root's speed does count: the same clips standing still are other motions.
    let still = here.source().feature(0, 3);
    assert!(still[6].abs() > 1e-3, "no root velocity in {still:?}");
}

#[test]
fn online_search_is_cheaper_and_quicker_than_transition_points_fixed_beforehand() {
    let mut search = search(1, false, 4, SearchOptions::default());
    let requests = random_requests(&search, 50, 7);
    let calibration = calibrate(&mut search, &requests).expect("good options");
    assert!(calibration.in_range(), "{calibration:?}");
    let mean = |sum: f64| sum / requests.len() as f64;
    let (mut cost, mut latency) = (0.0, 0.0);
    for (from, to) in &requests {
        let found = search.find(from, &Target::State(*to)).expect("found");
        cost += found.cost.total();
        latency += found.latency_s;
    }
    println!(
        "{calibration:?}; online: cost {:.1}, {:.3} s",
        mean(cost),
        mean(latency)
    );
    let mut latencies = 0.0;
    for count in [1, 5, 10] {
        let (source, target) = (search.source().clone(), search.target().clone());
        let tables = search.tables().clone();
        let mut stored = StoredTransitions::new(source, target, tables, count, search.options());
        assert_eq!(stored.points().len(), count);
        let (mut stored_cost, mut stored_latency) = (0.0, 0.0);
        for (from, to) in &requests {
            let found = stored.find(from, to).expect("cyclic classes come round");
            stored_cost += found.cost.total();
            stored_latency += found.latency_s;
        }
        println!(
            "stored {count}: cost {:.1}, {:.3} s",
            mean(stored_cost),
            mean(stored_latency)
        );
        assert!(
            cost <= stored_cost,
            "{count} stored points cost {stored_cost}, online {cost}"
        );
        latencies += stored_latency / 3.0;
    }
    assert!(
        latency < latencies,
        "online {latency} s, stored {latencies} s in 50 requests"
    );
}

#[test]
fn a_request_allocates_nothing() {
    let mut search = search(2, true, 3, SearchOptions::default());
    let tables = search.tables().clone();
    let (source, target) = (search.source().clone(), search.target().clone());
    let mut stored = StoredTransitions::new(source, target, tables, 5, search.options());
    let mut random = SplitMix::new(2);
    let requests: Vec<(State, State)> = (0..100)
        .map(|_| (state(&mut random), state(&mut random)))
        .collect();
    let before = allocations();
    let mut sum = 0.0;
    for (from, to) in &requests {
        let entry = Target::Entry {
            parameters: to.parameters,
            between: [0.0, 1.0],
        };
        for target in [Target::State(*to), entry] {
            sum += search.find(from, &target).map_or(0.0, |f| f.latency_s);
            sum += search.source_route().len() as f64 + search.target_route().len() as f64;
        }
        sum += stored.find(from, to).map_or(0.0, |f| f.latency_s);
    }
    let after = allocations();
    assert!(sum > 0.0);
    assert_eq!(
        after - before,
        0,
        "allocations in {} requests",
        requests.len()
    );
}
