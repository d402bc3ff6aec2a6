//! Extensions come as raw JSON: typed, checked access to their fields, each with its JSON path for messages.

use super::LoadReport;
use super::document::Document;
use crate::error::Result;
use glam::{Vec2, Vec3};
use serde_json::{Map, Value};

/// A JSON object at a place in the file.
pub(super) struct Fields<'a> {
    document: &'a Document,
    map: &'a Map<String, Value>,
    at: String,
}

/// A use of a texture as written in the file.
pub(super) struct RawTexture<'a> {
    pub(super) index: usize,
    pub(super) tex_coord: u64,
    pub(super) transform: Option<Fields<'a>>,
    pub(super) at: String,
}

impl<'a> Fields<'a> {
    /// The extension `name` of a thing at `at`, if it is there.
    pub(super) fn extension(
        document: &'a Document,
        others: Option<&'a Map<String, Value>>,
        at: &str,
        name: &str,
    ) -> Result<Option<Self>> {
        match others.and_then(|map| map.get(name)) {
            None => Ok(None),
            Some(value) => {
                let dot = if at.is_empty() { "" } else { "." };
                Self::object(document, value, format!("{at}{dot}extensions.{name}")).map(Some)
            }
        }
    }

    fn object(document: &'a Document, value: &'a Value, at: String) -> Result<Self> {
        match value {
            Value::Object(map) => Ok(Self { document, map, at }),
            _ => Err(document.reject(at, "is not a JSON object")),
        }
    }

    pub(super) fn at(&self, key: &str) -> String {
        format!("{}.{key}", self.at)
    }

    /// The object under `key`.
    pub(super) fn child(&self, key: &str) -> Result<Option<Self>> {
        self.map.get(key).map(|value| Self::object(self.document, value, self.at(key))).transpose()
    }

    /// The objects of the array under `key`.
    pub(super) fn children(&self, key: &str) -> Result<Vec<Self>> {
        let Some(value) = self.map.get(key) else { return Ok(Vec::new()) };
        let Value::Array(items) = value else {
            return Err(self.document.reject(self.at(key), "is not an array"));
        };
        let place = |i| format!("{}[{i}]", self.at(key));
        items.iter().enumerate().map(|(i, v)| Self::object(self.document, v, place(i))).collect()
    }

    pub(super) fn text(&self, key: &str) -> Option<&'a str> {
        self.map.get(key).and_then(Value::as_str)
    }

    pub(super) fn has(&self, key: &str) -> bool {
        self.map.contains_key(key)
    }

    /// An unsigned integer, `None` where absent.
    pub(super) fn integer(&self, key: &str) -> Result<Option<u64>> {
        let not = || self.document.reject(self.at(key), "is not an unsigned integer");
        self.map.get(key).map(|value| value.as_u64().ok_or_else(not)).transpose()
    }

    /// A finite number, or the default.
    pub(super) fn number(&self, key: &str, default: f32) -> Result<f32> {
        let Some(value) = self.map.get(key) else { return Ok(default) };
        let number = value.as_f64().map(|v| v as f32).filter(|v| v.is_finite());
        number.ok_or_else(|| self.document.reject(self.at(key), "is not a finite number"))
    }

    fn array<const N: usize>(&self, key: &str, default: [f32; N]) -> Result<[f32; N]> {
        let Some(value) = self.map.get(key) else { return Ok(default) };
        let not = || self.document.reject(self.at(key), format!("is not an array of {N} finite numbers"));
        let items = value.as_array().filter(|items| items.len() == N).ok_or_else(not)?;
        let mut out = default;
        for (out, item) in out.iter_mut().zip(items) {
            *out = item.as_f64().map(|v| v as f32).filter(|v| v.is_finite()).ok_or_else(not)?;
        }
        Ok(out)
    }

    pub(super) fn vec2(&self, key: &str, default: Vec2) -> Result<Vec2> {
        self.array(key, default.to_array()).map(Vec2::from_array)
    }

    pub(super) fn vec3(&self, key: &str, default: Vec3) -> Result<Vec3> {
        self.array(key, default.to_array()).map(Vec3::from_array)
    }

    /// A texture use under `key`, its index checked.
    pub(super) fn texture(&self, key: &str) -> Result<Option<RawTexture<'a>>> {
        let Some(info) = self.child(key)? else { return Ok(None) };
        let count = self.document.root.textures.len();
        let index = info.integer("index")?.and_then(|i| usize::try_from(i).ok());
        let index = index.filter(|&i| i < count).ok_or_else(|| {
            let what = format!("names no texture; there are {count}: export the file again");
            self.document.reject(info.at("index"), what)
        })?;
        let tex_coord = info.integer("texCoord")?.unwrap_or(0);
        let extensions = info.child("extensions")?;
        let transform = match &extensions {
            Some(extensions) => extensions.child("KHR_texture_transform")?,
            None => None,
        };
        Ok(Some(RawTexture { index, tex_coord, transform, at: info.at }))
    }
}

/// Holds a finite value in a range, with a warning where it was outside.
pub(super) fn clamped(report: &mut LoadReport, at: &str, value: f32, low: f32, high: f32) -> f32 {
    let held = if value.is_nan() { low } else { value.clamp(low, high) };
    if held != value {
        report.warn(format!("{at}: {value} is outside [{low}, {high}]; {held} is used"));
    }
    held
}

/// [`clamped`] for a colour.
pub(super) fn clamped3(report: &mut LoadReport, at: &str, value: Vec3, low: f32, high: f32) -> Vec3 {
    Vec3::from_array(value.to_array().map(|v| clamped(report, at, v, low, high)))
}
