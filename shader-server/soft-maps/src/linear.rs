//! The maps of one linear light.

use glam::{Vec2, Vec3};
use rays::{Bounds, World};

use crate::{
    Options, Receiver,
    frame::{Frame, corners},
    grid::{Between, Grid},
    irradiance::irradiance,
    light::Linear,
    pair::{Drawer, Pair, Parts, Tally},
    sample::{Sample, Sight, Tracer},
    seam,
};

/// Most samples that [`Options::max_samples`] may ask for.
pub(crate) const MAX_SAMPLES: usize = 33;

/// Share of the places in a pair's penumbrae that may be undersampled before a sample is put between.
const TOLERATED: f32 = 0.01;

/// Depth maps of the samples on a linear light, and the channels of neighbours.
#[derive(Clone, Debug)]
pub(crate) struct LinearMaps {
    light: Linear,
    frame: Frame,
    grid: Grid,
    /// Of each row, the unit vector away from the light's line.
    radials: Vec<Vec3>,
    /// Boxes that the maps see all of.
    covered: Vec<Bounds>,
    whole_world: bool,
    /// Where background is, metres.
    far: f32,
    /// In order along the light.
    pub(crate) samples: Vec<Sample>,
    pub(crate) pairs: Vec<Pair>,
    drawer: Drawer,
    max_samples: usize,
    refinements: u32,
    /// Rows traced since it was built.
    pub(crate) traced_rows: u64,
}

/// What a receiver sees of a linear light.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Found {
    /// Irradiance from what is seen, as if nothing were in between.
    pub(crate) seen: f64,
    /// Irradiance from all of the light.
    pub(crate) all: f64,
    pub(crate) undersampled: bool,
    pub(crate) blockers: [Option<u32>; 2],
}

impl LinearMaps {
    pub(crate) fn build(world: &World, light: &Linear, options: &Options) -> Self {
        let frame = Frame::new(light);
        let covered = options.receivers.map_or_else(|| boxes(world), |b| vec![b]);
        let grid = Grid::new(&frame, light, &covered, options);
        let mut maps = Self {
            light: *light,
            frame,
            grid,
            radials: (0..grid.rows)
                .map(|row| frame.radial(grid.phi(row)))
                .collect(),
            covered,
            far: 2. * farthest(&frame, &world.bounds()),
            whole_world: options.receivers.is_none(),
            samples: Vec::new(),
            pairs: Vec::new(),
            drawer: Drawer {
                step: grid.column_step,
                bias: options.bias * grid.column_step,
                transition: options.transition,
            },
            max_samples: (options.max_samples as usize).clamp(1, MAX_SAMPLES),
            refinements: options.refinements.min(16),
            traced_rows: 0,
        };
        let wanted = (options.samples as usize).clamp(2, MAX_SAMPLES);
        let wanted = if frame.half_length > 0. { wanted } else { 1 };
        for i in 0..wanted {
            let share = i as f32 / (wanted - 1).max(1) as f32;
            let x = frame.half_length * (2. * share - 1.);
            let sample = maps.trace(world, x);
            maps.samples.push(sample);
        }
        for first in 1..wanted {
            let pair = maps.drawn([first - 1, first]);
            maps.pairs.push(pair);
        }
        maps.insert(world);
        maps
    }

    fn tracer<'a>(&'a self, world: &'a World) -> Tracer<'a> {
        Tracer {
            world,
            frame: &self.frame,
            grid: &self.grid,
            ignored: self.light.ignored,
            far: self.far,
            refinements: self.refinements,
        }
    }

    fn trace(&mut self, world: &World, x: f32) -> Sample {
        self.traced_rows += self.grid.rows as u64;
        let columns = self.grid.columns(&self.frame, &self.covered, x);
        self.tracer(world).sample(x, columns)
    }

    fn drawn(&self, samples: [usize; 2]) -> Pair {
        let mut pair = Pair::new(samples, self.grid.rows);
        self.drawer
            .draw(&mut pair, &self.samples, &vec![true; self.grid.rows]);
        pair
    }

