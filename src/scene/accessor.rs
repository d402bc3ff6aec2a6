//! Accessors: typed arrays in buffers. Every component type, stride and sparse substitution, normalised integers
//! (specification section 3.6); every read is checked against the buffer before anything is allocated.

use super::document::Document;
use crate::error::Result;
use gltf::json::accessor::{Accessor, ComponentType, Type};
use gltf::json::validation::Checked;

/// An accessor with its types resolved.
struct Layout<'a> {
    entry: &'a Accessor,
    component: ComponentType,
    /// Components of an element.
    width: usize,
    /// Elements.
    count: usize,
}

/// Elements `size` bytes long that lie `stride` apart in `bytes`.
struct Elements<'a> {
    bytes: &'a [u8],
    stride: usize,
    size: usize,
}

impl<'a> Elements<'a> {
    /// Checked so that all of `count` elements lie inside; `None` where they do not.
    fn new(bytes: &'a [u8], offset: u64, stride: usize, size: usize, count: usize) -> Option<Self> {
        let bytes = bytes.get(usize::try_from(offset).ok()?..)?;
        let needed = match count {
            0 => 0,
            n => (n - 1).checked_mul(stride)?.checked_add(size)?,
        };
        Some(Self { bytes: bytes.get(..needed)?, stride, size })
    }

    fn iter(&self) -> impl Iterator<Item = &'a [u8]> {
        let (bytes, stride, size) = (self.bytes, self.stride.max(1), self.size);
        bytes.chunks(stride).filter_map(move |chunk| chunk.get(..size))
    }
}

/// Reads one component; normalised integers become [0, 1] or [−1, 1].
fn component(kind: ComponentType, normalised: bool, raw: &[u8]) -> f32 {
    match (kind, raw) {
        (ComponentType::F32, &[a, b, c, d]) => f32::from_le_bytes([a, b, c, d]),
        (ComponentType::U8, &[a]) => scaled(f32::from(a), 255.0, normalised),
        (ComponentType::I8, &[a]) => scaled(f32::from(a as i8), 127.0, normalised),
        (ComponentType::U16, &[a, b]) => scaled(f32::from(u16::from_le_bytes([a, b])), 65535.0, normalised),
        (ComponentType::I16, &[a, b]) => scaled(f32::from(i16::from_le_bytes([a, b])), 32767.0, normalised),
        (ComponentType::U32, &[a, b, c, d]) => {
            scaled(u32::from_le_bytes([a, b, c, d]) as f32, 4294967295.0, normalised)
        }
        // Slices have the size of their type.
        _ => 0.0,
    }
}

fn scaled(value: f32, max: f32, normalised: bool) -> f32 {
    if normalised { (value / max).max(-1.0) } else { value }
}

fn unsigned(kind: ComponentType, raw: &[u8]) -> u32 {
    match (kind, raw) {
        (ComponentType::U8, &[a]) => u32::from(a),
        (ComponentType::U16, &[a, b]) => u32::from(u16::from_le_bytes([a, b])),
        (ComponentType::U32, &[a, b, c, d]) => u32::from_le_bytes([a, b, c, d]),
        _ => u32::MAX,
    }
}

