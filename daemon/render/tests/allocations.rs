//! A frame allocates nothing: neither on the host's heap nor on the device. This file holds one test, so that no other thread
//! of the test runner allocates while it counts.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on has failed"
)]

mod common;

use std::{
    alloc::{GlobalAlloc, Layout, System},
    cell::Cell,
    time::Duration,
};

use bowwave_core::{
    frame::{
        scene::{LightView, Pass, PassDecision, RoundView},
        searchlight::SearchlightView,
    },
    water::ReflectionMethod,
    world::searchlight::SearchlightSpec,
};
use bowwave_render::DrawRequest;
use common::{
    config, open, sea,
    testing::{add_boat, add_moving_boat, box_model, empty_scene},
};
use glam::{DVec3, Vec3};

thread_local! {
    static COUNT: Cell<u64> = const { Cell::new(0) };
}

/// The system's allocator, counting by thread: the software driver's own threads do not count.
struct Counting;

// SAFETY: every call goes to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // A thread that is ending has no counter any more.
        let _ = COUNT.try_with(|c| c.set(c.get() + 1));
        // SAFETY: the caller's promise is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's promise is passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn frames_allocate_nothing_after_the_first() {
    for method in [ReflectionMethod::Full, ReflectionMethod::Physics, ReflectionMethod::Baked] {
        check(method);
    }
}

fn check(method: ReflectionMethod) {
    let models = [
        box_model("white", [9.0, 2.6, 1.8], [0.8, 0.8, 0.78]),
        box_model("red", [5.0, 2.0, 1.2], [0.5, 0.06, 0.04]),
    ];
    let mut scene = empty_scene(640, 360);
    scene.water.method = method;
    add_boat(&mut scene, &models, 0, 45.0, -0.12, 0.5);
    add_moving_boat(&mut scene, &models, 1, [38.0, 0.1, 2.4], [6.0, 0.2]);
    let at = scene.boats[0].pose.position;
    scene.rounds = vec![
        RoundView::Splash { at, height_m: 4.0, radius_m: 0.9, opacity: 1.0 },
        RoundView::Tracer { from: DVec3::new(1.0, 8.0, 7.5), to: at, radiance: Vec3::splat(4.0) },
    ];
    scene.lights = vec![LightView { boat: Some(0), at: at + DVec3::Z, light: Vec3::splat(1e-4) }];
    let spec = SearchlightSpec { candela: 200_000.0, beam: 0.15, is_on: true };
    scene.searchlight = Some(SearchlightView::new(&spec, DVec3::Z, 10.0, 5_000.0));
    for pass in [Pass::Lamplight, Pass::Lights, Pass::Rounds] {
        scene.passes[pass as usize] = PassDecision::Run;
    }
    // The validation layer allocates for itself, in this thread.
    let config = bowwave_render::RenderConfig { validation: false, ..config(&scene) };
    let (mut renderer, mut completions) = open(&config, &models);
    let pictures = [sea(640, 360), sea(640, 360)];
    let mut memory = Vec::new();
    for n in 0..60 {
        scene.frame = n;
        // Everything moves, so that rectangles and lists change from frame to frame.
        for boat in &mut scene.boats {
            boat.pose.position.x += 0.05;
        }
        if n == 5 {
            memory = renderer.memory();
            COUNT.set(0);
        }
        renderer.submit(DrawRequest::new(&scene, &pictures[n as usize % 2], true)).unwrap();
        let frame = completions.wait_next(Duration::from_secs(20)).unwrap().unwrap();
        assert_eq!(frame.frame, n);
    }
    assert_eq!(COUNT.get(), 0, "{method:?}: allocations of the submitting and reading thread in 55 frames");
    assert_eq!(renderer.memory(), memory);
}