    /// Puts samples between neighbours that miss part of a penumbra, as long as any may be added.
    fn insert(&mut self, world: &World) {
        while let Some(worst) = self.worst() {
            if self.samples.len() >= self.max_samples {
                return;
            }
            let [first, second] = self.pairs[worst].samples;
            let middle = 0.5 * (self.samples[first].x + self.samples[second].x);
            let sample = self.trace(world, middle);
            self.samples.insert(second, sample);
            for pair in &mut self.pairs[worst + 1..] {
                pair.samples = pair.samples.map(|i| i + 1);
            }
            let halves = [[first, second], [second, second + 1]].map(|at| self.drawn(at));
            self.pairs.splice(worst..=worst, halves);
        }
    }

    /// The pair that misses most, if any misses enough for another sample.
    fn worst(&self) -> Option<usize> {
        let totals = self.pairs.iter().map(Pair::total).enumerate();
        totals
            .filter(|(_, t)| t.undersampled as f32 > (TOLERATED * t.penumbral as f32).max(2.))
            .max_by_key(|(i, t)| (t.undersampled, std::cmp::Reverse(*i)))
            .map(|(i, _)| i)
    }

    /// Traces again what may have changed in `moved`, where things were and where they are now. Returns whether that is
    /// possible: not if the world has outgrown the maps.
    pub(crate) fn update(&mut self, world: &World, moved: &[Bounds]) -> bool {
        let bounds = world.bounds();
        let moved: Vec<Bounds> = moved.iter().copied().filter(|b| !b.is_empty()).collect();
        let within = !self.whole_world || self.reach(&moved);
        if !within || farthest(&self.frame, &bounds) > self.far {
            return false;
        }
        if self.whole_world {
            self.covered = boxes(world);
        }
        let mut due = vec![false; self.grid.rows];
        for bounds in &moved {
            let rows = self.grid.rows_of(self.frame.arc_of(bounds));
            due.iter_mut().zip(rows).for_each(|(due, row)| *due |= row);
        }
        let count = due.iter().filter(|row| **row).count();
        if count == 0 {
            return true;
        }
        self.traced_rows += (count * self.samples.len()) as u64;
        let mut samples = std::mem::take(&mut self.samples);
        let tracer = self.tracer(world);
        for sample in &mut samples {
            tracer.trace(sample, &due);
        }
        self.samples = samples;
        for pair in &mut self.pairs {
            self.drawer.draw(pair, &self.samples, &due);
        }
        self.insert(world);
        true
    }

    /// Whether the maps see all of `boxes`.
    fn reach(&self, boxes: &[Bounds]) -> bool {
        let rows = boxes.iter().all(|b| {
            let arc = self.frame.lit_arc(&self.light, std::slice::from_ref(b));
            self.grid.reaches(arc)
        });
        let columns = self.samples.iter().all(|sample| {
            let angles = self.frame.angles_of(boxes, sample.x);
            sample.columns.reach(angles, self.grid.column_step)
        });
        rows && (boxes.is_empty() || columns)
    }

