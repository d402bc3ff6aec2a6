//! A render, fully specified: the command line after all defaults and checks.

use crate::integrate::Settings;
use crate::reconstruct::{Alpha, Method};
use crate::scene::LoadOptions;
use crate::store::layers::Layer;
use crate::store::png::ToneMap;
use std::path::{Path, PathBuf};

/// Where the scene comes from.
#[derive(Clone, Debug)]
pub enum Source {
    /// One of the scenes built into the program, by name.
    Builtin(String),
    /// A glTF file.
    File(PathBuf),
}

impl Source {
    /// `builtin:NAME` or a path.
    pub fn parse(argument: &Path) -> Self {
        match argument.to_str().and_then(|s| s.strip_prefix("builtin:")) {
            Some(name) => Self::Builtin(name.to_owned()),
            None => Self::File(argument.to_owned()),
        }
    }

    /// The name for messages: what was typed.
    pub fn name(&self) -> String {
        match self {
            Self::Builtin(name) => format!("builtin:{name}"),
            Self::File(path) => path.display().to_string(),
        }
    }

    /// The path for errors.
    pub fn path(&self) -> PathBuf {
        PathBuf::from(self.name())
    }
}

/// Which camera of the scene.
#[derive(Clone, Debug, Default)]
pub enum CameraChoice {
    /// The first one.
    #[default]
    First,
    /// By name, or by index where no camera has that name.
    Named(String),
}

/// A thin lens in place of the pinhole.
#[derive(Clone, Copy, Debug)]
pub struct Lens {
    /// f-number, for a film 24 mm high.
    pub f_number: f32,
    /// Distance of the plane in focus, m.
    pub focus: f32,
}

/// An environment beside the scene file.
#[derive(Clone, Debug)]
pub struct EnvironmentOptions {
    /// HDR or EXR, latitude-longitude.
    pub path: PathBuf,
    /// Factor on its radiance.
    pub strength: f32,
    /// Turn about the vertical axis, degrees.
    pub rotation: f32,
}

/// Which ray tracing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Backend {
    /// Embree, 16 rays at a time.
    Embree,
    /// obvhs, one ray at a time.
    Obvhs,
}

/// The format of an output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// OpenEXR, float32.
    Exr,
    /// PNG, 8 bit.
    Png,
}

/// A file to write.
#[derive(Clone, Debug)]
pub struct Output {
    /// Where.
    pub path: PathBuf,
    /// As what.
    pub format: Format,
}

/// What ends a render before it has taken all samples of its settings.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stop {
    /// Seconds from the start to the last file written.
    pub seconds: Option<f64>,
    /// Relative error of the reconstructed image, the root of its estimated relMSE.
    pub error: Option<f64>,
}

/// Everything that [`super::run`] needs.
#[derive(Clone, Debug)]
pub struct Job {
    /// The scene.
    pub source: Source,
    /// How it is read.
    pub load: LoadOptions,
    /// Replaces the scene's environment.
    pub environment: Option<EnvironmentOptions>,
    /// Whether the camera sees the environment.
    pub background: bool,
    /// Which camera.
    pub camera: CameraChoice,
    /// Depth of field.
    pub lens: Option<Lens>,
    /// What is integrated.
    pub settings: Settings,
    /// Ray tracing.
    pub backend: Backend,
    /// Watertight at the price of speed.
    pub robust: bool,
    /// Worker threads.
    pub threads: usize,
    /// Budget, bytes.
    pub max_memory: Option<u64>,
    /// When rendering ends before all samples are taken.
    pub stop: Stop,
    /// How the image is solved for.
    pub method: Method,
    /// Weight of the primal against the gradients.
    pub alpha: Alpha,
    /// Layers of the EXR beside the image.
    pub layers: Vec<Layer>,
    /// Whether the EXR keeps what is needed to solve again.
    pub buffers: bool,
    /// What is written.
    pub outputs: Vec<Output>,
    /// Where the path-traced image goes, denoised.
    pub denoised: Option<Output>,
    /// Stops, for PNG.
    pub exposure: f32,
    /// For PNG.
    pub tone_map: ToneMap,
    /// Anything dropped or missing is an error.
    pub strict: bool,
}

impl Job {
    /// Files that are read, and must not be written.
    pub fn inputs(&self) -> Vec<&Path> {
        let scene = match &self.source {
            Source::File(path) => Some(path.as_path()),
            Source::Builtin(_) => None,
        };
        scene.into_iter().chain(self.environment.as_ref().map(|e| e.path.as_path())).collect()
    }

    /// The job that takes `spp` samples a pixel.
    pub fn with_samples(&self, spp: u32) -> Self {
        Self { settings: Settings { spp, ..self.settings }, ..self.clone() }
    }

    /// Columns and rows that are rendered: the crop's, or all.
    pub fn film_size(&self) -> [u32; 2] {
        match self.settings.crop {
            Some([x0, y0, x1, y1]) => [x1 - x0, y1 - y0],
            None => [self.settings.width, self.settings.height],
        }
    }
}
