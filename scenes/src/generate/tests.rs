//! Every closed generator is closed, turned outwards and welded.

use std::collections::{HashMap, HashSet};

use glam::DVec3;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use protocol::scene::Mesh;

use super::Generator;
use crate::geometry::{corners, is_zero_area};

fn make(toml: &str) -> Mesh {
    let generator: Generator = toml::from_str(toml).unwrap();
    generator.make().unwrap().meshes.swap_remove(0)
}

/// Closed, each edge once each way; no two positions bit-equal; no face without area; outward, seen by its volume.
fn check_closed(mesh: &Mesh) -> Result<(), String> {
    let bits: HashSet<[u32; 3]> = mesh.positions.iter().map(|p| p.map(f32::to_bits)).collect();
    if bits.len() != mesh.positions.len() {
        return Err("two positions are bit-equal".into());
    }
    let mut sides: HashMap<(u32, u32), u32> = HashMap::new();
    let mut volume = 0.0;
    for &face in &mesh.faces {
        if is_zero_area(mesh, face) {
            return Err(format!("face {face:?} has no area"));
        }
        let [a, b, c] = corners(mesh, face);
        volume += a.dot(b.cross(c)) / 6.0;
        for k in 0..3 {
            *sides.entry((face[k], face[(k + 1) % 3])).or_default() += 1;
        }
    }
    for (&(a, b), &n) in &sides {
        if n != 1 || sides.get(&(b, a)) != Some(&1) {
            return Err(format!("edge {a}-{b} has not one face each way"));
        }
    }
    let used: HashSet<u32> = mesh.faces.iter().flatten().copied().collect();
    if used.len() != mesh.positions.len() {
        return Err("a position is not used".into());
    }
    if volume <= 0.0 {
        return Err(format!("volume {volume}: turned inside out"));
    }
    check_normals(mesh)
}

/// Unit normals on the outer side of their faces.
fn check_normals(mesh: &Mesh) -> Result<(), String> {
    for (&face, normals) in mesh.faces.iter().zip(&mesh.face_normals) {
        let [a, b, c] = corners(mesh, face);
        let flat = (b - a).cross(c - a);
        for &n in normals {
            let n = DVec3::from_array(mesh.normals[n as usize].map(f64::from));
            if (n.length() - 1.0).abs() > 1e-6 || n.dot(flat) <= 0.0 {
                return Err(format!("normal {n} of face {face:?} points inwards"));
            }
        }
    }
    Ok(())
}

#[test]
fn closed_generators_are_closed() {
    for toml in [
        "kind = 'torus'\nmajor = 0.5\nminor = 0.1",
        "kind = 'sphere'\nradius = 2\naround = 7\nacross = 5",
        "kind = 'sphere'\nradius = 1\naround = 3\nacross = 2",
        "kind = 'icosphere'\nradius = 1",
        "kind = 'cylinder'\nradius = 0.3\nheight = 2",
        "kind = 'capsule'\nradius = 0.3\nheight = 2",
        "kind = 'lathe'\nprofile = [[0, 0], [0.4, 0.1], [0.3, 0.5], [0.35, 0.6], [0.25, 0.5], [0, 0.2]]",
        "kind = 'lathe'\nring = true\nprofile = [[0.4, 0], [0.5, 0.1], [0.4, 0.2]]",
        "kind = 'box'\nsize = [1, 2, 3]",
        "kind = 'bars'\nsize = [1, 2]\nbars = [4, 6]\nwidth = 0.05\nthickness = 0.1",
        "kind = 'bars'\nsize = [1, 2]\nbars = [4, 6]\nwidth = 0.05\nthickness = 0.1\ncells = 5",
        "kind = 'wall'\nsize = [5, 3, 0.2]\nopenings = [[1, 0, 2, 2.1], [3, 1, 4, 2]]",
        "kind = 'wall'\nsize = [5, 3, 0.2]",
        "kind = 'tube'\nkeys = [[0, 0, 0, 0.1], [1, 0, 0, 0.2]]",
        "kind = 'head'\nheight = 0.3\ncells = 12",
        "kind = 'head'\nheight = 2\ncells = 40\nroughness = 3\nseed = 5",
        "kind = 'tube'\nkeys = [[0, 0, 0, 0.05], [0, 1, 0, 0.2], [0.8, 1, 0.5, 0.1]]\nscales = 12\ncrest = 0.2",
        "kind = 'chain'\nlinks = 2\nkeys = [[0, 0, 0], [0.7, 0, 0]]\nmajor = 0.5\nminor = 0.1",
    ] {
        let mesh = make(toml);
        check_closed(&mesh).unwrap_or_else(|e| panic!("{toml}: {e}"));
    }
}

