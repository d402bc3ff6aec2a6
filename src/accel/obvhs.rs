//! The second backend: a compressed eight-wide tree of the crate `obvhs`, one ray at a time.
//!
//! Ylitie, Karras and Laine 2017, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs". All
//! instances are flattened into one tree. The tree and its walk are the crate's; the test of a node's eight boxes
//! is ours, eight lanes wide (the crate's takes them four at a time and skips hits nearer than 1e-4), and so is the
//! triangle test, which tells barycentrics and keeps the interval `tnear < t <= tfar`.
//!
//! Limits: triangles are tested in f32 and not watertight; coordinates below 1e15 m.

use super::flat::{Triangles, flatten};
use super::{Accel, Coherence, Hits, Rays, Visible};
use crate::error::{Error, Result};
use crate::math::{LANES, Mask, f32x16};
use crate::scene::Scene;
use glam::{UVec2, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::cwbvh::{CwBvh, builder::build_cwbvh_from_tris, node::CwBvhNode};
use obvhs::rt_triangle::RtTriangle;
use obvhs::triangle::Triangle;
use wide::{f32x8, i16x8, i32x8, u8x16};

/// Deepest tree that the traversal's stack of 32 groups holds.
const DEEPEST_TREE: usize = 32;
/// Relative widening of the far side of boxes: more than the rounding of the slab test.
const BOX_SLACK: f32 = 1.0 + 8.0 * f32::EPSILON;
/// Direction components below this count as this: finite inverses keep the slab test free of NaN.
const LEAST_DIRECTION: f32 = 1e-20;

/// A compressed wide tree over the world-space triangles of all instances.
pub struct ObvhsAccel {
    /// `None` for a scene without triangles.
    bvh: Option<CwBvh>,
    /// In the tree's order, like `source`.
    triangles: Vec<RtTriangle>,
    source: Triangles,
    /// Whether alpha can open any triangle.
    has_coverage: bool,
}

/// What a node test needs of a ray.
struct BoxRay {
    origin: Vec3A,
    inv_direction: Vec3A,
}

/// One ray in, its closest hit out.
struct Walk {
    origin: Vec3A,
    direction: Vec3A,
    tnear: f32,
    tfar: f32,
    u: f32,
    v: f32,
    /// Index of the triangle in the tree's order; `u32::MAX` before any hit.
    triangle: u32,
}

impl ObvhsAccel {
    /// Builds the tree of `scene`.
    pub fn new(scene: &Scene) -> Result<Self> {
        let flat = flatten(scene)?.without_copies();
        let has_coverage = flat.has_coverage.contains(&true);
        if flat.vertices.is_empty() {
            return Ok(Self { bvh: None, triangles: Vec::new(), source: flat, has_coverage });
        }
        let triangles: Vec<Triangle> =
            flat.vertices.iter().map(|&[v0, v1, v2]| Triangle { v0, v1, v2 }).collect();
        let bvh = build_cwbvh_from_tris(
            &triangles,
            BvhBuildParams::slow_build(),
            &mut std::time::Duration::default(),
        );
        if depth(&bvh) > DEEPEST_TREE {
            return Err(Error::Backend("the scene makes a tree too deep for obvhs: use Embree".into()));
        }
        let mut source = flat.reordered(&bvh.primitive_indices);
        let triangles = source.vertices.iter().map(|&[a, b, c]| RtTriangle::new(a, b, c)).collect();
        source.vertices = Vec::new();
        Ok(Self { bvh: Some(bvh), triangles, source, has_coverage })
    }

    /// The tree to walk, if the rays can see any of it.
    fn tree(&self, visible: Visible) -> Option<(&CwBvh, Visible)> {
        let tree = self.bvh.as_ref()?;
        match (visible, self.has_coverage) {
            (Visible::Coverage, false) => None,
            (_, false) => Some((tree, Visible::All)),
            _ => Some((tree, visible)),
        }
    }

    /// Walks the tree with one ray: to the closest hit, or to any hit where `ANY`. True if there is one.
    #[inline(always)]
    fn walk<const ANY: bool>(&self, bvh: &CwBvh, ray: &mut Walk, visible: Visible) -> bool {
        let boxes = BoxRay { origin: ray.origin, inv_direction: safe_inverse(ray.direction) };
        let mut state = bvh.new_traversal(ray.direction);
        let mut node;
        'walk: {
            obvhs::traverse!(
                bvh,
                node,
                state,
                hit_children(node, &boxes, ray.tnear, ray.tfar, state.oct_inv4),
                {
                    let index = state.primitive_id;
                    if ray.hits(&self.triangles[index as usize])
                        && self.source.is_visible(index as usize, visible)
                    {
                        ray.accept(&self.triangles[index as usize], index);
                        if ANY {
                            break 'walk;
                        }
                    }
                }
            );
        }
        ray.triangle != u32::MAX
    }
}

impl Walk {
    /// Lane `i` of a packet.
    #[inline(always)]
    fn new(rays: &Rays, i: usize) -> Self {
        Self {
            origin: rays.origin.lane(i).into(),
            direction: rays.direction.lane(i).into(),
            tnear: rays.tnear.as_array()[i],
            tfar: rays.tfar.as_array()[i],
            u: 0.0,
            v: 0.0,
            triangle: u32::MAX,
        }
    }

