//! Light that has been reflected before: what the patches of surfaces receive and reflect.
//!
//! A ray that gathers light ends on a patch. From far off the patch serves whole; nearer by, direct light is asked for at the
//! point that was met, and only what was reflected before comes from the patch. What a patch receives after k reflections is
//! what its own rays met after k − 1, so they are traced once and say for each order where they ended.

use std::sync::{Arc, OnceLock};

use glam::{DVec3, Vec3};
use rays::{Hit, Ray};

use super::{
    IrradianceCache,
    bounce::{Bounce, Gatherer, leaving},
    hemisphere::{Strata, frame},
    patch::{Patches, Piece},
    points::{Points, place},
};
use crate::{lights::Receiver, random::Stream, stage::Stage};

/// Reflections between a light's first and the surface seen: a path tracer has them all at depth 6.
pub(crate) const REFLECTIONS: usize = 4;

/// Patches smaller than this share of the largest have one point.
const SMALL: f64 = 0.3;

/// Points that ask for lights where they do not all see the same of them.
const MOST_POINTS: usize = 16;

/// Height above a patch at which its points are to be seen, as a share of its size.
const LIFT: f64 = 0.05;

/// Points of a mixed patch that are tried for one that a point sees.
const TRIES: usize = 4;

/// Tells streams of random numbers for different purposes apart.
const SALT: u64 = 0xFA2;

/// Points of a patch that gather light, and their rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// Small beside the largest.
    Small,
    /// Nothing stands on it: its points count alike.
    Bare,
    /// Something stands on it: each point counts for what sees it.
    Mixed,
}

/// A patch.
#[derive(Debug)]
pub(crate) struct Patch {
    lit: Lit,
    ends: OnceLock<Arc<Ends>>,
    /// Irradiance after one, two, ... reflections.
    orders: [OnceLock<Order>; REFLECTIONS - 1],
}

/// What a patch has of the lights.
#[derive(Debug)]
struct Lit {
    kind: Kind,
    size_m: f64,
    albedo: Vec3,
    /// What it reflects of direct light: mean of albedo times irradiance, W/m².
    reflected: Vec3,
    /// Instances that shade its points, each once.
    met: Vec<u32>,
    /// The points that gather, by their places in the patch.
    places: Vec<usize>,
    /// A little above them, if it is mixed.
    points: Vec<Vec3>,
}

/// Irradiance after so many reflections, on the mean and at each point of a mixed patch.
#[derive(Debug)]
struct Order {
    mean: Vec3,
    at: Vec<Vec3>,
}

/// Where the rays of a patch's points ended.
#[derive(Debug)]
pub(crate) struct Ends {
    /// Of each point in turn.
    ends: Vec<End>,
    /// Points that did not do for a patch: what they reflect of themselves.
    own: Vec<Own>,
    /// Of each ray, for telling which moves matter.
    pub(crate) distances_m: Vec<f32>,
    pub(crate) met: Vec<u32>,
}

#[derive(Clone, Copy, Debug)]
enum End {
    Nothing,
    /// What a light gives is direct light.
    Light,
    Patch(u32),
    /// A point of its own, in a patch, near a point of it.
    Own(u32),
}

#[derive(Clone, Copy, Debug)]
struct Own {
    albedo: Vec3,
    /// W/m².
    reflected: Vec3,
    before: Before,
}

/// Where the light that was reflected before is known.
#[derive(Clone, Copy, Debug)]
struct Before {
    slot: u32,
    /// Of a mixed patch.
    point: usize,
}

impl Kind {
    fn points(self) -> usize {
        match self {
            Self::Small => 1,
            Self::Bare => 4,
            Self::Mixed => 5,
        }
    }

    fn strata(self) -> Strata {
        Strata {
            rings: 4,
            sectors: if self == Self::Small { 6 } else { 8 },
        }
    }
}

/// A direction of a hemisphere in world space, on the side of the face that is seen.
pub(crate) fn towards(
    strata: &Strata,
    site: &Receiver,
    index: usize,
    stream: &mut Stream,
) -> DVec3 {
    let local = strata.direction(index / strata.sectors, index % strata.sectors, stream);
    let [u, v] = frame(site.normal);
    let direction = u * local.x + v * local.y + site.normal * local.z;
    // The shading normal's hemisphere reaches below the face, where there is nothing to see: turn such rays up.
    let face = site.face_normal.as_dvec3();
    let below = direction.dot(face) * if site.is_front() { -1. } else { 1. };
    if below > 0. {
        let up = if site.is_front() { face } else { -face };
        direction + up * (2. * below)
    } else {
        direction
    }
}