impl Document {
    fn layout(&self, accessor: usize, at: &str) -> Result<Layout<'_>> {
        let missing = || self.reject(at, format!("names accessor {accessor}, which does not exist"));
        let entry = self.root.accessors.get(accessor).ok_or_else(missing)?;
        let place = || format!("accessors[{accessor}]");
        let Checked::Valid(component) = entry.component_type else {
            return Err(
                self.reject(format!("{}.componentType", place()), "is none of glTF's component types")
            );
        };
        let width = match entry.type_ {
            Checked::Valid(Type::Scalar) => 1,
            Checked::Valid(Type::Vec2) => 2,
            Checked::Valid(Type::Vec3) => 3,
            Checked::Valid(Type::Vec4) => 4,
            Checked::Valid(_) => {
                return Err(self.reject(at, "names a matrix accessor, which is not one here"));
            }
            Checked::Invalid => {
                return Err(self.reject(format!("{}.type", place()), "is none of glTF's types"));
            }
        };
        let count = usize::try_from(entry.count.0).ok().filter(|&n| n <= u32::MAX as usize);
        let count = count.ok_or_else(|| {
            self.reject(
                format!("{}.count", place()),
                format!("{} elements; at most 2^32 are read", entry.count.0),
            )
        })?;
        Ok(Layout { entry, component: component.0, width, count })
    }

    /// How many components an element of the accessor has, and how many elements there are.
    pub(super) fn shape(&self, accessor: usize, at: &str) -> Result<(usize, usize)> {
        self.layout(accessor, at).map(|layout| (layout.width, layout.count))
    }

    /// The elements of the accessor's own view; `None` where it has none (all zero).
    fn elements(&self, accessor: usize, layout: &Layout) -> Result<Option<Elements<'_>>> {
        let Some(view) = layout.entry.buffer_view else { return Ok(None) };
        let (bytes, stride) = self.view(view.value())?;
        let size = layout.component.size() * layout.width;
        let stride = stride.unwrap_or(size);
        let at = || format!("accessors[{accessor}]");
        if stride < size {
            let what = format!("elements of {size} bytes overlap at a stride of {stride}");
            return Err(self.reject(at(), what));
        }
        let offset = layout.entry.byte_offset.map_or(0, |o| o.0);
        let elements = Elements::new(bytes, offset, stride, size, layout.count);
        elements.map(Some).ok_or_else(|| {
            let what = format!("{} elements reach past the end of bufferView {}", layout.count, view.value());
            self.reject(at(), what)
        })
    }

    /// Reads vectors of N floats, of any component type, normalised where the accessor says so.
    pub(super) fn read_floats<const N: usize>(&self, accessor: usize, at: &str) -> Result<Vec<[f32; N]>> {
        let layout = self.layout(accessor, at)?;
        if layout.width != N {
            let what = format!("accessor {accessor} has {} components where {N} are needed", layout.width);
            return Err(self.reject(at, what));
        }
        let elements = self.elements(accessor, &layout)?;
        self.budget.take_array(layout.count as u64, 4 * N as u64, "vertex data")?;
        let mut values = match &elements {
            Some(elements) => self.decode(&layout, elements),
            None => vec![[0.0; N]; layout.count],
        };
        self.substitute(accessor, &layout, &mut values)?;
        Ok(values)
    }

    fn decode<const N: usize>(&self, layout: &Layout, elements: &Elements) -> Vec<[f32; N]> {
        let (kind, normalised) = (layout.component, layout.entry.normalized);
        let size = kind.size();
        let mut values = Vec::with_capacity(layout.count);
        values.extend(elements.iter().map(|element| {
            let mut value = [0.0; N];
            for (v, raw) in value.iter_mut().zip(element.chunks_exact(size)) {
                *v = component(kind, normalised, raw);
            }
            value
        }));
        values
    }

    /// Reads vertex indices: unsigned scalars.
    pub(super) fn read_indices(&self, accessor: usize, at: &str) -> Result<Vec<u32>> {
        let layout = self.layout(accessor, at)?;
        let is_unsigned =
            matches!(layout.component, ComponentType::U8 | ComponentType::U16 | ComponentType::U32);
        if layout.width != 1 || !is_unsigned {
            let what = format!("accessor {accessor} is not an array of unsigned integers");
            return Err(self.reject(at, what));
        }
        let elements = self.elements(accessor, &layout)?;
        self.budget.take_array(layout.count as u64, 4, "vertex indices")?;
        let kind = layout.component;
        let mut values: Vec<[u32; 1]> = match &elements {
            Some(elements) => elements.iter().map(|raw| [unsigned(kind, raw)]).collect(),
            None => vec![[0]; layout.count],
        };
        self.sparse(accessor, &layout, &mut values, |_, raw| unsigned(kind, raw))?;
        Ok(values.into_iter().map(|[v]| v).collect())
    }

    fn substitute<const N: usize>(
        &self,
        accessor: usize,
        layout: &Layout,
        values: &mut [[f32; N]],
    ) -> Result<()> {
        let (kind, normalised) = (layout.component, layout.entry.normalized);
        self.sparse(accessor, layout, values, |_, raw| component(kind, normalised, raw))
    }

    /// Overwrites the elements that the accessor's sparse part names.
    fn sparse<T: Copy, const N: usize>(
        &self,
        accessor: usize,
        layout: &Layout,
        values: &mut [[T; N]],
        read: impl Fn(ComponentType, &[u8]) -> T,
    ) -> Result<()> {
        let Some(sparse) = &layout.entry.sparse else { return Ok(()) };
        let at = || format!("accessors[{accessor}].sparse");
        let count = usize::try_from(sparse.count.0).ok().filter(|&n| n <= layout.count);
        let count = count.ok_or_else(|| {
            self.reject(at(), format!("replaces {} of {} elements", sparse.count.0, layout.count))
        })?;
        let Checked::Valid(index_type) = sparse.indices.component_type else {
            return Err(self.reject(at(), "its indices are not unsigned integers"));
        };
        let kind = layout.component;
        let size = kind.size() * layout.width;
        let (bytes, _) = self.view(sparse.indices.buffer_view.value())?;
        let width = index_type.0.size();
        let indices = Elements::new(bytes, sparse.indices.byte_offset.0, width, width, count);
        let (bytes, _) = self.view(sparse.values.buffer_view.value())?;
        let replacements = Elements::new(bytes, sparse.values.byte_offset.0, size, size, count);
        let (Some(indices), Some(replacements)) = (indices, replacements) else {
            return Err(self.reject(at(), "reaches past the end of its bufferView"));
        };
        for (index, raw) in indices.iter().zip(replacements.iter()) {
            let index = unsigned(index_type.0, index) as usize;
            let Some(value) = values.get_mut(index) else {
                return Err(self.reject(at(), format!("replaces element {index} of {}", layout.count)));
            };
            for (v, raw) in value.iter_mut().zip(raw.chunks_exact(kind.size())) {
                *v = read(kind, raw);
            }
        }
        Ok(())
    }
}
