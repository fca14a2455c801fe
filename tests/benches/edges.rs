//! Time to build edge trees, to find a view's edges with and without them, and to draw those that can be seen, at 512x512.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use glam::{DVec3, Vec3};
use protocol::messages::Camera;
use renderer::camera::View;
use renderer::edges::adjacency::{Adjacency, EyeBox};
use renderer::edges::by_rays::RaySettings;
use renderer::edges::crossings::Crossings;
use renderer::edges::finder::EdgeFinder;
use renderer::edges::list::EdgeList;
use renderer::edges::tree::EdgeTree;
use renderer::edges::visibility::{EdgeDrawer, Hiding};
use renderer::edges::world::world_of;
use scenes::LoadedScene;

const SIZE_PX: u32 = 512;

fn view(scene: &LoadedScene) -> View {
    let camera = &scene.camera;
    View::new(&Camera {
        eye: camera.eye,
        target: camera.target,
        up: camera.up,
        fov_y: camera.fov_y,
        width: SIZE_PX,
        height: SIZE_PX,
    })
}

/// Edges between a face that looks at the eye and one that does not, by looking at every edge.
fn brute_force(adjacency: &Adjacency, eye: DVec3) -> usize {
    let eye = EyeBox::point(eye);
    (0..adjacency.edges.len())
        .filter(|&edge| match *adjacency.faces(edge) {
            [a, b] => adjacency.facing(a, &eye) != adjacency.facing(b, &eye),
            _ => true,
        })
        .count()
}

fn edges(criterion: &mut Criterion) {
    let builtin = |name| (name, scenes::open(name).expect("built-in scenes load"));
    let mut all = vec![builtin("chains"), builtin("rooms")];
    match system_tests::places::shared() {
        Some(shared) => {
            let path = shared.join("references/dragon/dragon.toml");
            all.push(("dragon", scenes::load(&path).expect("the dragon loads")));
        }
        None => eprintln!("skipped the dragon: there is no ../shared"),
    }
    for (name, loaded) in all {
        let mut group = criterion.benchmark_group(format!("{name} {SIZE_PX}x{SIZE_PX}"));
        group.sample_size(10);
        let largest = loaded.scene.objects.iter().max_by_key(|object| {
            let mesh = loaded.scene.meshes.get(object.mesh as usize);
            mesh.map_or(0, |m| m.faces.len())
        });
        let object = largest.expect("the scene has objects");
        let adjacency = Adjacency::new(&loaded.scene.meshes[object.mesh as usize]);
        group.bench_function("build the tree of the largest object", |bencher| {
            bencher.iter(|| black_box(EdgeTree::new(&adjacency, object.crease_angle)));
        });
        let eye = Vec3::from(loaded.camera.eye).as_dvec3();
        group.bench_function("find its silhouettes by brute force", |bencher| {
            bencher.iter(|| black_box(brute_force(&adjacency, eye)));
        });
        let mut finder = EdgeFinder::new(&loaded.scene);
        let (mut view, mut list) = (view(&loaded), EdgeList::default());
        group.bench_function("find all edges, camera moving", |bencher| {
            bencher.iter(|| {
                view.eye.x += 1e-3;
                finder.find(&view, &mut list);
            });
        });
        group.bench_function("find all edges, nothing moving", |bencher| {
            bencher.iter(|| finder.find(&view, &mut list));
        });
        let world = world_of(&loaded.scene);
        let mut crossings = Crossings::new(SIZE_PX as usize, SIZE_PX as usize);
        let mut drawer = EdgeDrawer::default();
        for (name, hiding) in [
            ("draw all edges", Hiding::None),
            (
                "draw the edges that rays see",
                Hiding::Rays(&world, RaySettings::default()),
            ),
        ] {
            group.bench_function(name, |bencher| {
                bencher.iter(|| {
                    list.generation += 1;
                    drawer.draw(&view, &list, hiding, true, &mut crossings)
                });
            });
        }
    }
}

criterion_group!(benches, edges);
criterion_main!(benches);