#[test]
fn furniture_is_closed_boxes_that_do_not_overlap() {
    for (toml, boxes) in [
        ("kind = 'table'\nsize = [1.6, 0.75, 0.9]", 5),
        ("kind = 'chair'", 12),
        ("kind = 'shelf'\nsize = [1, 2, 0.3]\nboards = 5", 8),
    ] {
        let mesh = make(toml);
        assert_eq!(mesh.faces.len(), boxes * 12, "{toml}");
        check_normals(&mesh).unwrap();
        check_boxes(&mesh);
    }
    let part = |i: usize| {
        let toml = "kind = 'books'\nlength = 2\nheight = 0.25\ndepth = 0.2\nseed = 3\nof = 3";
        make(&format!("{toml}\npart = {i}"))
    };
    let mut row = part(0);
    for i in 1..3 {
        let more = part(i);
        let first = row.positions.len() as u32;
        row.positions.extend(&more.positions);
        row.faces
            .extend(more.faces.iter().map(|f| f.map(|v| v + first)));
    }
    check_boxes(&row);
}

/// Eight positions a box, and no two boxes share inner points.
fn check_boxes(mesh: &Mesh) {
    let bounds: Vec<_> = mesh
        .positions
        .as_chunks::<8>()
        .0
        .iter()
        .map(|p| {
            let axis = |k: usize| p.iter().map(move |q| q[k]);
            let low = [0, 1, 2].map(|k| axis(k).fold(f32::INFINITY, f32::min));
            let high = [0, 1, 2].map(|k| axis(k).fold(f32::NEG_INFINITY, f32::max));
            assert!((0..3).all(|k| low[k] < high[k]));
            (low, high)
        })
        .collect();
    for (i, (low, high)) in bounds.iter().enumerate() {
        for (other_low, other_high) in &bounds[i + 1..] {
            let apart = (0..3).any(|k| low[k] >= other_high[k] || other_low[k] >= high[k]);
            assert!(
                apart,
                "{low:?}..{high:?} overlaps {other_low:?}..{other_high:?}"
            );
        }
    }
}

#[test]
fn counts_are_as_documented() {
    let torus = make("kind = 'torus'\nmajor = 1\nminor = 0.2\naround = 48\nacross = 24");
    assert_eq!((torus.positions.len(), torus.faces.len()), (48 * 24, 2304));
    let tube = make("kind = 'tube'\nkeys = [[0, 0, 0, 1], [1, 0, 0, 1]]\naround = 5\nalong = 7");
    assert_eq!(
        (tube.positions.len(), tube.faces.len()),
        (5 * 8 + 2, 2 * 5 * 8)
    );
    let ico = make("kind = 'icosphere'\nradius = 1\nsteps = 2");
    assert_eq!(ico.faces.len(), 320);
    let plane = make("kind = 'plane'\nsize = [2, 2]\ncells = [3, 4]");
    assert_eq!(plane.faces.len(), 24);
    check_normals(&plane).unwrap();
}

#[test]
fn plants_have_their_counts_and_parts_of_a_bed_grow_together() {
    let bed = |part: &str| {
        make(&format!(
            "kind = 'plants'\nsize = [2, 3]\ncount = 7\nheight = 0.8\nseed = 3\npart = '{part}'"
        ))
    };
    let counts = ["stems", "leaves", "petals", "grass"].map(|part| bed(part).faces.len());
    assert_eq!(counts, [7 * 36, 7 * 288, 7 * 120, 7 * 5]);
    let (stems, petals) = (bed("stems"), bed("petals"));
    for plant in 0..7 {
        // Petals start where their stem ends.
        let top = &stems.positions[plant * 21 + 18..][..3];
        let end: [f32; 3] = std::array::from_fn(|k| top.iter().map(|p| p[k]).sum::<f32>() / 3.0);
        let root = &petals.positions[plant * 12 * 10..][..3];
        let start: [f32; 3] = std::array::from_fn(|k| 0.5 * (root[0][k] + root[2][k]));
        assert!(
            (0..3).all(|k| (end[k] - start[k]).abs() < 1e-3),
            "{end:?} {start:?}"
        );
    }
    let crown = make("kind = 'crown'\nradius = 2\nleaves = 50\nleaf = 0.2");
    assert_eq!(crown.faces.len(), 50 * 6);
    for mesh in [stems, petals, crown, bed("leaves"), bed("grass")] {
        assert!(mesh.faces.iter().all(|face| !is_zero_area(&mesh, *face)));
    }
}

