//! Small scenes of parallelograms and point lights, and what a ray sees of them: plain geometry, in double precision, with no tree.

use std::f64::consts::PI;

use crate::messages::{Camera, SampleRequest};
use crate::scene::{Affine, Light, Material, Mesh, Model, Object, Scene, Shading, Texture};
use crate::transfer::{EncodedScene, TransferError};

pub(super) type V = [f64; 3];

/// Shares of a side by which a ray has to keep off the border of a parallelogram, for it to be clear what it hits.
const MARGIN: f64 = 0.02;

pub(super) fn wide(v: [f32; 3]) -> V {
    v.map(f64::from)
}

pub(super) fn add(a: V, b: V) -> V {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub(super) fn sub(a: V, b: V) -> V {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(super) fn scaled(a: V, by: f64) -> V {
    a.map(|c| c * by)
}

pub(super) fn dot(a: V, b: V) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn cross(a: V, b: V) -> V {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

pub(super) fn length(a: V) -> f64 {
    dot(a, a).sqrt()
}

pub(super) fn unit(a: V) -> V {
    scaled(a, 1.0 / length(a))
}

/// A scene, and its bytes.
pub(super) struct World {
    pub(super) scene: Scene,
    pub(super) encoded: EncodedScene,
}

impl World {
    pub(super) fn new(scene: Scene) -> Result<Self, TransferError> {
        Ok(Self {
            encoded: EncodedScene::new(&scene)?,
            scene,
        })
    }
}

/// The scenes that checks share.
pub(super) struct Worlds {
    /// A floor, a block that hovers over it, a slanted wall, and a point light.
    pub(super) lit: World,
    /// The same without a light.
    pub(super) dim: World,
    /// A floor below an area light that is seen from both sides.
    pub(super) lamp: World,
    /// A floor below a point light and a black area light in between.
    pub(super) shade: World,
    /// A floor below a linear light.
    pub(super) tube: World,
    /// A floor with a map.
    pub(super) mapped: World,
    /// The lit scene, its floor with normals that lean over.
    pub(super) bent: World,
    /// The lit scene, its materials glossy.
    pub(super) shiny: World,
    /// The inside of a grey cube without lights, global.
    pub(super) furnace: World,
    /// Nothing.
    pub(super) empty: World,
    /// Many small faces.
    pub(super) large: World,
}

impl Worlds {
    pub(super) fn new() -> Result<Self, TransferError> {
        let mut dim = lit();
        dim.lights.clear();
        let mut shiny = lit();
        for material in &mut shiny.materials {
            (material.specular, material.roughness) = ([0.3; 3], 0.2);
        }
        let mut empty = lit();
        (empty.objects, empty.meshes, empty.materials) = Default::default();
        empty.lights.clear();
        Ok(Self {
            lit: World::new(lit())?,
            dim: World::new(dim)?,
            lamp: World::new(lamp([5.0, 4.0, 3.0]))?,
            shade: World::new(shade())?,
            tube: World::new(tube())?,
            mapped: World::new(mapped())?,
            bent: World::new(bent())?,
            shiny: World::new(shiny)?,
            furnace: World::new(furnace())?,
            empty: World::new(empty)?,
            large: World::new(large())?,
        })
    }
}

/// The unit square in the plane of x and z.
fn square() -> Mesh {
    Mesh {
        positions: vec![
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [1.0, 0.0, 1.0],
            [0.0, 0.0, 1.0],
        ],
        faces: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    }
}

/// Puts the unit square where it has this corner and these sides.
pub(super) fn placed(corner: V, across: V, along: V) -> Affine {
    let up = unit(cross(along, across));
    [0, 1, 2].map(|row| [across[row], up[row], along[row], corner[row]].map(|c| c as f32))
}

fn object(name: &str, material: u32, transform: Affine) -> Object {
    Object {
        name: name.into(),
        mesh: 0,
        material,
        transform,
        crease_angle: 85.0,
    }
}

fn grey(name: &str, diffuse: [f32; 3]) -> Material {
    Material {
        name: name.into(),
        diffuse,
        diffuse_map: None,
        specular: [0.0; 3],
        roughness: 1.0,
    }
}

fn floor() -> Object {
    let corner = [-10.0, 0.0, -10.0];
    object(
        "floor",
        0,
        placed(corner, [20.0, 0.0, 0.0], [0.0, 0.0, 20.0]),
    )
}

fn floor_alone(lights: Vec<Light>) -> Scene {
    Scene {
        shading: Shading {
            model: Model::Direct,
            ambient: [0.05, 0.06, 0.07],
            background: [0.25, 0.5, 0.75],
        },
        lights,
        materials: vec![grey("floor", [0.5, 0.4, 0.2])],
        textures: Vec::new(),
        meshes: vec![square()],
        objects: vec![floor()],
    }
}

/// The transform of the block with its middle here.
pub(super) fn block_at(middle: V) -> Affine {
    let (sin, cos) = (PI / 6.0).sin_cos();
    let (across, along) = ([cos, 0.0, -sin], [sin, 0.0, cos]);
    let corner = sub(middle, scaled(add(across, along), 0.5));
    placed(corner, across, along)
}

fn lit() -> Scene {
    let mut scene = floor_alone(vec![Light::Point {
        position: [0.3, 3.0, 0.2],
        intensity: [40.0, 30.0, 20.0],
    }]);
    scene.materials.push(grey("block", [0.8, 0.1, 0.3]));
    scene
        .objects
        .push(object("block", 1, block_at([0.0, 1.0, 0.0])));
    let wall = placed([-2.5, 0.2, -2.0], [0.4, 2.0, 0.0], [0.5, 0.0, 3.0]);
    scene.objects.push(object("wall", 1, wall));
    scene
}

fn lamp(radiance: [f32; 3]) -> Scene {
    // Anticlockwise seen from below.
    let vertices = vec![
        [-0.5, 2.0, -0.5],
        [0.5, 2.0, -0.5],
        [0.5, 2.0, 0.5],
        [-0.5, 2.0, 0.5],
    ];
    floor_alone(vec![Light::Area { vertices, radiance }])
}

fn shade() -> Scene {
    let mut scene = lamp([0.0; 3]);
    scene.lights.push(Light::Point {
        position: [0.0, 4.0, 0.0],
        intensity: [40.0, 30.0, 20.0],
    });
    scene
}

fn tube() -> Scene {
    floor_alone(vec![Light::Linear {
        from: [-1.0, 2.0, 0.5],
        to: [1.0, 2.5, -0.5],
        intensity: [6.0, 5.0, 4.0],
    }])
}

/// Colours of the quadrants of the map, sRGB: above from the left, below from the left.
pub(super) const QUADRANTS: [[u8; 3]; 4] =
    [[200, 40, 90], [30, 180, 60], [90, 90, 220], [250, 240, 20]];
/// How often the map is repeated along each side of the floor.
pub(super) const REPEATS: f32 = 3.0;

fn mapped() -> Scene {
    let mut scene = floor_alone(Vec::new());
    scene.materials[0].diffuse_map = Some(0);
    let mut rgb = Vec::new();
    for y in 0..8 {
        rgb.extend((0..8).map(|x| QUADRANTS[y / 4 * 2 + x / 4]));
    }
    scene.textures.push(Texture {
        width: 8,
        height: 8,
        rgb,
    });
    let mesh = &mut scene.meshes[0];
    mesh.uvs = vec![
        [0.0, 0.0],
        [REPEATS, 0.0],
        [REPEATS, REPEATS],
        [0.0, REPEATS],
    ];
    mesh.face_uvs = mesh.faces.clone();
    scene
}

/// Direction of the floor's normals in the bent scene, in the space of its mesh, whose sides are much longer in the world than its height.
pub(super) const LEANING: V = [6.4, 0.9, 5.6];

fn bent() -> Scene {
    let mut scene = lit();
    let mut mesh = square();
    mesh.normals = vec![unit(LEANING).map(|c| c as f32)];
    mesh.face_normals = vec![[0; 3]; 2];
    scene.meshes.push(mesh);
    scene.objects[0].mesh = 1;
    scene
}

/// Reflectance and ambient radiance in the furnace.
pub(super) const FURNACE: [f32; 2] = [0.5, 0.2];

fn furnace() -> Scene {
    let mut scene = floor_alone(Vec::new());
    scene.shading.model = Model::Global;
    scene.shading.ambient = [FURNACE[1]; 3];
    scene.materials = vec![grey("wall", [FURNACE[0]; 3])];
    let (low, high) = (-8.0, 8.0);
    let sides = |axis: usize| {
        let mut across = [0.0; 3];
        let mut along = [0.0; 3];
        across[(axis + 1) % 3] = high - low;
        along[(axis + 2) % 3] = high - low;
        (across, along)
    };
    scene.objects.clear();
    for axis in 0..3 {
        for place in [low, high] {
            let mut corner = [low; 3];
            corner[axis] = place;
            let (across, along) = sides(axis);
            let name = format!("wall {axis} {place}");
            scene
                .objects
                .push(object(&name, 0, placed(corner, across, along)));
        }
    }
    scene
}

/// Corners of the large scene's mesh along a side.
const FINE: u32 = 90;

fn large() -> Scene {
    let mut scene = lit();
    let mesh = &mut scene.meshes[0];
    let share = |i: u32| i as f32 / (FINE - 1) as f32;
    *mesh = Mesh::default();
    for z in 0..FINE {
        mesh.positions
            .extend((0..FINE).map(|x| [share(x), 0.0, share(z)]));
    }
    for z in 0..FINE - 1 {
        for x in 0..FINE - 1 {
            let at = z * FINE + x;
            mesh.faces.push([at, at + 1, at + FINE + 1]);
            mesh.faces.push([at, at + FINE + 1, at + FINE]);
        }
    }
    scene
}

/// Over the floor and its end, down onto the block.
pub(super) fn camera() -> Camera {
    Camera {
        eye: [3.0, 4.0, 6.0],
        target: [0.0, 0.5, 0.0],
        up: [0.0, 1.0, 0.0],
        fov_y: 50.0,
        width: 64,
        height: 48,
    }
}

/// From between floor and lamp up to it.
pub(super) fn camera_from_below() -> Camera {
    Camera {
        eye: [1.5, 0.5, 2.0],
        target: [0.1, 1.9, 0.0],
        ..camera()
    }
}

/// Requests all over the image, in no order, with these ids.
pub(super) fn spread(camera: &Camera, ids: std::ops::Range<u64>) -> Vec<SampleRequest> {
    ids.map(|id| {
        let bits = mixed(id);
        let place = |shift: u32, size: u32| (((bits >> shift) & 0xffff) as u32 * size) >> 16;
        let offset = |shift: u32| ((bits >> shift) & 0xff) as f32 / 256.0;
        SampleRequest {
            id,
            x: place(0, camera.width) as u16,
            y: place(16, camera.height) as u16,
            offset: [offset(32), offset(40)],
        }
    })
    .collect()
}

/// Sixty-four bits that look random (the finaliser of splitmix64; Steele, Lea, Flood 2014).
fn mixed(id: u64) -> u64 {
    let mut z = id.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Origin and unit direction of a request's ray, as section 3 of the document has it.
pub(super) fn ray(camera: &Camera, request: &SampleRequest) -> (V, V) {
    let eye = wide(camera.eye);
    let f = unit(sub(wide(camera.target), eye));
    let r = unit(cross(f, wide(camera.up)));
    let u = cross(r, f);
    let tangent = (f64::from(camera.fov_y).to_radians() / 2.0).tan();
    let (width, height) = (f64::from(camera.width), f64::from(camera.height));
    let x = f64::from(request.x) + f64::from(request.offset[0]);
    let y = f64::from(request.y) + f64::from(request.offset[1]);
    let across = (2.0 * x / width - 1.0) * tangent * width / height;
    let upwards = (1.0 - 2.0 * y / height) * tangent;
    (
        eye,
        unit(add(f, add(scaled(r, across), scaled(u, upwards)))),
    )
}

/// What a ray meets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Thing {
    Nothing,
    Object(u32),
    Light(u32),
}

#[derive(Clone, Copy, Debug)]
struct Parallelogram {
    corner: V,
    sides: [V; 2],
    thing: Thing,
}

/// Where a ray meets it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit {
    pub(super) thing: Thing,
    pub(super) distance: f64,
    pub(super) at: V,
    /// Shares of the two sides.
    pub(super) shares: [f64; 2],
    /// Unit, towards where the ray came from.
    pub(super) normal: V,
}

fn parallelograms(scene: &Scene) -> Vec<Parallelogram> {
    let column = |m: &Affine, c: usize| wide([m[0][c], m[1][c], m[2][c]]);
    let objects = scene.objects.iter().zip(0..).map(|(o, i)| Parallelogram {
        corner: column(&o.transform, 3),
        sides: [column(&o.transform, 0), column(&o.transform, 2)],
        thing: Thing::Object(i),
    });
    let lights = scene.lights.iter().zip(0..).filter_map(|(light, i)| {
        let Light::Area { vertices, .. } = light else {
            return None;
        };
        let [a, b, _, d] = vertices[..] else {
            return None;
        };
        Some(Parallelogram {
            corner: wide(a),
            sides: [sub(wide(b), wide(a)), sub(wide(d), wide(a))],
            thing: Thing::Light(i),
        })
    });
    objects.chain(lights).collect()
}

/// The first thing that a ray meets between `least` and `most`; nothing if that is too close to a border to be sure.
pub(super) fn first(
    scene: &Scene,
    origin: V,
    direction: V,
    (least, most): (f64, f64),
) -> Option<Option<Hit>> {
    let mut nearest: Option<Hit> = None;
    let mut doubtful = f64::INFINITY;
    for quad in parallelograms(scene) {
        let [a, b] = quad.sides;
        let normal = unit(cross(a, b));
        let slope = dot(direction, normal);
        let distance = dot(sub(quad.corner, origin), normal) / slope;
        // Grazing rays divide by next to nothing and are met nowhere.
        if !distance.is_finite() || distance <= least || distance >= most {
            continue;
        }
        let at = add(origin, scaled(direction, distance));
        let local = sub(at, quad.corner);
        let area = dot(cross(a, b), normal);
        let shares = [
            dot(cross(local, b), normal) / area,
            dot(cross(a, local), normal) / area,
        ];
        if shares.iter().all(|s| (MARGIN..1.0 - MARGIN).contains(s)) {
            if nearest.is_none_or(|hit| distance < hit.distance) {
                nearest = Some(Hit {
                    thing: quad.thing,
                    distance,
                    at,
                    shares,
                    normal: if slope < 0.0 {
                        normal
                    } else {
                        scaled(normal, -1.0)
                    },
                });
            }
        } else if shares.iter().all(|s| (-MARGIN..1.0 + MARGIN).contains(s)) {
            doubtful = doubtful.min(distance);
        }
    }
    let reach = nearest.map_or(f64::INFINITY, |hit| hit.distance);
    (doubtful >= reach).then_some(nearest)
}

/// What stands between a place and a light's point; nothing if that is not sure.
pub(super) fn between(scene: &Scene, place: V, light: V) -> Option<Thing> {
    let to = sub(light, place);
    let distance = length(to);
    let hit = first(
        scene,
        place,
        unit(to),
        (1e-4 * distance, distance * (1.0 - 1e-6)),
    )?;
    Some(hit.map_or(Thing::Nothing, |hit| hit.thing))
}
