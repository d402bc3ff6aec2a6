//! A glTF primitive to a [`Mesh`]: attributes, triangulation, baking into world space, and the repairs that make
//! every float finite and every triangle one with an area.

use super::document::{Document, one_line};
use super::{LoadReport, Material, Mesh, tangents};
use crate::error::Result;
use glam::{Affine3A, Mat3A, Vec2, Vec3, Vec3A, Vec4};
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;

/// Largest coordinate, m: beyond it products of lengths leave f32.
const MAX_COORDINATE: f32 = 1e12;
/// Smallest squared double area, m⁴: below it a normal is not to be had in f32.
const MIN_AREA_SQUARED: f32 = 1e-37;
/// Smallest ratio of a triangle's double area to its longest edge squared, squared: corners on one line, in f64.
const MIN_FLATNESS_SQUARED: f64 = 1e-30;

/// A mesh while it is being put together.
pub(super) struct Draft {
    pub(super) positions: Vec<Vec3A>,
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) normals: Option<Vec<Vec3>>,
    pub(super) tangents: Option<Vec<Vec4>>,
    pub(super) uvs: [Option<Vec<Vec2>>; 2],
    pub(super) colors: Option<Vec<Vec4>>,
}

/// What a primitive needs to know of the rest of the scene.
pub(super) struct Context<'a> {
    pub(super) document: &'a Document,
    pub(super) materials: &'a [Material],
    /// The index of glTF's default material.
    pub(super) default_material: u32,
}

/// Reads primitive `k` of mesh `i`, into world space where `bake` is given; `None` where nothing is left to render.
pub(super) fn read(
    context: &Context,
    i: usize,
    k: usize,
    bake: Option<&Affine3A>,
    report: &mut LoadReport,
) -> Result<Option<Mesh>> {
    let document = context.document;
    let Some(entry) = document.root.meshes.get(i) else { return Ok(None) };
    let Some(primitive) = entry.primitives.get(k) else { return Ok(None) };
    let at = format!("meshes[{i}].primitives[{k}]");
    let material = primitive.material.map_or(context.default_material, |m| m.value() as u32);
    let Some(mut draft) = read_draft(document, primitive, &at, report)? else { return Ok(None) };
    if let Some(material) = context.materials.get(material as usize) {
        keep_used_uvs(&mut draft, material, &at, report);
    }
    if draft.normals.is_none() {
        draft.tangents = None;
    }
    if let Some(to_world) = bake.filter(|m| **m != Affine3A::IDENTITY) {
        draft.transform(to_world);
    }
    let dropped = draft.drop_bad_triangles();
    if dropped > 0 {
        report.dropped_triangles += dropped;
        report.warn(format!("{at}: {dropped} triangles are degenerate or not finite; they are dropped"));
    }
    if draft.triangles.is_empty() {
        return Ok(None);
    }
    draft.repair_normals();
    let normal_map = context.materials.get(material as usize).and_then(|m| m.normal_texture);
    match normal_map {
        Some(texture) => tangents::provide(&mut draft, usize::from(texture.uv_set), &at, report),
        None => draft.tangents = None,
    }
    let base = entry.name.as_deref().map_or_else(|| format!("mesh {i}"), one_line);
    let name = if entry.primitives.len() > 1 { format!("{base}.{k}") } else { base };
    Ok(Some(Mesh {
        name,
        positions: draft.positions.into(),
        triangles: draft.triangles.into(),
        normals: draft.normals,
        tangents: draft.tangents,
        uvs: draft.uvs,
        colors: draft.colors,
        material,
    }))
}

