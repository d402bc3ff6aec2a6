//! The light tree: selects one of many lights by an estimate of what it gives to a receiver (Conty Estevez and Kulla
//! 2018, "Importance Sampling of Many Lights with Adaptive Tree Splitting").
//!
//! A node has up to eight children. Each is a cluster of lights: the sphere around it, the cone around its normals,
//! its weight. A level costs one f32x8 evaluation a lane; the choice among eight is made for all lanes at once, by
//! one random number that is rescaled from level to level. A leaf is a light, or a few that look alike from
//! everywhere (the two halves of a quad), drawn by weight from an alias table; so a scene with one lamp is one leaf
//! and costs no traversal.
//!
//! With d the distance of a cluster's centre, r its radius, s = r / d, the importance is
//!
//!   weight · min(1, cosθ_receiver + s) · min(1, cosθ_light + spread + s) / d²,   d no less than r.
//!
//! The added terms bound the cosines over sphere and cone: the product is 0 only where no light of the cluster can
//! shine at the receiver. It needs no angles.

use super::Receiver;
use crate::math::alias::{BELOW_ONE, Bin, draw};
use crate::math::{Compare, LANES, Mask, f32x16, lanes, splat};
use glam::Vec3;
use wide::f32x8;

/// Children of a node.
pub(super) const WIDTH: usize = 8;

/// Bits of a trail a level.
pub(super) const TRAIL_BITS: u32 = WIDTH.trailing_zeros();

/// Marks links to leaves.
pub(super) const LEAF: u32 = 1 << 31;

/// Eight clusters.
#[derive(Clone, Debug)]
pub(super) struct Node {
    /// x, y, z of the centres, m.
    pub centre: [f32x8; 3],
    /// Radii of the spheres, m.
    pub radius: f32x8,
    /// x, y, z of the cones' unit axes; zero where there is none.
    pub axis: [f32x8; 3],
    /// What is added to the cosine to the axis.
    pub spread: f32x8,
    /// Weights; 0 for children that do not exist.
    pub weight: f32x8,
    /// A node, or a leaf with [`LEAF`] set.
    pub child: [u32; WIDTH],
}

/// Where a light is found.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Place {
    /// Which child to take, level by level from the lowest bits.
    pub trail: u64,
    /// Probability of the light in its leaf.
    pub pdf: f32,
}

/// The tree. See the module.
#[derive(Clone, Debug, Default)]
pub(super) struct LightTree {
    pub nodes: Vec<Node>,
    /// Where to start: node 0 or, if all lights are one leaf, that.
    pub root: u32,
    /// (first, count) of each leaf in `bins` and `order`.
    pub leaves: Vec<(u32, u32)>,
    /// Alias tables of the leaves.
    pub bins: Vec<Bin>,
    /// The lights, leaf by leaf, with their probabilities in the leaf.
    pub order: Vec<(u32, f32)>,
    /// By light.
    pub places: Vec<Place>,
}

/// The importances of the children of sixteen nodes, one node a lane.
struct Level {
    /// By lane.
    rows: [f32x8; LANES],
    /// By child.
    columns: [f32x16; WIDTH],
    total: f32x16,
}

/// Sixteen walks through the tree.
struct Way {
    /// Where they are.
    at: [u32; LANES],
    /// What is left of the random numbers.
    u: f32x16,
    probability: f32x16,
}

impl Node {
    /// The importance of each child at `p`, for light that arrives on the side of `n`; on both if `mirror` is −1
    /// instead of 1.
    #[inline(always)]
    fn importance(&self, p: Vec3, n: Vec3, mirror: f32) -> f32x8 {
        let (zero, one) = (f32x8::ZERO, f32x8::ONE);
        let [x, y, z] = [self.centre[0] - p.x, self.centre[1] - p.y, self.centre[2] - p.z];
        let d2 = x.mul_add(x, y.mul_add(y, z * z)).fast_max(self.radius * self.radius);
        let inverse = one / d2.sqrt();
        let s = self.radius * inverse;
        let along = x.mul_add(f32x8::splat(n.x), y.mul_add(f32x8::splat(n.y), z * n.z)) * inverse;
        let receives = (along.fast_max(along * mirror) + s).fast_min(one).fast_max(zero);
        let [a, b, c] = self.axis;
        let away = x.mul_add(a, y.mul_add(b, z * c)) * inverse;
        let emits = (self.spread + s - away).fast_min(one).fast_max(zero);
        self.weight * receives * emits * (inverse * inverse)
    }
}

/// Sixteen rows of eight, by child.
#[inline(always)]
fn transposed(rows: &[f32x8; LANES]) -> [f32x16; WIDTH] {
    let half = |start: usize| f32x8::transpose(std::array::from_fn(|i| rows[start + i]));
    let (low, high) = (half(0), half(LANES / 2));
    std::array::from_fn(|i| bytemuck::cast([low[i], high[i]]))
}

