//! Shadow edges and intersection creases as edges of a frame.

use glam::{DMat3, DVec3};
use protocol::scene::Light;

use super::store::Shadows;
use super::worth::{Judge, Tally, Verdict, Worth};
use crate::camera::View;
use crate::edges::list::{EdgeList, NO_FACE};
use crate::edges::tree::EdgeKind;

/// World space to view space (right, up, depth), in double precision.
struct ToView {
    eye: DVec3,
    axes: DMat3,
}

impl ToView {
    fn new(view: &View) -> Self {
        let axes = [view.right, view.up, view.forward].map(|v| v.as_dvec3());
        Self {
            eye: view.eye.as_dvec3(),
            axes: DMat3::from_cols(axes[0], axes[1], axes[2]).transpose(),
        }
    }

    fn apply(&self, p: DVec3) -> [f32; 3] {
        (self.axes * (p - self.eye)).as_vec3().into()
    }
}

/// Appends intersection creases, and the shadow edges of these lights (by index in the scene) that are worth it, to the
/// edges of a view. Vertices are numbered from `vertex` on, which is more than any mesh of the scene has. `tallies` then
/// holds what became of each light's edges, by index in the scene.
pub fn append(
    shadows: &Shadows,
    lights: &[Light],
    view: &View,
    worth: Worth,
    mut vertex: u32,
    tallies: &mut Vec<Tally>,
    out: &mut EdgeList,
) {
    let to_view = ToView::new(view);
    for meet in shadows.meets() {
        out.from.push(to_view.apply(meet.from));
        out.to.push(to_view.apply(meet.to));
        out.kind.push(EdgeKind::Meeting);
        out.object.push(meet.objects[0]);
        out.second.push(meet.objects[1]);
        out.faces.push(meet.faces);
        out.vertices.push([vertex, vertex + 1]);
        vertex += 2;
    }
    tallies.clear();
    tallies.resize(lights.len(), Tally::default());
    for (index, cast) in shadows.edges() {
        let index = index as usize;
        let (Some(light), Some(tally)) = (lights.get(index), tallies.get_mut(index)) else {
            continue;
        };
        let judge = Judge::new(light, worth);
        let ends = 2 * cast.edges.len() as u32;
        for (i, (edge, numbers)) in cast.edges.iter().zip(&cast.vertices).enumerate() {
            let (verdict, part) = match cast.grades.get(i) {
                Some(grade) => judge.judge(view, edge, grade),
                None => (Verdict::Drawn, [0.0, 1.0]),
            };
            tally.count(verdict);
            if verdict != Verdict::Drawn {
                continue;
            }
            // Where an edge is cut it has an end of its own.
            let own = vertex + ends + 2 * i as u32;
            let (mut points, mut numbers) = ([edge.from, edge.to], numbers.map(|v| vertex + v));
            if part != [0.0, 1.0] {
                tally.cut += 1;
                points = part.map(|share| edge.from.lerp(edge.to, f64::from(share)));
                numbers = [
                    if part[0] > 0.0 { own } else { numbers[0] },
                    if part[1] < 1.0 { own + 1 } else { numbers[1] },
                ];
            }
            out.from.push(to_view.apply(points[0]));
            out.to.push(to_view.apply(points[1]));
            out.kind.push(EdgeKind::Shadow(edge.kind));
            out.object.push(edge.receiver);
            out.second.push(edge.receiver);
            out.faces.push([edge.face, NO_FACE]);
            out.vertices.push(numbers);
        }
        vertex += 2 * ends;
    }
}

#[cfg(test)]
#[path = "list_tests.rs"]
mod tests;