fn read_draft(
    document: &Document,
    primitive: &Primitive,
    at: &str,
    report: &mut LoadReport,
) -> Result<Option<Draft>> {
    let Checked::Valid(mode) = primitive.mode else {
        return Err(document.reject(format!("{at}.mode"), "is none of glTF's topologies (0 to 6)"));
    };
    if matches!(mode, Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip) {
        report.warn("points and lines are not rendered; their primitives are skipped".into());
        return Ok(None);
    }
    if primitive.targets.as_ref().is_some_and(|t| !t.is_empty()) {
        report.warn("morph targets are not honoured: meshes are shown in their base shape".into());
    }
    let attribute = |semantic: Semantic| {
        let key = format!("{at}.attributes.{}", name_of(&semantic));
        primitive.attributes.get(&Checked::Valid(semantic)).map(|a| (a.value(), key))
    };
    let Some((accessor, place)) = attribute(Semantic::Positions) else {
        report.warn(format!("{at}: has no POSITION; it is skipped"));
        return Ok(None);
    };
    let positions = document.read_floats::<3>(accessor, &place)?;
    let count = positions.len();
    let same_length = |place: &str, n: usize| {
        if n == count {
            Ok(())
        } else {
            Err(document.reject(place, format!("has {n} elements for {count} positions")))
        }
    };
    let mut normals = None;
    if let Some((accessor, place)) = attribute(Semantic::Normals) {
        let values = document.read_floats::<3>(accessor, &place)?;
        same_length(&place, values.len())?;
        normals = Some(values.into_iter().map(Vec3::from_array).collect());
    }
    let mut tangents = None;
    if let Some((accessor, place)) = attribute(Semantic::Tangents) {
        let values = document.read_floats::<4>(accessor, &place)?;
        same_length(&place, values.len())?;
        tangents = Some(values.into_iter().map(Vec4::from_array).collect());
    }
    let mut uvs = [None, None];
    for (set, uvs) in uvs.iter_mut().enumerate() {
        if let Some((accessor, place)) = attribute(Semantic::TexCoords(set as u32)) {
            let values = document.read_floats::<2>(accessor, &place)?;
            same_length(&place, values.len())?;
            *uvs = Some(values.into_iter().map(|v| finite_or(Vec2::from_array(v), Vec2::ZERO)).collect());
        }
    }
    let mut colors = None;
    if let Some((accessor, place)) = attribute(Semantic::Colors(0)) {
        let values = read_colors(document, accessor, &place)?;
        same_length(&place, values.len())?;
        colors = Some(values);
    }
    if attribute(Semantic::Colors(1)).is_some() {
        report.warn("vertex colours beyond COLOR_0 are not honoured".into());
    }
    let corners = match primitive.indices {
        Some(accessor) => document.read_indices(accessor.value(), &format!("{at}.indices"))?,
        None => {
            document.budget.take_array(count as u64, 4, "vertex indices")?;
            (0..count as u32).collect()
        }
    };
    if let Some((n, index)) = corners.iter().enumerate().find(|&(_, &index)| index as usize >= count) {
        let what =
            format!("index {index} (element {n}) is out of range, there are {count} vertices; export again");
        return Err(document.reject(format!("{at}.indices"), what));
    }
    // Positions of 16 bytes and three indices a corner of a strip.
    document.budget.take(16 * count as u64 + 12 * corners.len() as u64, "triangles")?;
    let positions = positions.into_iter().map(Vec3A::from_array).collect();
    let triangles = triangulate(mode, &corners);
    if mode == Mode::Triangles && !corners.len().is_multiple_of(3) {
        report.warn(format!("{at}: the last triangle is incomplete; it is left out"));
    }
    Ok(Some(Draft { positions, triangles, normals, tangents, uvs, colors }))
}

fn name_of(semantic: &Semantic) -> String {
    match semantic {
        Semantic::Positions => "POSITION".into(),
        Semantic::Normals => "NORMAL".into(),
        Semantic::Tangents => "TANGENT".into(),
        Semantic::Colors(set) => format!("COLOR_{set}"),
        Semantic::TexCoords(set) => format!("TEXCOORD_{set}"),
        Semantic::Joints(set) => format!("JOINTS_{set}"),
        Semantic::Weights(set) => format!("WEIGHTS_{set}"),
        Semantic::Extras(name) => one_line(name),
    }
}