#[inline(always)]
fn sum(columns: &[f32x16; WIDTH]) -> f32x16 {
    columns.iter().fold(f32x16::ZERO, |sum, &column| sum + column)
}

impl LightTree {
    /// Whether the choice depends on the receiver.
    #[inline(always)]
    pub fn looks_at_receiver(&self) -> bool {
        !self.nodes.is_empty()
    }

    /// Evaluates the nodes `at` of the `pending` lanes.
    #[inline(always)]
    fn level(&self, from: &Receiver, mirror: &f32x16, at: &[u32; LANES], pending: Mask) -> Level {
        let mut rows = [f32x8::ZERO; LANES];
        for lane in pending.iter() {
            let node = &self.nodes[at[lane] as usize];
            rows[lane] = node.importance(from.p.lane(lane), from.n.lane(lane), mirror.as_array()[lane]);
        }
        let mut columns = transposed(&rows);
        let mut total = sum(&columns);
        // No child gives anything: any choice will do, as long as the probabilities add up to 1.
        let dark = pending.and_not(total.gt(f32x16::ZERO));
        if dark.any() {
            for lane in dark.iter() {
                rows[lane] = self.nodes[at[lane] as usize].weight;
            }
            columns = transposed(&rows);
            total = sum(&columns);
        }
        Level { rows, columns, total }
    }

    /// Selects a light for each `active` lane by `u` in [0, 1), and with which probability.
    #[inline(always)]
    pub fn select(&self, from: &Receiver, u: f32x16, active: Mask) -> ([u32; LANES], f32x16) {
        let mut way = Way { at: [self.root; LANES], u, probability: splat(1.0) };
        if self.looks_at_receiver() {
            self.descend(from, active, &mut way);
        }
        let (mut light, mut in_leaf) = ([0; LANES], [0.0; LANES]);
        for lane in active.iter() {
            let (first, count) = self.leaves[(way.at[lane] & !LEAF) as usize];
            let (first, count) = (first as usize, count as usize);
            let (k, _) = draw(&self.bins[first..first + count], way.u.as_array()[lane]);
            (light[lane], in_leaf[lane]) = self.order[first + k];
        }
        (light, way.probability * f32x16::new(in_leaf))
    }

    /// Walks from the root to a leaf in each `active` lane.
    fn descend(&self, from: &Receiver, active: Mask, way: &mut Way) {
        let (zero, one) = (f32x16::ZERO, splat(1.0));
        let mirror = from.mirror();
        let mut pending = active;
        while pending.any() {
            let level = self.level(from, &mirror, &way.at, pending);
            // Children up to the chosen one: the first whose running sum exceeds x. Rounding cannot lead to a child
            // of importance 0: u ≤ 1 − 2⁻²⁴ keeps x below the total.
            let x = way.u * level.total;
            let (mut running, mut below, mut mass, mut index) = (zero, zero, zero, zero);
            let mut passing = Mask::ALL;
            for column in level.columns {
                running += column;
                let passed = x.ge(running);
                mass = passing.and_not(passed).select(column, mass);
                below = passed.select(running, below);
                index += passed.keep(one);
                passing = passed;
            }
            way.u = pending.select(((x - below) / mass).fast_min(splat(BELOW_ONE)), way.u);
            way.probability = pending.select(way.probability * (mass / level.total), way.probability);
            let mut inner = 0;
            for lane in pending.iter() {
                // Beyond the last child only where importances are not finite.
                let child = (index.as_array()[lane] as usize).min(WIDTH - 1);
                let link = self.nodes[way.at[lane] as usize].child[child];
                way.at[lane] = link;
                inner |= u16::from(link & LEAF == 0) << lane;
            }
            pending = Mask::from_bits(inner);
        }
    }

    /// The probability with which [`LightTree::select`] finds `light`, for the `active` lanes.
    pub fn probability(&self, from: &Receiver, light: &[u32; LANES], active: Mask) -> f32x16 {
        let mut at = [self.root; LANES];
        let (mut trail, mut in_leaf) = ([0; LANES], [0.0; LANES]);
        for lane in active.iter() {
            Place { trail: trail[lane], pdf: in_leaf[lane] } = self.places[light[lane] as usize];
        }
        let mut probability = splat(1.0);
        let mirror = from.mirror();
        let mut pending = if self.looks_at_receiver() { active } else { Mask::NONE };
        while pending.any() {
            let level = self.level(from, &mirror, &at, pending);
            let mass = lanes(|i| level.rows[i].as_array()[trail[i] as usize % WIDTH]);
            probability = pending.select(probability * (mass / level.total), probability);
            let mut inner = 0;
            for lane in pending.iter() {
                at[lane] = self.nodes[at[lane] as usize].child[trail[lane] as usize % WIDTH];
                trail[lane] >>= TRAIL_BITS;
                inner |= u16::from(at[lane] & LEAF == 0) << lane;
            }
            pending = Mask::from_bits(inner);
        }
        probability * f32x16::new(in_leaf)
    }
}