    /// What `receiver` sees of the light.
    pub(crate) fn look(&self, receiver: &Receiver) -> Found {
        let mut found = Found::default();
        let place = self.frame.place(receiver.position);
        let Some(between) = self.grid.around(place.phi) else {
            found.all = self.part(receiver, [-self.frame.half_length, self.frame.half_length]);
            found.seen = found.all;
            return found;
        };
        if self.samples.len() == 1 {
            return self.look_from_point(receiver, place.flat, &between);
        }
        let mut parts = [[Parts::ALL; MAX_SAMPLES]; 2];
        let mut thetas = [0.; MAX_SAMPLES];
        for (theta, sample) in thetas.iter_mut().zip(&self.samples) {
            *theta = sample.theta(place.flat);
        }
        let side = self.side_of_seams(&thetas, &between);
        for (i, (parts, row)) in parts.iter_mut().zip(between.rows).enumerate() {
            if side.is_none_or(|side| side == i) {
                self.look_in_row(receiver, (place.flat, &thetas), row, parts, &mut found);
            }
        }
        if let Some(side) = side {
            parts[1 - side] = parts[side];
        }
        let same = |value: Parts| {
            let pairs = self.pairs.len();
            parts.iter().all(|row| {
                row[..pairs]
                    .iter()
                    .all(|p| p.first == value.first && p.second == value.second)
            })
        };
        if same(Parts::ALL) {
            found.all = if self.light.facing.is_some() {
                self.part(receiver, [-self.frame.half_length, self.frame.half_length])
            } else {
                // The share is all that matters, and this one needs no integral.
                f64::from(u8::from(self.above_horizon(receiver)))
            };
            found.seen = found.all;
            return found;
        }
        for (pair, [first, second]) in self
            .pairs
            .iter()
            .zip(parts[0].iter().zip(&parts[1]).map(|(a, b)| [*a, *b]))
        {
            let [from, to] = pair.samples.map(|i| self.samples[i].x);
            let all = self.part(receiver, [from, to]);
            found.all += all;
            for (parts, weight) in [(first, 1. - between.second), (second, between.second)] {
                found.seen += f64::from(weight) * self.seen_part(receiver, [from, to], &parts, all);
            }
        }
        found
    }

    /// Irradiance from what is seen of a piece of the light that gives `all`.
    fn seen_part(&self, receiver: &Receiver, [from, to]: [f32; 2], parts: &Parts, all: f64) -> f64 {
        if parts.first + parts.second >= 1. {
            return all;
        }
        let length = to - from;
        let mut seen = 0.;
        if parts.first > 0. {
            seen += self.part(receiver, [from, from + parts.first * length]);
        }
        if parts.second > 0. {
            seen += self.part(receiver, [to - parts.second * length, to]);
        }
        seen.min(all)
    }

    /// Which of the rows is on the receiver's side of an outline between them, if a sample sees one there.
    fn side_of_seams(&self, thetas: &[f32], between: &Between) -> Option<usize> {
        let step = self.grid.column_step;
        self.samples.iter().zip(thetas).find_map(|(sample, theta)| {
            let seams = &sample.seams[between.rows[0]];
            if seams.is_empty() {
                return None;
            }
            let column = sample.columns.at(*theta, step).round().max(0.);
            seam::side(seams, column as usize, between.second)
        })
    }

    fn look_in_row(
        &self,
        receiver: &Receiver,
        (flat, thetas): (Vec2, &[f32; MAX_SAMPLES]),
        row: usize,
        parts: &mut [Parts; MAX_SAMPLES],
        found: &mut Found,
    ) {
        let mut before: Option<Sight> = None;
        for (index, sample) in self.samples.iter().enumerate() {
            let sight = self.sight(receiver, (flat, thetas[index]), row, sample);
            if !sight.seen {
                found.block(sample.blocker(row, &sight));
            }
            if let Some(first) = before {
                let pair = &self.pairs[index - 1];
                let samples = [&self.samples[index - 1], sample];
                let at = self.drawer.at(samples, &pair.channels[row], row);
                parts[index - 1] = at.parts(flat, [&first, &sight]);
                found.undersampled |= parts[index - 1].undersampled;
            }
            before = Some(sight);
        }
    }

    /// How a sample sees the receiver's surface where `row` is.
    fn sight(
        &self,
        receiver: &Receiver,
        (flat, theta): (Vec2, f32),
        row: usize,
        sample: &Sample,
    ) -> Sight {
        let p = sample.relative(flat);
        let squared = p.length_squared();
        let inverse = 1. / squared.sqrt().max(f32::MIN_POSITIVE);
        let radial = self.radials[row];
        // The row is beside the receiver: its surface goes on there by its plane, unless that is seen too steeply.
        let direction = self.frame.axis * (p.x * inverse) + radial * (p.y * inverse);
        let normal = receiver.face_normal;
        let height = normal.dot(receiver.position - self.frame.on_line(sample.x));
        let on_plane = normal.dot(direction) / height;
        let near = (on_plane - inverse).abs() <= inverse;
        let step = self.grid.column_step;
        let inverse = if near { on_plane.max(inverse) } else { inverse };
        let front = height * normal.dot(receiver.normal) < 0.;
        Sight {
            faces: front,
            ..sample.sight(row, theta, inverse, step, self.drawer.bias)
        }
    }