fn finite_or(value: Vec2, other: Vec2) -> Vec2 {
    if value.is_finite() { value } else { other }
}

/// Colours with or without alpha, held in [0, 1]; what is not a number is white.
fn read_colors(document: &Document, accessor: usize, at: &str) -> Result<Vec<Vec4>> {
    let hold = |v: f32| if v.is_nan() { 1.0 } else { v.clamp(0.0, 1.0) };
    if document.shape(accessor, at)?.0 == 3 {
        let values = document.read_floats::<3>(accessor, at)?;
        return Ok(values.into_iter().map(|v| Vec3::from_array(v.map(hold)).extend(1.0)).collect());
    }
    let values = document.read_floats::<4>(accessor, at)?;
    Ok(values.into_iter().map(|v| Vec4::from_array(v.map(hold))).collect())
}

/// Triangles of a list, strip or fan, in the order and winding of the specification.
fn triangulate(mode: Mode, corners: &[u32]) -> Vec<[u32; 3]> {
    match mode {
        Mode::Triangles => corners.as_chunks::<3>().0.to_vec(),
        Mode::TriangleStrip => corners
            .windows(3)
            .enumerate()
            .filter_map(|(i, w)| match *w {
                [a, b, c] => Some(if i % 2 == 0 { [a, b, c] } else { [a, c, b] }),
                _ => None,
            })
            .collect(),
        Mode::TriangleFan => {
            let Some((&hub, rim)) = corners.split_first() else { return Vec::new() };
            rim.windows(2)
                .filter_map(|w| match *w {
                    [a, b] => Some([a, b, hub]),
                    _ => None,
                })
                .collect()
        }
        _ => Vec::new(),
    }
}

/// Drops the coordinate sets that the material does not read; fills the ones it reads and the mesh has not.
fn keep_used_uvs(draft: &mut Draft, material: &Material, at: &str, report: &mut LoadReport) {
    let count = draft.positions.len();
    for (set, uvs) in draft.uvs.iter_mut().enumerate() {
        let is_used = material.texture_refs().any(|t| usize::from(t.uv_set) == set);
        if !is_used {
            *uvs = None;
        } else if uvs.is_none() {
            report.warn(format!("{at}: its material reads TEXCOORD_{set}, which is missing; (0, 0) is used"));
            *uvs = Some(vec![Vec2::ZERO; count]);
        }
    }
}

impl Draft {
    /// The corners of a triangle; indices were checked when they were read.
    fn corners(&self, triangle: [u32; 3]) -> [Vec3A; 3] {
        triangle.map(|index| self.positions[index as usize])
    }

