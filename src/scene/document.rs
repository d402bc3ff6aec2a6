//! A glTF file with its buffers in memory, references checked, nothing decoded yet.

use super::budget::Budget;
use super::container::{self, Fault, Parsed};
use super::uri::{self, Refusal, Target};
use super::{LoadReport, references};
use crate::error::{Error, Result};
use gltf::json::Root;
use std::io::Read;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Extensions that are honoured.
pub(super) const HONOURED: [&str; 11] = [
    "EXT_mesh_gpu_instancing",
    "EXT_texture_webp",
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
];

/// Where a buffer's bytes are.
enum Buffer {
    /// In the GLB's binary chunk.
    Chunk(Range<usize>),
    /// Read from a file or a data URI.
    Owned(Vec<u8>),
    /// Declared without data; an error only for who uses it.
    Absent,
}

/// The file in memory.
pub(super) struct Document {
    pub(super) path: PathBuf,
    pub(super) root: Root,
    pub(super) budget: Budget,
    file: Vec<u8>,
    buffers: Vec<Buffer>,
}

impl Document {
    /// Reads the file and its buffers; checks version, required extensions and every index.
    pub(super) fn open(path: &Path, max_memory: u64, report: &mut LoadReport) -> Result<Self> {
        let budget = Budget::new(max_memory);
        let file = uri::read_input(path, max_memory)?;
        budget.take(file.len() as u64, "the scene file")?;
        let reject = |(at, what): Fault| Error::Scene { path: path.into(), at, what };
        let chunks = container::split(&file).map_err(reject)?;
        let json = file.get(chunks.json).unwrap_or_default();
        // The tree of JSON values takes several times its text.
        budget.take_array(json.len() as u64, 8, "the scene's JSON")?;
        let Parsed { root, is_animated } = container::parse(json).map_err(reject)?;
        check_asset(&root).map_err(reject)?;
        references::check(&root).map_err(reject)?;
        report.generator = one_line(root.asset.generator.as_deref().unwrap_or_default());
        sort_extensions(&root, report);
        if is_animated {
            report.warn("animations are not honoured: the scene is shown at rest".into());
        }
        let mut document = Self { path: path.into(), root, budget, file, buffers: Vec::new() };
        for i in 0..document.root.buffers.len() {
            let buffer = document.load_buffer(i, chunks.binary.clone())?;
            document.buffers.push(buffer);
        }
        Ok(document)
    }

    /// An error at a place in this file.
    pub(super) fn reject(&self, at: impl Into<String>, what: impl Into<String>) -> Error {
        Error::Scene { path: self.path.clone(), at: at.into(), what: what.into() }
    }

    /// The bytes of a view and its stride.
    pub(super) fn view(&self, view: usize) -> Result<(&[u8], Option<usize>)> {
        let at = || format!("bufferViews[{view}]");
        let entry = self
            .root
            .buffer_views
            .get(view)
            .ok_or_else(|| self.reject(at(), "there is no such bufferView"))?;
        let index = entry.buffer.value();
        let bytes: &[u8] = match self.buffers.get(index) {
            Some(Buffer::Chunk(range)) => self.file.get(range.clone()).unwrap_or_default(),
            Some(Buffer::Owned(bytes)) => bytes,
            Some(Buffer::Absent) | None => {
                return Err(
                    self.reject(format!("buffers[{index}]"), "has no data: no URI and no binary chunk")
                );
            }
        };
        let start = entry.byte_offset.map_or(0, |o| o.0);
        let range = usize::try_from(start).ok().zip(usize::try_from(entry.byte_length.0).ok());
        let slice = range.and_then(|(start, length)| bytes.get(start..start.checked_add(length)?));
        let slice =
            slice.ok_or_else(|| self.reject(at(), format!("reaches past the end of buffer {index}")))?;
        Ok((slice, entry.byte_stride.map(|s| s.0)))
    }

