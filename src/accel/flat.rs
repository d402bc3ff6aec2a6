//! All triangles of a scene in world space, for the backends that know no instances.

use super::Visible;
use crate::error::{Error, Result};
use crate::scene::Scene;
use glam::Vec3A;
use std::collections::HashSet;

/// Coordinates beyond this, m, overflow the f32 areas that tree builders compute.
const LARGEST_COORDINATE: f32 = 1e15;

/// World-space triangles and where each came from; the three lists run alike.
#[derive(Default)]
pub(super) struct Triangles {
    /// World-space vertices, m.
    pub vertices: Vec<[Vec3A; 3]>,
    /// Instance, and triangle of its mesh.
    pub ids: Vec<[u32; 2]>,
    /// Whether alpha can open the triangle.
    pub has_coverage: Vec<bool>,
}

impl Triangles {
    /// Whether a ray that sees `visible` sees triangle `i`.
    #[inline(always)]
    pub fn is_visible(&self, i: usize, visible: Visible) -> bool {
        match visible {
            Visible::All => true,
            Visible::Opaque => !self.has_coverage[i],
            Visible::Coverage => self.has_coverage[i],
        }
    }

    /// Only the first of triangles with the same vertices and the same visibility. A ray that meets one meets all of
    /// them, and tree builders make chains of such heaps.
    pub fn without_copies(self) -> Self {
        let mut seen = HashSet::with_capacity(self.vertices.len());
        let kept: Vec<u32> = (0u32..)
            .zip(self.vertices.iter().zip(&self.has_coverage))
            .filter(|(_, (vertices, has_coverage))| {
                let mut corners = vertices.map(|p| p.to_array().map(f32::to_bits));
                corners.sort_unstable();
                seen.insert((corners, **has_coverage))
            })
            .map(|(i, _)| i)
            .collect();
        if kept.len() == self.vertices.len() { self } else { self.reordered(&kept) }
    }

    /// The same triangles in the order of `indices`; an index may occur more than once.
    pub fn reordered(&self, indices: &[u32]) -> Self {
        fn pick<T: Copy>(from: &[T], indices: &[u32]) -> Vec<T> {
            indices.iter().map(|&i| from[i as usize]).collect()
        }
        Self {
            vertices: pick(&self.vertices, indices),
            ids: pick(&self.ids, indices),
            has_coverage: pick(&self.has_coverage, indices),
        }
    }
}

/// Transforms the triangles of all instances to world space.
pub(super) fn flatten(scene: &Scene) -> Result<Triangles> {
    let mut flat = Triangles::default();
    for (instance, placed) in (0u32..).zip(&scene.instances) {
        let mesh = &scene.meshes[placed.mesh as usize];
        let has_coverage = scene.materials[mesh.material as usize].has_coverage();
        for (primitive, triangle) in (0u32..).zip(mesh.triangles.iter()) {
            let vertices = triangle.map(|i| placed.to_world.transform_point3a(mesh.positions[i as usize]));
            // The comparison is false for NaN, too.
            if !vertices.iter().all(|p| p.abs().max_element() < LARGEST_COORDINATE) {
                return Err(Error::Backend(format!(
                    "triangle {primitive} of mesh '{}' lies beyond {LARGEST_COORDINATE:e} m: scale the scene down",
                    mesh.name
                )));
            }
            flat.vertices.push(vertices);
            flat.ids.push([instance, primitive]);
            flat.has_coverage.push(has_coverage);
        }
    }
    Ok(flat)
}