impl Patch {
    /// The rays of a patch's points: from where and whither.
    pub(crate) fn rays(
        &self,
        stage: &Stage,
        piece: Piece,
    ) -> impl Iterator<Item = (Receiver, DVec3)> {
        let strata = self.lit.kind.strata();
        self.lit.places.iter().flat_map(move |&index| {
            let point = piece.point(stage, place(&piece, index));
            point.into_iter().flat_map(move |(receiver, _)| {
                (0..strata.count()).map(move |ray| {
                    let mut stream = stream(&piece, index, ray);
                    (receiver, towards(&strata, &receiver, ray, &mut stream))
                })
            })
        })
    }

    /// What is known of its rays, if they have been traced.
    pub(crate) fn ends(&self) -> Option<&Arc<Ends>> {
        self.ends.get()
    }

    /// Instances that shade it.
    pub(crate) fn shaded_by(&self) -> &[u32] {
        &self.lit.met
    }

    /// Keeps rays and direct light, forgets what came of them.
    pub(crate) fn kept(&self) -> Self {
        let lit = Lit {
            met: self.lit.met.clone(),
            places: self.lit.places.clone(),
            points: self.lit.points.clone(),
            ..self.lit
        };
        Self {
            lit,
            ends: self.ends.clone(),
            orders: Default::default(),
        }
    }

    /// Whether it is small for a ray that comes from so far, and all in one light.
    fn serves_from(&self, distance_m: f32) -> bool {
        self.lit.kind != Kind::Mixed && f64::from(distance_m) >= self.lit.size_m
    }
}

fn stream(piece: &Piece, point: usize, ray: usize) -> Stream {
    piece.stream().part(SALT).part((point << 16 | ray) as u64)
}

impl IrradianceCache {
    fn patches(&self, stage: &Stage) -> &Patches {
        let largest_m = self.lattice.spacing_m(0);
        self.patches.get_or_init(|| Patches::new(stage, largest_m))
    }

    /// The patch that a ray met; nothing if that is a light.
    fn met(&self, stage: &Stage, hit: &Hit, direction: DVec3) -> Option<(u32, &Patch)> {
        let [a, b, c] = stage.triangle(hit.instance, hit.face)?;
        let is_front = (b - a).cross(c - a).dot(direction) < 0.;
        let of = [hit.instance, hit.face];
        let (slot, piece) = self.patches(stage).find(of, hit.barycentric, is_front)?;
        Some((slot, self.filled(stage, slot, piece)?))
    }

    fn filled(&self, stage: &Stage, slot: u32, piece: Piece) -> Option<&Patch> {
        let patches = self.patches(stage);
        let place = patches.slots.get(slot as usize)?;
        Some(place.get_or_init(|| {
            Box::new(Patch {
                lit: self.lit(stage, piece, patches.largest_m),
                ends: OnceLock::new(),
                orders: Default::default(),
            })
        }))
    }

    fn lit(&self, stage: &Stage, piece: Piece, largest_m: f64) -> Lit {
        let size_m = piece.size_m(stage);
        let kind = if size_m < SMALL * largest_m {
            Kind::Small
        } else if piece.is_bare(stage) {
            Kind::Bare
        } else {
            Kind::Mixed
        };
        let mut points = Points::new(stage, piece);
        if kind == Kind::Mixed {
            points.count = 0;
        } else {
            points.fill(stage, kind.points());
            if kind == Kind::Bare && !points.agree() {
                points.fill(stage, MOST_POINTS);
            }
        }
        let places = if kind == Kind::Mixed {
            open_places(stage, &piece, size_m)
        } else {
            (0..kind.points()).collect()
        };
        let above = |index: &usize| {
            let (at, _) = piece.point(stage, place(&piece, *index))?;
            Some(above(&at, size_m))
        };
        let mixed = if kind == Kind::Mixed {
            places.as_slice()
        } else {
            &[]
        };
        self.count_rays(points.shadows.rays);
        let share = (points.count.max(1) as f32).recip();
        Lit {
            kind,
            size_m,
            albedo: points.albedo * share,
            reflected: points.reflected * share,
            met: points.shadows.blockers,
            points: mixed.iter().filter_map(above).collect(),
            places,
        }
    }

