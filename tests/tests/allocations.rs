//! Once its buffers have grown, the frame loop asks for no memory.

use std::collections::HashSet;
use std::sync::Arc;

use protocol::messages::{Camera, SampleRequest};
use renderer::camera::View;
use renderer::config::Choices;
use renderer::frame::{Display, Received, Wanted};
use renderer::tone::ToneMap;
use shader_server::camera::Pinhole;
use shader_server::shadows::ShadowRays;
use shader_server::{Shader, Stage};

const SIZE_PX: [u32; 2] = [320, 240];
/// 2 % of the pixels.
const SAMPLES: usize = 1536;
/// Once around the path, so that every view has been met when counting starts.
const WARM_UP: usize = 60;
const COUNTED: usize = 60;
/// Frames a second of the path's time.
const FPS: f32 = 15.0;

/// An allocator that records who asks it for memory while a thread is watched.
mod counting {
    use std::alloc::{GlobalAlloc, Layout, System};
    use std::backtrace::Backtrace;
    use std::cell::{Cell, RefCell};

    thread_local! {
        static WATCHED: Cell<bool> = const { Cell::new(false) };
        static ASKED: RefCell<Vec<Backtrace>> = const { RefCell::new(Vec::new()) };
    }

    struct Recording;

    #[global_allocator]
    static ALLOCATOR: Recording = Recording;

    fn note() {
        // What noting allocates is not noted.
        if WATCHED.replace(false) {
            ASKED.with_borrow_mut(|asked| asked.push(Backtrace::force_capture()));
            WATCHED.set(true);
        }
    }

    #[expect(unsafe_code, reason = "an allocator can be replaced in no other way")]
    // SAFETY: every call is passed on to the system's allocator unchanged.
    unsafe impl GlobalAlloc for Recording {
        unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
            note();
            // SAFETY: the caller's promises are the system allocator's.
            unsafe { System.alloc(layout) }
        }

        unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
            note();
            // SAFETY: as above.
            unsafe { System.alloc_zeroed(layout) }
        }

        unsafe fn realloc(&self, old: *mut u8, layout: Layout, size: usize) -> *mut u8 {
            note();
            // SAFETY: as above.
            unsafe { System.realloc(old, layout, size) }
        }

        unsafe fn dealloc(&self, old: *mut u8, layout: Layout) {
            // SAFETY: as above.
            unsafe { System.dealloc(old, layout) }
        }
    }

    /// Where memory was asked for by this thread while it ran.
    pub(crate) fn watch(run: impl FnOnce()) -> Vec<Backtrace> {
        WATCHED.set(true);
        run();
        WATCHED.set(false);
        ASKED.take()
    }
}

/// The part of a stack trace that is of this project, innermost first.
fn own_frames(trace: &std::backtrace::Backtrace) -> String {
    let text = trace.to_string();
    let places = text.lines().map(str::trim).filter(|line| {
        line.starts_with("at ") && line.contains("/renderer/src/") || line.contains("./src/")
    });
    places.take(4).collect::<Vec<_>>().join("\n  ")
}

#[test]
fn the_allocator_notes_what_is_asked_for() {
    assert_eq!(counting::watch(|| ()).len(), 0);
    let asked = counting::watch(|| {
        let mut numbers = std::hint::black_box(vec![1_u8; 100]);
        numbers.reserve(10_000);
    });
    assert_eq!(asked.len(), 2);
}

#[test]
fn the_frame_loop_allocates_nothing_once_warm() {
    let loaded = scenes::open("chains").unwrap();
    let stage = Stage::build(Arc::new(loaded.scene.clone())).unwrap();
    let rays = ShadowRays::default();
    let mut shader = Shader::new(&stage, &rays, 1);
    let view = |frame: usize| {
        let key = loaded.paths[0].at_seconds(frame as f32 / FPS);
        View::new(&Camera {
            eye: key.eye,
            target: key.target,
            up: loaded.camera.up,
            fov_y: loaded.camera.fov_y,
            width: SIZE_PX[0],
            height: SIZE_PX[1],
        })
    };
    let mut display = Display::new(&loaded.scene, Choices::default(), SIZE_PX[0], SIZE_PX[1], 1);
    let (tone, mut shown) = (ToneMap::new(), Vec::new());
    let (mut wanted, mut received) = (Wanted::default(), Vec::new());
    display.begin(&view(0), 1);
    display.plan_first(SAMPLES, &mut wanted);
    let (mut asked, mut known, mut drawn) = (Vec::new(), HashSet::new(), 0);
    for frame in 0..WARM_UP + COUNTED {
        let (here, next, number) = (view(frame), view(frame + 1), frame as u32 + 1);
        received.clear();
        for (requests, camera) in [(&wanted.here, here), (&wanted.ahead, next)] {
            let pinhole = Pinhole::new(&camera.camera());
            received.extend(requests.iter().map(|request: &SampleRequest| {
                let shaded = shader.shade(request.id, &pinhole.ray(request));
                Received {
                    view: number,
                    epoch: 0,
                    sample: shaded.sample,
                    texel: shaded.texel,
                }
            }));
        }
        let mut met = shader.take_triples();
        met.sort_unstable();
        met.retain(|triple| known.insert(*triple));
        // New triples are news that cost memory; every other frame goes through what is known without any.
        if !met.is_empty() {
            display.learn(&met);
            display.update_shadows(true);
        }
        let of_frame = counting::watch(|| {
            display.update_shadows(true);
            display.receive(&received, number);
            display.draw(&here, number);
            display.time_present(|d| tone.map(d.grid(), d.image(), &mut shown));
            display.plan(SAMPLES, Some(&next), &mut wanted);
            display.take_stats(frame);
        });
        drawn += display.shadow_tally().drawn;
        if frame >= WARM_UP && met.is_empty() {
            asked.extend(of_frame.iter().map(|trace| (frame, own_frames(trace))));
        }
    }
    let list: Vec<String> = asked
        .iter()
        .map(|(frame, places)| format!("frame {frame}:\n  {places}"))
        .collect();
    assert!(drawn > 0, "no shadow edge was drawn");
    assert!(
        asked.is_empty(),
        "memory was asked for {} times\n{}",
        asked.len(),
        list.join("\n")
    );
}
