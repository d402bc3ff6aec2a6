//! From the film to the layers of a file.
//!
//! Root `R, G, B, A`: the image, A = 1. Optional: `Z` (m), `N.X/Y/Z` (world, shading), `P.X/Y/Z` (m, world),
//! `albedo`, `emission` (very direct light), `variance` (of the mean primal), `spp.Y`. Buffers, enough to solve
//! again: `primal`, `dx`, `dy`, their halves `_a` and `_b`, and `moments`, the mean squared luminance of the four
//! one-sided gradients; with them always `albedo`, `N`, `P` and `Z`.

use super::Document;
use crate::error::{Error, Result};
use crate::film::{Buffers, Direction, Features, Film, Half, Measured, Plane};

/// `Z` where the camera ray meets nothing, m: finite, and beyond any scene.
pub const FAR: f32 = 1e10;

const RGB: [&str; 3] = ["R", "G", "B"];
const XYZ: [&str; 3] = ["X", "Y", "Z"];

/// A layer that can be asked for beside the image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Layer {
    /// Distance of the first hit along the ray.
    Z,
    /// Shading normal.
    N,
    /// Position.
    P,
    /// Base colour.
    Albedo,
    /// Very direct light.
    Emission,
    /// Variance of the mean primal.
    Variance,
    /// Samples a pixel.
    Spp,
}

impl Layer {
    /// All of them.
    pub const ALL: [Self; 7] =
        [Self::Z, Self::N, Self::P, Self::Albedo, Self::Emission, Self::Variance, Self::Spp];

    /// The name in a file and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Z => "Z",
            Self::N => "N",
            Self::P => "P",
            Self::Albedo => "albedo",
            Self::Emission => "emission",
            Self::Variance => "variance",
            Self::Spp => "spp",
        }
    }

    /// Whether the integrator has to record what camera rays meet first.
    pub fn needs_features(self) -> bool {
        matches!(self, Self::Z | Self::N | Self::P | Self::Albedo)
    }
}

/// A document of the finished `image` and the chosen layers of the film. Alpha is the share of samples that meet a
/// surface where `matte` is set and the film has features, else 1.
pub fn document(film: &Film, image: &Plane, layers: &[Layer], buffers: bool, matte: bool) -> Document {
    let mut document = Document::new(film.width, film.height);
    set_image(&mut document, image);
    let coverage = film.features.as_ref().filter(|_| matte).map(|features| features.coverage.clone());
    document.channels.insert("A".into(), coverage.unwrap_or_else(|| vec![1.0; image.data.len()]));
    for &layer in layers {
        set_layer(&mut document, film, layer);
    }
    if buffers {
        set_buffers(&mut document, film);
    }
    document
}

/// Puts the image into the root layer; alpha stays as it is.
pub fn set_image(document: &mut Document, image: &Plane) {
    document.set_plane("", RGB, image);
}

fn set_layer(document: &mut Document, film: &Film, layer: Layer) {
    let name = layer.name();
    if let Some(features) = &film.features {
        match layer {
            Layer::Z => {
                let depth = features.depth.iter().map(|d| if d.is_finite() { *d } else { FAR }).collect();
                document.channels.insert(name.into(), depth);
            }
            Layer::N => document.set_plane(name, XYZ, &features.normal),
            Layer::P => document.set_plane(name, XYZ, &features.position),
            Layer::Albedo => document.set_plane(name, RGB, &features.albedo),
            Layer::Emission | Layer::Variance | Layer::Spp => {}
        }
    }
    match layer {
        Layer::Emission => document.set_plane(name, RGB, &film.direct()),
        Layer::Variance => document.set_plane(name, RGB, &film.variance()),
        Layer::Spp => {
            let samples = film.samples(Half::Both) as f32;
            document.channels.insert("spp.Y".into(), vec![samples; film.width * film.height]);
        }
        Layer::Z | Layer::N | Layer::P | Layer::Albedo => {}
    }
}

fn set_buffers(document: &mut Document, film: &Film) {
    for layer in [Layer::Emission, Layer::Albedo, Layer::N, Layer::P, Layer::Z] {
        set_layer(document, film, layer);
    }
    for (half, suffix) in [(Half::Both, ""), (Half::A, "_a"), (Half::B, "_b")] {
        if film.samples(half) == 0 {
            continue;
        }
        let measured = film.measured(half);
        document.set_plane(&format!("primal{suffix}"), RGB, &measured.primal);
        if film.has_gradients {
            document.set_plane(&format!("dx{suffix}"), RGB, &measured.dx);
            document.set_plane(&format!("dy{suffix}"), RGB, &measured.dy);
        }
    }
    if film.has_gradients {
        for (direction, name) in Direction::ALL.into_iter().zip(["right", "left", "up", "down"]) {
            document.channels.insert(format!("moments.{name}"), film.gradient_square(direction));
        }
    }
}