    /// What a surface that is met reflects towards where the ray came from, ambient light included.
    pub(crate) fn reflected_by(
        &self,
        stage: &Stage,
        gatherer: &mut Gatherer<'_>,
        hit: &Hit,
        direction: DVec3,
        stream: &mut Stream,
    ) -> Vec3 {
        let Some((slot, patch)) = self.met(stage, hit, direction) else {
            return Vec3::ZERO;
        };
        let order = REFLECTIONS - 1;
        if patch.serves_from(hit.t) {
            patch.lit.met.iter().for_each(|i| gatherer.note(*i));
            let before = self.order(stage, slot, patch, order).mean;
            return reflected(stage, patch.lit.albedo, patch.lit.reflected, before);
        }
        let Some(bounce) = gatherer.bounce(hit, direction, stream) else {
            return Vec3::ZERO;
        };
        let before = self.before_at(stage, slot, patch, &bounce.receiver);
        let before = self.before(stage, before, order);
        reflected(stage, bounce.albedo, bounce.albedo * bounce.direct, before)
    }

    /// Indirect irradiance at a point that is only met by another ray.
    pub(crate) fn reflected_before(&self, stage: &Stage, at: &Receiver) -> Vec3 {
        let corners = stage.triangle(at.instance, at.face);
        let barycentric = corners.and_then(|corners| barycentric(corners, at.position));
        let found = barycentric.and_then(|barycentric| {
            let of = [at.instance, at.face];
            self.patches(stage).find(of, barycentric, at.is_front())
        });
        let Some((slot, piece)) = found else {
            return Vec3::ZERO;
        };
        let Some(patch) = self.filled(stage, slot, piece) else {
            return Vec3::ZERO;
        };
        let before = self.before_at(stage, slot, patch, at);
        self.before(stage, before, REFLECTIONS - 1)
    }

    /// The point of a patch that stands for another point in it: the nearest that is seen from there.
    fn before_at(&self, stage: &Stage, slot: u32, patch: &Patch, at: &Receiver) -> Before {
        let points = &patch.lit.points;
        let from = above(at, patch.lit.size_m);
        let is_seen = |point: usize| {
            let ray = Ray {
                origin: from,
                direction: points[point] - from,
            };
            stage.world().occluder(&ray, 1.).is_none()
        };
        let squared = |point: &usize| points[*point].distance_squared(from);
        let nearer = |a: &usize, b: &usize| squared(a).total_cmp(&squared(b));
        let nearest = (0..points.len()).min_by(nearer).unwrap_or(0);
        let mut point = nearest;
        for _ in 0..TRIES.min(points.len()) {
            if is_seen(point) {
                return Before { slot, point };
            }
            let farther = |other: &usize| nearer(other, &point).is_gt();
            match (0..points.len()).filter(farther).min_by(nearer) {
                Some(next) => point = next,
                None => break,
            }
        }
        Before {
            slot,
            point: nearest,
        }
    }

    fn before(&self, stage: &Stage, before: Before, order: usize) -> Vec3 {
        if order == 0 {
            return Vec3::ZERO;
        }
        let patches = self.patches(stage);
        let known = patches
            .slots
            .get(before.slot as usize)
            .and_then(OnceLock::get);
        let patch = known.map(|patch| &**patch);
        let Some(patch) = patch.or_else(|| {
            // An edit has made it forget.
            self.filled(stage, before.slot, patches.piece(before.slot))
        }) else {
            return Vec3::ZERO;
        };
        let order = self.order(stage, before.slot, patch, order);
        order.at.get(before.point).copied().unwrap_or(order.mean)
    }

