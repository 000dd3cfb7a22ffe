//! After construction the front end allocates nothing, proved by a counting allocator.
#![allow(unsafe_code, reason = "a global allocator cannot be had without")]

mod gesture_support;

use gesture_support::{Path, Random, header, pose, sample, times, wave_set};
use handwave::gesture::{DerivedChannel, FrontEnd, FrontEndOptions, PerformerScale};
use handwave::pose::PoseSample;
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicU64, Ordering};

static ALLOCATIONS: AtomicU64 = AtomicU64::new(0);

struct Counting;

// SAFETY: hands every call on to the system's allocator, unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// A stream in which everything goes wrong that is mended: points missing, jumping and doubted,
/// hands exchanged, after a second of rest.
fn troubled(until_s: f64) -> Vec<PoseSample> {
    let mut random = Random(3);
    let mut samples = Vec::new();
    for t in times(120.0, until_s, 0.3, 1) {
        let size = if t < 1.5 { 0.0 } else { 1.0 };
        let mut shown = sample(t, &pose(Path::Line, size, 6.0 * t));
        shown.confidence = vec![1.0; 6];
        if t > 2.0 {
            match (20.0 * random.unit()) as usize {
                0 => shown.points[5] = None,
                1 => shown.points[2] = shown.points[2].map(|[x, y, z]| [x + 0.8, y, z]),
                2 => shown.points.swap(3, 5),
                3 => shown.confidence[4] = 0.5,
                _ => {}
            }
        }
        samples.push(shown);
    }
    samples
}

#[test]
fn push_estimate_and_predict_allocate_nothing() {
    let set = wave_set(Path::Line);
    let mood = DerivedChannel {
        name: "mood".into(),
        weights: vec![("height".into(), 0.5), ("yaw".into(), -1.0)],
        offset: 0.1,
        range: Some([-1.0, 1.0]),
        smoothing_s: 2.0,
    };
    let mut front = FrontEnd::new(&set, &header(), FrontEndOptions::default())
        .expect("match")
        .with_channel(&mood)
        .expect("a good mix");
    // 500 Hz overfills every window, so the wrap of the buffers is passed too.
    let samples: Vec<_> = times(500.0, 10.0, 0.3, 1)
        .into_iter()
        // And a long gap, after which the estimators begin anew.
        .map(|t| if t < 8.0 { t } else { t + 2.0 })
        .map(|t| sample(t, &pose(Path::Line, 1.0, 6.0 * t)))
        .collect();
    let before = ALLOCATIONS.load(Ordering::Relaxed);
    let mut sum = 0.0;
    for sample in &samples {
        front.push(sample).expect("good sample");
        front.push(sample).expect_err("the same time again");
        sum += front.predict(0, sample.t + 0.01).amplitude + front.channel(0);
    }
    let after = ALLOCATIONS.load(Ordering::Relaxed);
    assert!(sum > 0.0);
    assert_eq!(after - before, 0, "allocations in {} pushes", samples.len());

    let mut stream = header();
    stream.points[4] = "elbow".into();
    let mut set = set;
    set.header.points[4] = "elbow".into();
    let options = FrontEndOptions {
        scale: PerformerScale::Rest,
        ..FrontEndOptions::default()
    };
    let nodes = [vec![0], vec![]];
    let mut front = FrontEnd::with_neighbourhoods(&set, &stream, options, &nodes).expect("match");
    let samples = troubled(6.0);
    let before = ALLOCATIONS.load(Ordering::Relaxed);
    for (k, sample) in samples.iter().enumerate() {
        front.push(sample).ok();
        front.set_active(k / 100 % 2);
    }
    let after = ALLOCATIONS.load(Ordering::Relaxed);
    let mended = front.tracking();
    assert!(
        mended.outliers > 10 && mended.swapped > 10 && mended.filled > mended.outliers,
        "{mended:?}"
    );
    assert!(front.performer_scale().is_some(), "never measured");
    assert_eq!(
        after - before,
        0,
        "allocations in {} troubled pushes",
        samples.len()
    );
}