    /// A light without length: hidden or not.
    fn look_from_point(&self, receiver: &Receiver, flat: Vec2, between: &Between) -> Found {
        let mut found = Found {
            all: 1.,
            ..Found::default()
        };
        let sample = &self.samples[0];
        let theta = sample.theta(flat);
        let weights = match self.side_of_seams(&[theta], between) {
            Some(side) => [1. - side as f64, side as f64],
            None => [1. - between.second, between.second].map(f64::from),
        };
        for (row, weight) in between.rows.iter().zip(weights) {
            let sight = self.sight(receiver, (flat, theta), *row, sample);
            if sight.seen {
                found.seen += weight;
            } else {
                found.block(sample.blocker(*row, &sight));
            }
        }
        let towards = self.frame.middle - receiver.position;
        if towards.dot(receiver.normal) <= 0. {
            (found.seen, found.all) = (0., 0.);
        }
        found
    }

    fn above_horizon(&self, receiver: &Receiver) -> bool {
        let above = |end: &Vec3| (*end - receiver.position).dot(receiver.normal) > 0.;
        self.light.ends.iter().any(above)
    }

    /// Irradiance from a part of the light, as if nothing were in between.
    fn part(&self, receiver: &Receiver, x: [f32; 2]) -> f64 {
        irradiance(
            receiver,
            x.map(|x| self.frame.on_line(x)),
            self.light.facing,
        )
    }

    pub(crate) fn total(&self) -> Tally {
        self.pairs
            .iter()
            .map(Pair::total)
            .fold(Tally::default(), |all, pair| Tally {
                penumbral: all.penumbral + pair.penumbral,
                undersampled: all.undersampled + pair.undersampled,
                unexplained: all.unexplained + pair.unexplained,
            })
    }

    pub(crate) fn texels(&self) -> usize {
        self.samples
            .iter()
            .map(|s| s.columns.count * self.grid.rows)
            .sum()
    }

    pub(crate) fn bytes(&self) -> usize {
        self.samples.iter().map(Sample::bytes).sum::<usize>()
            + self.pairs.iter().map(Pair::bytes).sum::<usize>()
    }

    /// Radians between rows and between columns.
    pub(crate) fn steps(&self) -> [f32; 2] {
        [self.grid.row_step, self.grid.column_step]
    }

    /// The channels of a row that neighbours have, as values in [0, 1] per texel: of the pair's first and second sample.
    pub(crate) fn channel_values(&self, pair: usize, row: usize) -> [Vec<f32>; 2] {
        let pair = &self.pairs[pair];
        let samples = pair.samples.map(|i| &self.samples[i]);
        self.drawer.at(samples, &pair.channels[row], row).values()
    }
}

/// Where things are.
fn boxes(world: &World) -> Vec<Bounds> {
    let boxes = (0..world.len() as u32).map(|i| world.instance_bounds(i));
    boxes.filter(|bounds| !bounds.is_empty()).collect()
}

/// How far a box reaches from any place of the light, metres.
fn farthest(frame: &Frame, bounds: &Bounds) -> f32 {
    if bounds.is_empty() {
        return 1.;
    }
    let lengths = corners(bounds).map(|corner| corner.distance(frame.middle));
    lengths.into_iter().fold(1e-3, f32::max) + frame.half_length
}

impl Found {
    pub(crate) fn block(&mut self, blocker: Option<u32>) {
        let Some(blocker) = blocker else { return };
        if self.blockers.contains(&Some(blocker)) {
            return;
        }
        if let Some(slot) = self.blockers.iter_mut().find(|slot| slot.is_none()) {
            *slot = Some(blocker);
        }
    }
}