    /// What a patch receives after so many reflections, at least one.
    fn order<'a>(&self, stage: &Stage, slot: u32, patch: &'a Patch, order: usize) -> &'a Order {
        patch.orders[order - 1].get_or_init(|| {
            let ends = patch
                .ends
                .get_or_init(|| Arc::new(self.trace(stage, slot, patch)));
            let rays = patch.lit.kind.strata().count();
            let share = std::f32::consts::PI / rays as f32;
            let at: Vec<Vec3> = ends
                .ends
                .chunks(rays)
                .map(|of_point| {
                    let brought = |end: &End| self.brought(stage, ends, *end, order - 1);
                    of_point.iter().map(brought).sum::<Vec3>() * share
                })
                .collect();
            let mean = at.iter().sum::<Vec3>() / at.len().max(1) as f32;
            let is_mixed = patch.lit.kind == Kind::Mixed;
            Order {
                mean,
                at: if is_mixed { at } else { Vec::new() },
            }
        })
    }

    /// Radiance that a ray of a patch brings, with so many reflections before its end.
    fn brought(&self, stage: &Stage, ends: &Ends, end: End, order: usize) -> Vec3 {
        match end {
            End::Nothing => Vec3::from(stage.shading().background),
            End::Light => Vec3::ZERO,
            End::Own(index) => {
                let own = &ends.own[index as usize];
                let before = self.before(stage, own.before, order);
                reflected(stage, own.albedo, own.reflected, before)
            }
            End::Patch(slot) => {
                let patches = self.patches(stage);
                let Some(patch) = patches.slots.get(slot as usize).and_then(|place| {
                    let known = place.get().map(|patch| &**patch);
                    known.or_else(|| self.filled(stage, slot, patches.piece(slot)))
                }) else {
                    return Vec3::ZERO;
                };
                let before = if order == 0 {
                    Vec3::ZERO
                } else {
                    self.order(stage, slot, patch, order).mean
                };
                reflected(stage, patch.lit.albedo, patch.lit.reflected, before)
            }
        }
    }

    fn trace(&self, stage: &Stage, slot: u32, patch: &Patch) -> Ends {
        let piece = self.patches(stage).piece(slot);
        let mut gatherer = Gatherer::new(stage);
        let mut ends = Ends {
            ends: Vec::new(),
            own: Vec::new(),
            distances_m: Vec::new(),
            met: Vec::new(),
        };
        let mut stream = piece.stream().part(SALT + 1);
        for (from, direction) in patch.rays(stage, piece) {
            let hit = gatherer.follow(&from, direction);
            ends.distances_m
                .push(hit.map_or(f32::INFINITY, |hit| hit.t));
            let end = match hit {
                None => End::Nothing,
                Some(hit) => match self.met(stage, &hit, direction) {
                    None => End::Light,
                    Some((slot, patch)) if patch.serves_from(hit.t) => {
                        patch.lit.met.iter().for_each(|i| gatherer.note(*i));
                        End::Patch(slot)
                    }
                    Some((slot, patch)) => {
                        let bounce = gatherer.bounce(&hit, direction, &mut stream);
                        let own = bounce.map(|bounce| self.own(stage, slot, patch, &bounce));
                        ends.own.extend(own);
                        own.map_or(End::Nothing, |_| End::Own(ends.own.len() as u32 - 1))
                    }
                },
            };
            ends.ends.push(end);
        }
        self.count_rays(gatherer.rays());
        ends.met = gatherer.met;
        ends
    }

    fn own(&self, stage: &Stage, slot: u32, patch: &Patch, bounce: &Bounce) -> Own {
        Own {
            albedo: bounce.albedo,
            reflected: bounce.albedo * bounce.direct,
            before: self.before_at(stage, slot, patch, &bounce.receiver),
        }
    }
}

/// Radiance of a surface that reflects so much direct light and receives so much that was reflected before.
fn reflected(stage: &Stage, albedo: Vec3, direct: Vec3, before: Vec3) -> Vec3 {
    let ambient = Vec3::from(stage.shading().ambient);
    (direct + albedo * before) * std::f32::consts::FRAC_1_PI + albedo * ambient
}

/// Places of a mixed patch that are in the open: not inside or right below what stands there, unless all of it is.
fn open_places(stage: &Stage, piece: &Piece, size_m: f64) -> Vec<usize> {
    let is_open = |index: &usize| {
        let Some((at, _)) = piece.point(stage, place(piece, *index)) else {
            return false;
        };
        let up = if at.is_front() {
            at.face_normal
        } else {
            -at.face_normal
        };
        let Some(hit) = stage
            .world()
            .closest(&leaving(&at, up.as_dvec3()), f32::INFINITY)
        else {
            return true;
        };
        let is_outside = stage
            .triangle(hit.instance, hit.face)
            .is_none_or(|[a, b, c]| (b - a).cross(c - a).dot(up.as_dvec3()) <= 0.);
        is_outside && f64::from(hit.t) > 2. * LIFT * size_m
    };
    let count = Kind::Mixed.points();
    let mut open: Vec<usize> = (0..MOST_POINTS).filter(is_open).take(count).collect();
    if open.is_empty() {
        open.extend(0..count);
    }
    open
}

/// A little above a point of a patch so large.
fn above(at: &Receiver, size_m: f64) -> Vec3 {
    let side = if at.is_front() { 1. } else { -1. };
    let lift = (LIFT * size_m).max(f64::from(at.clearance)) * side;
    (at.position + at.face_normal.as_dvec3() * lift).as_vec3()
}

/// Second and third barycentric coordinates of a point of a triangle.
fn barycentric([a, b, c]: [DVec3; 3], at: DVec3) -> Option<[f32; 2]> {
    let (u, v, p) = (b - a, c - a, at - a);
    let (uu, uv, vv) = (u.dot(u), u.dot(v), v.dot(v));
    let (pu, pv) = (p.dot(u), p.dot(v));
    let det = uu * vv - uv * uv;
    let weights = [(vv * pu - uv * pv) / det, (uu * pv - uv * pu) / det];
    (det > 0.).then(|| weights.map(|w| w.clamp(0., 1.) as f32))
}
