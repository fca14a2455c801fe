//! Scanned and modelled meshes from outside the project, against counts made by other programs. Skipped, with a line that
//! says so, where they are missing: they lie in `../shared` beside the checkout, or where `EDGE_POINT_SHARED` says.

use std::path::PathBuf;

use scenes::{LoadedScene, load};

fn shared(path: &str) -> Option<PathBuf> {
    let root = std::env::var_os("EDGE_POINT_SHARED").map_or_else(
        || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared")),
        PathBuf::from,
    );
    let path = root.join(path);
    let found = path.exists();
    if !found {
        println!("skipped: {} is missing", path.display());
    }
    found.then_some(path)
}

fn opened(path: &str) -> Option<LoadedScene> {
    Some(load(&shared(path)?).unwrap_or_else(|e| panic!("{e}")))
}

#[test]
fn scans_have_their_catalogued_counts() {
    if let Some(dragon) = opened("scenes/dragon_vrip.ply") {
        let r = dragon.report;
        assert_eq!(
            (r.triangles, r.vertices, r.welded_vertices),
            (871_414, 437_645, 435_545)
        );
        assert_eq!(
            (r.edges, r.boundary_edges, r.non_manifold_edges),
            (1_306_959, 0, 99)
        );
        assert_eq!((r.zero_area_faces, r.duplicate_faces), (108, 0));
    }
    if let Some(bunny) = opened("scenes/bun_zipper.ply") {
        let r = bunny.report;
        assert_eq!(
            (r.triangles, r.vertices, r.edges, r.boundary_edges),
            (69_451, 35_947, 104_288, 223)
        );
    }
    if let Some(spot) = opened("scenes/spot/spot_triangulated.obj") {
        let r = &spot.report;
        assert_eq!(
            (r.triangles, r.vertices, r.edges, r.boundary_edges),
            (5_856, 2_930, 8_784, 0)
        );
        assert!(!spot.scene.meshes[0].uvs.is_empty());
    }
}

/// Edges are counted within each object, so those of scenes of many objects are not the catalogue's.
#[test]
fn models_have_their_catalogued_counts() {
    if let Some(cornell) = opened("scenes/cornell_box/CornellBox-Original.obj") {
        let r = &cornell.report;
        assert_eq!((r.triangles, r.polygons, r.duplicate_faces), (36, 18, 4));
        assert!(r.notes.iter().any(|n| n.contains("glows")));
    }
    if let Some(room) = opened("scenes/living-room/living-room.obj") {
        assert_eq!(
            (room.report.triangles, room.scene.objects.len()),
            (143_163, 65)
        );
        assert_eq!(room.report.zero_area_faces, 190);
        assert!(!room.scene.textures.is_empty());
    }
    if let Some(truck) = opened("scenes/peterbilt/peterbilt.obj") {
        assert_eq!(
            (truck.report.triangles, truck.report.duplicate_faces),
            (116_501, 2_991)
        );
        assert_eq!(truck.report.non_manifold_edges, 5_478);
    }
    if let Some(maple) = opened("scenes/japaneseMaple/japaneseMaple.obj") {
        let r = maple.report;
        assert_eq!(
            (r.triangles, r.edges, r.duplicate_faces),
            (198_396, 285_626, 5_500)
        );
        assert_eq!((r.boundary_edges, r.non_manifold_edges), (30_564, 31_000));
    }
}

#[test]
fn stl_and_gltf_have_their_catalogued_counts() {
    if let Some(counter) = opened("scenes/counter.unitsmm.STL") {
        let r = counter.report;
        assert_eq!(
            (r.triangles, r.edges, r.boundary_edges, r.non_manifold_edges),
            (83_750, 125_625, 0, 0)
        );
    }
    if let Some(all) = opened("scenes/animate_all_gltf/24_animation_pointer.gltf") {
        assert_eq!(
            (all.report.triangles, all.report.zero_area_faces),
            (14_436, 450)
        );
        assert_eq!(all.scene.meshes.len(), 34);
        assert!(all.scene.objects.len() > 34, "nodes share meshes");
        assert!(!all.scene.textures.is_empty());
        let path = all.path("cameras").unwrap();
        assert_eq!((path.keys.len(), path.step), (3, true));
        let left_out = all
            .report
            .notes
            .iter()
            .filter(|n| n.contains("is no point light"));
        assert_eq!(left_out.count(), 4);
    }
}

#[test]
fn references_load_twice_alike() {
    for (path, triangles, lights) in [
        ("references/chains/chains.toml", 73_730, 2),
        ("references/rooms/rooms.toml", 16_380, 6),
        ("references/dragon/dragon.toml", 871_632, 1),
    ] {
        let Some(first) = opened(path) else { continue };
        assert_eq!(
            (first.report.triangles, first.scene.lights.len()),
            (triangles, lights)
        );
        assert_eq!(Some(first), opened(path));
    }
}
