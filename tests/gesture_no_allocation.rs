//! After construction the front end allocates nothing, proved by a counting allocator.
#![allow(unsafe_code, reason = "a global allocator cannot be had without")]

mod gesture_support;

use gesture_support::{Path, header, pose, sample, times, wave_set};
use handwave::gesture::{DerivedChannel, FrontEnd, FrontEndOptions};
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
}