#[test]
fn links_that_touch_or_do_not_link_are_refused() {
    let chain = |gap: f32| {
        let toml = format!(
            "kind = 'chain'\nlinks = 3\nkeys = [[0, 0, 0], [{}, 0, 0]]\nmajor = 0.5\nminor = 0.1",
            2.0 * gap
        );
        let generator: Generator = toml::from_str(&toml).unwrap();
        generator.make().map(|m| m.copies.len())
    };
    assert_eq!(chain(0.7), Ok(3));
    assert!(chain(0.85).unwrap_err().contains("into each other"));
    assert!(chain(1.3).unwrap_err().contains("not linked"));
    assert!(chain(0.1).unwrap_err().contains("into each other"));
}

#[test]
fn bad_parameters_are_refused() {
    for toml in [
        "kind = 'torus'\nmajor = 0.1\nminor = 0.5",
        "kind = 'torus'\nmajor = nan\nminor = 0.5",
        "kind = 'sphere'\nradius = -1",
        "kind = 'sphere'\nradius = 1\naround = 1000000\nacross = 1000000",
        "kind = 'box'\nsize = [1, 0, 1]",
        "kind = 'bars'\nsize = [1, 1]\nbars = [10, 2]\nwidth = 0.2\nthickness = 1",
        "kind = 'wall'\nsize = [1, 1, 1]\nopenings = [[0.5, 0, 0.4, 1]]",
        "kind = 'wall'\nsize = [1, 1, 1]\nopenings = [[0, 0, 1, 1]]",
        "kind = 'lathe'\nprofile = [[0.1, 0], [1, 1], [0, 2]]",
        "kind = 'icosphere'\nradius = 1\nsteps = 40",
        "kind = 'books'\nlength = 1\nheight = 1\ndepth = 1\npart = 3\nof = 2",
        "kind = 'plants'\nsize = [1, 1]\ncount = 0\nheight = 1\npart = 'grass'",
        "kind = 'plants'\nsize = [1, 1]\ncount = 4000000000\nheight = 1\npart = 'grass'",
        "kind = 'crown'\nradius = nan\nleaves = 5\nleaf = 1",
        "kind = 'tube'\nkeys = [[0, 0, 0, 0.1]]",
        "kind = 'tube'\nkeys = [[0, 0, 0, 0.1], [0, 0, 0, 0.1]]",
        "kind = 'tube'\nkeys = [[0, 0, 0, 0], [1, 0, 0, 0.1]]",
        "kind = 'tube'\nkeys = [[0, 0, 0, 0.1], [1, 0, 0, 0.1]]\nscales = 8\nrelief = nan",
        "kind = 'chain'\nlinks = 3\nkeys = [[0, 0, 0], [0, 0, 0]]\nmajor = 0.5\nminor = 0.1",
    ] {
        let generator: Generator = toml::from_str(toml).unwrap();
        assert!(generator.make().is_err(), "{toml}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 40, rng_seed: RngSeed::Fixed(2), failure_persistence: None, ..ProptestConfig::default()
    })]

    #[test]
    fn round_shapes_are_closed_at_any_tessellation(
        around in 3_u32..20, half in 1_u32..8, size in 0.01_f32..100.0, thin in 0.05_f32..0.9,
    ) {
        let across = 2 * half;
        let common = format!("around = {around}");
        for toml in [
            format!("kind = 'torus'\nmajor = {size}\nminor = {}\nacross = {}\n{common}", size * thin, half + 2),
            format!("kind = 'sphere'\nradius = {size}\nacross = {}\n{common}", half + 1),
            format!("kind = 'capsule'\nradius = {size}\nheight = {}\nacross = {across}\n{common}", size * thin),
            format!("kind = 'cylinder'\nradius = {size}\nheight = {}\n{common}", size * thin),
        ] {
            prop_assert_eq!(check_closed(&make(&toml)), Ok(()), "{}", toml);
        }
    }

    #[test]
    fn walls_with_openings_apart_are_closed(
        x in 0.0_f32..1.0, y in 0.0_f32..1.0, w in 0.1_f32..1.0, h in 0.1_f32..1.0, cell in 0.2_f32..3.0,
    ) {
        // Two openings whose bounds never touch at a corner.
        let toml = format!(
            "kind = 'wall'\nsize = [5, 3, 0.2]\ncell = {cell}\nopenings = [[{x}, {y}, {}, {}], [2.5, 0, 3.5, 2]]",
            x + w, y + h
        );
        prop_assert_eq!(check_closed(&make(&toml)), Ok(()), "{}", toml);
    }
}