    /// Into the space of `m`. A mirroring turns the winding, so that the front stays the front.
    fn transform(&mut self, m: &Affine3A) {
        let is_mirror = m.matrix3.determinant() < 0.0;
        for p in &mut self.positions {
            *p = m.transform_point3a(*p);
        }
        // Normals go by the inverse transpose, up to length the matrix of cofactors times the determinant's sign.
        let sign = if is_mirror { -1.0 } else { 1.0 };
        let (x, y, z) = (m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis);
        let cofactors = Mat3A::from_cols(y.cross(z), z.cross(x), x.cross(y)) * sign;
        for n in self.normals.iter_mut().flatten() {
            *n = (cofactors * Vec3A::from(*n)).into();
        }
        for t in self.tangents.iter_mut().flatten() {
            *t = (m.matrix3 * Vec3A::from(t.truncate())).extend(t.w * sign);
        }
        if is_mirror {
            self.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
    }

    /// Removes triangles without area or with coordinates that cannot be computed with, and sets the coordinates
    /// of vertices that nobody uses any more to zero. Returns how many were removed.
    fn drop_bad_triangles(&mut self) -> u64 {
        let before = self.triangles.len();
        let positions = &self.positions;
        self.triangles.retain(|triangle| {
            let [a, b, c] = triangle.map(|index| positions[index as usize]);
            in_range(a) && in_range(b) && in_range(c) && has_area(a, b, c)
        });
        for p in &mut self.positions {
            if !in_range(*p) {
                *p = Vec3A::ZERO;
            }
        }
        (before - self.triangles.len()) as u64
    }

    /// Normals of unit length; where there was none to normalise, that of the triangles around the vertex.
    fn repair_normals(&mut self) {
        let Some(mut normals) = self.normals.take() else { return };
        let mut broken = false;
        for n in &mut normals {
            *n = unit(*n).unwrap_or_else(|| {
                broken = true;
                Vec3::ZERO
            });
        }
        if broken {
            let around = self.area_normals();
            for (n, around) in normals.iter_mut().zip(around) {
                if *n == Vec3::ZERO {
                    *n = around;
                }
            }
        }
        self.normals = Some(normals);
    }

    /// The mean of the geometric normals around each vertex, by area.
    fn area_normals(&self) -> Vec<Vec3> {
        let mut sums = vec![Vec3::ZERO; self.positions.len()];
        for &triangle in &self.triangles {
            let [a, b, c] = self.corners(triangle);
            let normal = Vec3::from((b - a).cross(c - a));
            for index in triangle {
                sums[index as usize] += normal;
            }
        }
        sums.into_iter().map(|n| unit(n).unwrap_or(Vec3::Z)).collect()
    }

    /// Three vertices of its own for every triangle, with the geometric normal: flat shading with normals.
    pub(super) fn flatten(&mut self) {
        let order: Vec<u32> = self.triangles.iter().flatten().copied().collect();
        let flat = self.triangles.iter().flat_map(|&triangle| {
            let [a, b, c] = self.corners(triangle);
            [unit((b - a).cross(c - a).into()).unwrap_or(Vec3::Z); 3]
        });
        let normals = Some(flat.collect());
        self.reorder(&order);
        self.normals = normals;
        self.triangles = (0..order.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    }

    /// Makes vertex n a copy of vertex `order[n]`, in every attribute but the tangents.
    pub(super) fn reorder(&mut self, order: &[u32]) {
        fn pick<T: Copy>(values: &[T], order: &[u32]) -> Vec<T> {
            order.iter().map(|&index| values[index as usize]).collect()
        }
        self.positions = pick(&self.positions, order);
        self.normals = self.normals.take().map(|v| pick(&v, order));
        self.colors = self.colors.take().map(|v| pick(&v, order));
        for uvs in &mut self.uvs {
            *uvs = uvs.take().map(|v| pick(&v, order));
        }
    }
}

/// Whether the renderer can compute with a position.
fn in_range(p: Vec3A) -> bool {
    !p.is_nan() && p.abs().max_element() <= MAX_COORDINATE
}

/// Whether a normal can be computed: in f64 the corners are not on one line, in f32 the cross product is not zero.
fn has_area(a: Vec3A, b: Vec3A, c: Vec3A) -> bool {
    let area = (b - a).cross(c - a).length_squared();
    let [a, b, c] = [a, b, c].map(|p| Vec3::from(p).as_dvec3());
    let (ab, ac, bc) = (b - a, c - a, c - b);
    let longest = ab.length_squared().max(ac.length_squared()).max(bc.length_squared());
    let flatness = ab.cross(ac).length_squared();
    area > MIN_AREA_SQUARED && area.is_finite() && flatness > MIN_FLATNESS_SQUARED * longest * longest
}

/// A vector of unit length, in f64 so that no length under- or overflows; `None` for zero or not finite.
pub(super) fn unit(v: Vec3) -> Option<Vec3> {
    let v = v.as_dvec3();
    let length = v.length();
    (length > 0.0 && length.is_finite()).then(|| (v / length).as_vec3()).filter(|v| v.is_finite())
}
