//! Tangents for normal maps: the file's, or by MikkTSpace (Mikkelsen 2008), which is what the maps were baked with.
//!
//! glTF's v points down the image and its normal maps' green points up, so the algorithm is given 1 − v.

use super::LoadReport;
use super::geometry::{Draft, unit};
use bevy_mikktspace::{Geometry, TangentSpace, generate_tangents};
use glam::{Vec3, Vec4};
use std::collections::HashMap;

/// Makes sure that the mesh has unit normals and tangents with a sign; `set` is the normal map's coordinate set.
pub(super) fn provide(draft: &mut Draft, set: usize, at: &str, report: &mut LoadReport) {
    if draft.normals.is_none() {
        draft.flatten();
    }
    match draft.tangents.take() {
        Some(tangents) => draft.tangents = Some(repaired(draft, tangents)),
        None => generate(draft, set, at, report),
    }
}

/// Any unit tangent at a right angle to the normal.
fn any_tangent(n: Vec3) -> Vec4 {
    n.any_orthonormal_vector().extend(1.0)
}

fn repaired(draft: &Draft, mut tangents: Vec<Vec4>) -> Vec<Vec4> {
    for (t, n) in tangents.iter_mut().zip(draft.normals.iter().flatten()) {
        let sign = if t.w < 0.0 { -1.0 } else { 1.0 };
        *t = unit(t.truncate()).map_or_else(|| any_tangent(*n), |direction| direction.extend(sign));
    }
    tangents
}

/// The mesh as MikkTSpace reads it, and its answer for every corner.
struct Corners<'a> {
    draft: &'a Draft,
    normals: &'a [Vec3],
    set: usize,
    tangents: Vec<Vec4>,
}

impl Corners<'_> {
    /// Faces and corners come from the counts given below, vertex indices were checked when they were read.
    fn vertex(&self, face: usize, corner: usize) -> usize {
        self.draft.triangles[face][corner] as usize
    }
}

impl Geometry for Corners<'_> {
    fn num_faces(&self) -> usize {
        self.draft.triangles.len()
    }

    fn num_vertices_of_face(&self, _face: usize) -> usize {
        3
    }

    fn position(&self, face: usize, corner: usize) -> [f32; 3] {
        self.draft.positions[self.vertex(face, corner)].to_array()
    }

    fn normal(&self, face: usize, corner: usize) -> [f32; 3] {
        self.normals[self.vertex(face, corner)].to_array()
    }

    fn tex_coord(&self, face: usize, corner: usize) -> [f32; 2] {
        let uv = self.draft.uvs.get(self.set).and_then(|set| set.as_ref());
        uv.map_or([0.0; 2], |uv| {
            let uv = uv[self.vertex(face, corner)];
            [uv.x, 1.0 - uv.y]
        })
    }

    fn set_tangent(&mut self, space: Option<TangentSpace>, face: usize, corner: usize) {
        let Some(space) = space else { return };
        let encoded = Vec4::from_array(space.tangent_encoded());
        if let (Some(t), Some(direction)) =
            (self.tangents.get_mut(3 * face + corner), unit(encoded.truncate()))
        {
            *t = direction.extend(encoded.w);
        }
    }
}

fn generate(draft: &mut Draft, set: usize, at: &str, report: &mut LoadReport) {
    let Some(normals) = draft.normals.take() else { return };
    let fallback = draft.triangles.iter().flatten().map(|&v| any_tangent(normals[v as usize])).collect();
    let mut corners = Corners { draft, normals: &normals, set, tangents: fallback };
    if generate_tangents(&mut corners).is_err() {
        report.warn(format!("{at}: no tangent space can be computed; its normal map is turned arbitrarily"));
    }
    let tangents = corners.tangents;
    draft.normals = Some(normals);
    // A vertex whose corners disagree (a seam) becomes several vertices.
    let mut known: HashMap<(u32, [u32; 4]), u32> = HashMap::with_capacity(draft.positions.len());
    let (mut order, mut merged) = (Vec::new(), Vec::new());
    for (triangle, corner_tangents) in draft.triangles.iter_mut().zip(tangents.as_chunks::<3>().0) {
        for (vertex, tangent) in triangle.iter_mut().zip(corner_tangents) {
            let key = (*vertex, tangent.to_array().map(f32::to_bits));
            *vertex = *known.entry(key).or_insert_with(|| {
                order.push(key.0);
                merged.push(*tangent);
                order.len() as u32 - 1
            });
        }
    }
    draft.reorder(&order);
    draft.tangents = Some(merged);
}