/// The buffers in a document; `path` is for the message where they are not there.
pub fn buffers(document: &Document, path: &std::path::Path) -> Result<Buffers> {
    let plane = |layer: &str| {
        document.plane(layer).ok_or_else(|| Error::Scene {
            path: path.to_owned(),
            at: String::new(),
            what: format!("has no layer {layer}; render it with --integrator gpt --buffers"),
        })
    };
    let measured = |suffix: &str| -> Result<Measured> {
        let [primal, dx, dy] = ["primal", "dx", "dy"].map(|layer| plane(&format!("{layer}{suffix}")));
        Ok(Measured { primal: primal?, dx: dx?, dy: dy? })
    };
    let halves = measured("_a").and_then(|a| Ok([a, measured("_b")?])).ok();
    Ok(Buffers { all: measured("")?, halves, direct: plane("emission")?, features: features(document) })
}

/// The features in a document, where all are there. Coverage is not stored: it is 1 where anything was met.
fn features(document: &Document) -> Option<Features> {
    let depth = document.channels.get("Z")?;
    let met = |z: &f32| z.is_finite() && *z < FAR;
    Some(Features {
        coverage: depth.iter().map(|z| f32::from(u8::from(met(z)))).collect(),
        depth: depth.iter().map(|z| if met(z) { *z } else { f32::INFINITY }).collect(),
        normal: document.layer("N", XYZ)?,
        position: document.layer("P", XYZ)?,
        albedo: document.plane("albedo")?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::{FilmTile, PixelSample};

    fn small_film() -> Film {
        let mut film = Film::new(4, 3, true, true);
        let mut tile = FilmTile::new(0, 0, 4, 3);
        for (i, index) in (0..12).flat_map(|i| [(i, 0), (i, 1)]) {
            let value = i as f32 + index as f32;
            let sample = PixelSample {
                primal: [value; 3],
                direct: [0.5; 3],
                gradient: [[0.25; 3], [-0.25; 3], [0.5; 3], [-0.5; 3]],
                depth: if i == 0 { f32::INFINITY } else { 2.0 },
                normal: [0.0, 0.0, 1.0],
                ..PixelSample::default()
            };
            tile.add(i % 4, i / 4, index, &sample);
        }
        film.merge(&tile);
        film.add_samples(0, 2);
        film
    }

    #[test]
    fn has_every_layer_of_the_contract_and_nothing_that_is_not_finite() {
        let film = small_film();
        let document = document(&film, &film.primal(Half::Both), &Layer::ALL, true, false);
        let mut expected = vec!["R", "G", "B", "A", "Z", "N.X", "N.Y", "N.Z", "P.X", "P.Y", "P.Z", "spp.Y"];
        let colors =
            ["albedo", "emission", "variance", "primal", "primal_a", "primal_b", "dx", "dx_a", "dx_b"];
        let names: Vec<String> = colors
            .iter()
            .chain(&["dy", "dy_a", "dy_b"])
            .flat_map(|l| RGB.map(|c| format!("{l}.{c}")))
            .collect();
        expected.extend(names.iter().map(String::as_str));
        expected.extend(["moments.right", "moments.left", "moments.up", "moments.down"]);
        expected.sort_unstable();
        assert_eq!(document.channels.keys().collect::<Vec<_>>(), expected);
        assert!(document.channels.values().flatten().all(|v| v.is_finite()));
        assert_eq!(document.channels["Z"][..2], [FAR, 2.0]);
        assert_eq!(document.channels["primal_b.R"][3], 4.0);
        assert_eq!(document.channels["dx.R"][..4], [0.5, 0.5, 0.5, 0.0]);
    }

    #[test]
    fn buffers_come_back_and_their_absence_is_named() {
        let film = small_film();
        let path = std::path::Path::new("a.exr");
        let full = document(&film, &film.primal(Half::Both), &[], true, false);
        let back = buffers(&full, path).expect("they were stored");
        assert_eq!(back.all, film.measured(Half::Both));
        assert_eq!(back.halves, film.buffers().halves);
        assert_eq!(back.direct, film.direct());
        let plain = document(&film, &film.primal(Half::Both), &[], false, true);
        assert_eq!((full.channels["A"][0], plain.channels["A"][0], plain.channels["A"][1]), (1.0, 0.0, 1.0));
        let error = buffers(&plain, path).expect_err("there are none").to_string();
        assert!(
            error.contains("a.exr") && error.contains("primal") && error.contains("--buffers"),
            "{error}"
        );
    }
}