    /// Whether the triangle is hit within the interval. Every quantity is scaled by the determinant, made positive,
    /// so that a miss costs no division.
    #[inline(always)]
    fn hits(&self, triangle: &RtTriangle) -> bool {
        let c = triangle.v0 - self.origin;
        let r = self.direction.cross(c);
        let determinant = triangle.ng.dot(self.direction);
        let (size, sign) = (determinant.abs(), 1f32.copysign(determinant));
        let (u, v) = (r.dot(triangle.e2) * sign, r.dot(triangle.e1) * sign);
        let t = triangle.ng.dot(c) * sign;
        u >= 0.0 && v >= 0.0 && u + v <= size && t > size * self.tnear && t <= size * self.tfar && size > 0.0
    }

    /// Takes a triangle that [`Walk::hits`] as the closest so far.
    #[inline(always)]
    fn accept(&mut self, triangle: &RtTriangle, index: u32) {
        let c = triangle.v0 - self.origin;
        let r = self.direction.cross(c);
        let scale = 1.0 / triangle.ng.dot(self.direction);
        (self.u, self.v) = (r.dot(triangle.e2) * scale, r.dot(triangle.e1) * scale);
        // Rounding of the quotient must not leave the interval.
        self.tfar = (triangle.ng.dot(c) * scale).min(self.tfar);
        self.triangle = index;
    }
}

/// Componentwise inverse; of tiny components a large finite number.
#[inline(always)]
fn safe_inverse(direction: Vec3A) -> Vec3A {
    let least = Vec3A::splat(LEAST_DIRECTION).copysign(direction);
    Vec3A::select(direction.abs().cmplt(Vec3A::splat(LEAST_DIRECTION)), least, direction).recip()
}

/// The children of `node` whose boxes the ray meets, as the traversal wants them: inner nodes in the high byte in
/// order of traversal, triangles in the low 24 bits.
#[inline(always)]
fn hit_children(node: &CwBvhNode, ray: &BoxRay, tnear: f32, tfar: f32, oct_inv4: u32) -> u32 {
    let scale = node.compute_extent() * ray.inv_direction;
    let offset = (Vec3A::from(node.p) - ray.origin) * ray.inv_direction;
    let (mut near, mut far) = (f32x8::splat(tnear), f32x8::splat(tfar));
    let slabs = [
        (&node.child_min_x, &node.child_max_x),
        (&node.child_min_y, &node.child_max_y),
        (&node.child_min_z, &node.child_max_z),
    ];
    for (axis, (low, high)) in slabs.into_iter().enumerate() {
        let both: u8x16 = bytemuck::cast([*low, *high]);
        let (scale, offset) = (f32x8::splat(scale[axis]), f32x8::splat(offset[axis]));
        let a = to_floats(i16x8::from_u8x16_low(both)).mul_add(scale, offset);
        let b = to_floats(i16x8::from_u8x16_high(both)).mul_add(scale, offset);
        near = near.fast_max(a.fast_min(b));
        far = far.fast_min(a.fast_max(b));
    }
    let mut met = near.simd_le(far * f32x8::splat(BOX_SLACK)).to_bitmask();
    let (child_bits, bit_index) = node.get_child_and_index_bits(oct_inv4);
    let mut hit_mask = 0;
    while met != 0 {
        let byte = met.trailing_zeros() * 8;
        hit_mask |= ((child_bits >> byte) as u32 & 0xff) << ((bit_index >> byte) as u32 & 0xff);
        met &= met - 1;
    }
    hit_mask
}

/// Eight small integers as floats.
#[inline(always)]
fn to_floats(integers: i16x8) -> f32x8 {
    f32x8::from_i32x8(i32x8::from_i16x8(integers))
}

/// Levels of the tree.
fn depth(bvh: &CwBvh) -> usize {
    let mut deepest = 0;
    let mut open = vec![(0u32, 1)];
    while let Some((index, level)) = open.pop() {
        deepest = deepest.max(level);
        let node = &bvh.nodes[index as usize];
        open.extend(
            (0..8)
                .filter(|&child| !node.is_leaf(child))
                .map(|child| (node.child_node_index(child), level + 1)),
        );
    }
    deepest
}

impl Accel for ObvhsAccel {
    fn intersect16(&self, rays: &Rays, active: Mask, visible: Visible, _: Coherence) -> Hits {
        let mut valid = 0u16;
        let (mut t, mut u, mut v) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        let (mut instance, mut primitive) = ([0; LANES], [0; LANES]);
        if let Some((bvh, visible)) = self.tree(visible) {
            for i in active.iter() {
                let mut ray = Walk::new(rays, i);
                if self.walk::<false>(bvh, &mut ray, visible) {
                    valid |= 1 << i;
                    (t[i], u[i], v[i]) = (ray.tfar, ray.u, ray.v);
                    [instance[i], primitive[i]] = self.source.ids[ray.triangle as usize];
                }
            }
        }
        Hits {
            valid: Mask::from_bits(valid),
            t: f32x16::new(t),
            u: f32x16::new(u),
            v: f32x16::new(v),
            instance,
            primitive,
        }
    }

    fn occluded16(&self, rays: &Rays, active: Mask, visible: Visible, _: Coherence) -> Mask {
        let mut hit = 0u16;
        if let Some((bvh, visible)) = self.tree(visible) {
            for i in active.iter() {
                hit |= u16::from(self.walk::<true>(bvh, &mut Walk::new(rays, i), visible)) << i;
            }
        }
        Mask::from_bits(hit)
    }
}