    fn load_buffer(&self, i: usize, chunk: Option<Range<usize>>) -> Result<Buffer> {
        let Some(entry) = self.root.buffers.get(i) else { return Ok(Buffer::Absent) };
        let at = format!("buffers[{i}]");
        let wanted = entry.byte_length.0;
        let short = |found: usize| {
            self.reject(
                at.clone(),
                format!("has {found} of its {wanted} bytes; copy or export the file again"),
            )
        };
        let Some(uri) = &entry.uri else {
            return match chunk.filter(|_| i == 0) {
                Some(range) if (range.len() as u64) < wanted => Err(short(range.len())),
                Some(range) => Ok(Buffer::Chunk(range)),
                None => Ok(Buffer::Absent),
            };
        };
        let bytes = self.fetch(uri, "buffer").map_err(|refusal| match refusal {
            Fetch::Missing(path, why) => {
                let scene = self.path.display();
                Error::Input { path, what: format!("{why} (buffer {i} of {scene}); put it beside the scene") }
            }
            Fetch::Corrupt(why) | Fetch::Forbidden(why) => self.reject(format!("{at}.uri"), why),
            Fetch::Fatal(error) => error,
        })?;
        if (bytes.len() as u64) < wanted {
            return Err(short(bytes.len()));
        }
        Ok(Buffer::Owned(bytes))
    }

    /// The bytes that a URI names.
    pub(super) fn fetch(&self, uri: &str, kind: &str) -> std::result::Result<Vec<u8>, Fetch> {
        match uri::parse(uri).map_err(Fetch::Forbidden)? {
            Target::Data { payload, is_base64 } => {
                self.budget.take(payload.len() as u64, kind).map_err(Fetch::Fatal)?;
                let bytes =
                    if is_base64 { uri::decode_base64(payload) } else { uri::decode_percent(payload) };
                bytes.ok_or_else(|| {
                    Fetch::Corrupt("data: URI that cannot be decoded; export the file again".into())
                })
            }
            Target::File(relative) => {
                let parent = self.path.parent().filter(|p| !p.as_os_str().is_empty());
                let folder = parent.unwrap_or(Path::new("."));
                let (file, length, real) = uri::open_below(folder, &relative)?;
                self.budget.take(length, kind).map_err(Fetch::Fatal)?;
                let mut bytes = Vec::with_capacity(usize::try_from(length).unwrap_or(0));
                let read = file.take(length).read_to_end(&mut bytes);
                read.map_err(|e| Fetch::Missing(real, uri::reason(&e)))?;
                Ok(bytes)
            }
        }
    }
}

/// Why a URI gave no bytes.
pub(super) enum Fetch {
    /// It breaks the rules of the sandbox.
    Forbidden(String),
    /// Its data cannot be decoded.
    Corrupt(String),
    /// No such file, or not readable.
    Missing(PathBuf, String),
    /// Ends the load whatever it is for.
    Fatal(Error),
}

impl From<Refusal> for Fetch {
    fn from(refusal: Refusal) -> Self {
        match refusal {
            Refusal::Forbidden(why) => Self::Forbidden(why),
            Refusal::Missing(path, why) => Self::Missing(path, why),
        }
    }
}

/// Text of a file on one line and short, for messages.
pub(super) fn one_line(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).take(120).collect()
}

fn check_asset(root: &Root) -> std::result::Result<(), Fault> {
    let version = |text: &str| -> Option<(u32, u32)> {
        let (major, minor) = text.split_once('.')?;
        Some((major.parse().ok()?, minor.parse().ok()?))
    };
    let shown = one_line(&root.asset.version);
    let Some((major, minor)) = version(&root.asset.version) else {
        return Err(("asset.version".into(), format!("`{shown}` is not a version; glTF 2.0 is read")));
    };
    if major != 2 {
        return Err(("asset.version".into(), format!("glTF {shown}; only 2.x is read: convert the file")));
    }
    if let Some(text) = &root.asset.min_version
        && version(text).is_none_or(|min| min > (2, 0) || min > (major, minor))
    {
        return Err(("asset.minVersion".into(), format!("needs glTF {}; 2.0 is read", one_line(text))));
    }
    for (i, name) in root.extensions_required.iter().enumerate() {
        if !HONOURED.contains(&name.as_str()) {
            let what =
                format!("the file requires {}, which is not supported; export without it", one_line(name));
            return Err((format!("extensionsRequired[{i}]"), what));
        }
    }
    Ok(())
}

fn sort_extensions(root: &Root, report: &mut LoadReport) {
    let mut names: Vec<String> =
        root.extensions_used.iter().chain(&root.extensions_required).map(|n| one_line(n)).collect();
    names.sort();
    names.dedup();
    for name in names {
        if HONOURED.contains(&name.as_str()) {
            report.extensions_honoured.push(name);
        } else {
            report.warn(format!("extension {name} is used and not honoured"));
            report.extensions_ignored.push(name);
        }
    }
}
