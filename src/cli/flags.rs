//! The arguments of `gdpt render` as they are typed, and how they become a [`Job`].

use super::progress;
use crate::denoise;
use crate::error::{Error, Result};
use crate::integrate::{Filter, Kind, Settings};
use crate::reconstruct::{Alpha, Method};
use crate::render::{Backend, CameraChoice, EnvironmentOptions, Format, Job, Lens, Output, Source, Stop};
use crate::scene::{LightUnit, LoadOptions};
use crate::store::layers::Layer;
use crate::store::png::ToneMap;
use clap::{Args, ValueEnum};
use std::path::PathBuf;

const EXAMPLES: &str = "\
Examples:
  gdpt render builtin:cornell-box -o cornell-box.exr -o cornell-box.png
  gdpt render scene.glb --spp 256 --size 1920x1080 -o scene.exr
  gdpt render scene.glb --env sky.hdr --env-rotate 90 --exposure -1 -o scene.png
  gdpt render scene.glb --buffers -o scene.exr && gdpt reconstruct scene.exr --reconstruct l2 -o scene-l2.exr
  gdpt render scene.glb --integrator pt --crop 100,100,200,200 -o crop.exr";

/// `--integrator`.
#[derive(Clone, Copy, ValueEnum)]
enum IntegratorFlag {
    /// Gradient-domain path tracing
    Gpt,
    /// Path tracing
    Pt,
}

/// `--filter`.
#[derive(Clone, Copy, ValueEnum)]
enum FilterFlag {
    Box,
    Gaussian,
    BlackmanHarris,
}

/// `--reconstruct`.
#[derive(Clone, Copy, ValueEnum)]
pub enum MethodFlag {
    /// Least absolute differences: robust against fireflies in the gradients, slightly biased
    L1,
    /// Least squares: unbiased
    L2,
    /// Least squares, each measurement weighed by its noise
    Weighted,
    /// The weighted image, single bad pixels mended by what the first hits tell: often the least error, the most bias
    Guided,
    /// The one with the least estimated error
    Auto,
    /// The sampled image, gradients unused
    None,
}

impl MethodFlag {
    /// The typed norm.
    pub fn method(self) -> Method {
        match self {
            Self::L1 => Method::L1,
            Self::L2 => Method::L2,
            Self::Weighted => Method::Weighted,
            Self::Guided => Method::Guided,
            Self::Auto => Method::Auto,
            Self::None => Method::None,
        }
    }
}

/// A switch that is said in full.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Switch {
    On,
    Off,
}

/// `--backend`.
#[derive(Clone, Copy, ValueEnum)]
enum BackendFlag {
    Embree,
    Obvhs,
}

/// `--light-unit`.
#[derive(Clone, Copy, ValueEnum)]
enum LightUnitFlag {
    /// Candela and lux, as glTF says: divided by 683 lm/W
    Photometric,
    /// Watts, taken as they are
    Radiometric,
    /// By what wrote the file
    Auto,
}

/// `--tonemap`.
#[derive(Clone, Copy, ValueEnum)]
pub enum ToneMapFlag {
    Agx,
    Aces,
    None,
}

impl ToneMapFlag {
    /// The typed curve.
    pub fn curve(self) -> ToneMap {
        match self {
            Self::Agx => ToneMap::Agx,
            Self::Aces => ToneMap::Aces,
            Self::None => ToneMap::None,
        }
    }
}

/// Arguments of everything that writes PNG.
#[derive(Args)]
pub struct DisplayFlags {
    /// Exposure of PNGs, in stops
    #[arg(long, value_name = "EV", default_value_t = 0.0, allow_negative_numbers = true, value_parser = finite)]
    exposure: f32,
    /// Tone mapping of PNGs
    #[arg(long, value_name = "CURVE", default_value = "agx")]
    tonemap: ToneMapFlag,
}

impl DisplayFlags {
    /// Exposure and curve.
    pub fn typed(&self) -> (f32, ToneMap) {
        (self.exposure, self.tonemap.curve())
    }
}

#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub struct RenderFlags {
    /// A .glb or .gltf file, or builtin:cornell-box
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// File to write, .exr or .png; may be given several times
    #[arg(short, long, value_name = "OUT", required = true)]
    output: Vec<PathBuf>,
    /// Writes the path-traced image, denoised by Open Image Denoise, to this .exr or .png; needs a build with
    /// --features denoise
    #[arg(long, value_name = "OUT")]
    denoise: Option<PathBuf>,
    /// How light is transported
    #[arg(long, value_name = "METHOD", default_value = "gpt")]
    integrator: IntegratorFlag,
    /// Samples a pixel [default: 64; as many as it takes with --target-error or --time-limit]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1 << 24))]
    spp: Option<u32>,
    /// Ends when the estimated relative error of the image is below X: 0.02 is 2 %
    #[arg(long, value_name = "X", value_parser = positive)]
    target_error: Option<f32>,
    /// Ends in time for everything to be written after so long: 90s, 5m, 1h
    #[arg(long, value_name = "TIME", value_parser = duration)]
    time_limit: Option<f64>,
    /// With --integrator pt: half the samples use the same random numbers in all pixels, and give the gradients
    #[arg(long)]
    common_random_numbers: bool,
    /// Columns and rows [default: 1280x720; 512x512 for built-in scenes]
    #[arg(long, value_name = "WxH", value_parser = size)]
    size: Option<[u32; 2]>,
    /// Camera of the scene, by name or index [default: the first]
    #[arg(long, value_name = "NAME|INDEX")]
    camera: Option<String>,
    /// Vertices of a path after the camera's: 1 shows emitters, 2 direct light
    #[arg(long, value_name = "N", default_value_t = 12, value_parser = clap::value_parser!(u32).range(1..=1024))]
    max_depth: u32,
    /// Depth from which paths may end by Russian roulette
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1024))]
    rr_depth: u32,
    /// Seed of the random numbers; equal seeds give equal images
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Worker threads [default: one a logical CPU]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=4096))]
    threads: Option<u32>,
    /// Pixel filter
    #[arg(long, value_name = "FILTER", default_value = "box")]
    filter: FilterFlag,
    /// How the image is found from samples and gradients [default: weighted; none with --integrator pt]
    #[arg(long, value_name = "NORM")]
    reconstruct: Option<MethodFlag>,
    /// Weight of the samples against the gradients, for l1 and l2: a number, or auto for that of the measured noise
    #[arg(long, value_name = "X|auto", default_value = "0.2", value_parser = alpha)]
    alpha: Alpha,
    /// Roughness (GGX alpha) up to which a bounce is shifted as a mirror's
    #[arg(long, value_name = "ROUGHNESS", default_value_t = 0.001, value_parser = fraction)]
    shift_threshold: f32,
    /// Weights between a path and its shifted twin; off shows what happens without
    #[arg(long, value_name = "ON|OFF", default_value = "on")]
    pair_mis: Switch,
    /// Ray tracing library
    #[arg(long, value_name = "NAME", default_value = "embree")]
    backend: BackendFlag,
    /// No ray passes between two triangles that share an edge; slower
    #[arg(long)]
    robust: bool,
    /// Light from infinity: a latitude-longitude image, .hdr or .exr
    #[arg(long, value_name = "FILE")]
    env: Option<PathBuf>,
    /// Factor on the environment's radiance
    #[arg(long, value_name = "X", default_value_t = 1.0, requires = "env", value_parser = non_negative)]
    env_strength: f32,
    /// Turns the environment about the vertical axis, degrees
    #[arg(
        long, value_name = "DEG", default_value_t = 0.0, requires = "env", allow_negative_numbers = true,
        value_parser = finite
    )]
    env_rotate: f32,
    /// Whether the camera sees the environment
    #[arg(long, value_name = "ON|OFF", default_value = "on")]
    background: Switch,
    /// Unit of the file's point, spot and directional lights
    #[arg(long, value_name = "UNIT", default_value = "auto")]
    light_unit: LightUnitFlag,
    /// Emissive materials that are doubleSided shine from both sides; else from the front alone
    #[arg(long)]
    double_sided_emission: bool,
    #[command(flatten)]
    display: DisplayFlags,
    /// Depth of field: f-number, for a film 24 mm high
    #[arg(long, value_name = "F", requires = "focus", value_parser = positive)]
    aperture: Option<f32>,
    /// Distance that is sharp, m
    #[arg(long, value_name = "DIST", requires = "aperture", value_parser = positive)]
    focus: Option<f32>,
    /// Renders only columns x0 to x1 and rows y0 to y1 (exclusive)
    #[arg(long, value_name = "x0,y0,x1,y1", value_parser = crop)]
    crop: Option<[u32; 4]>,
    /// Layers of the EXR beside the image: all, none, or some of Z,N,P,albedo,emission,variance,spp
    #[arg(long, value_name = "LIST", default_value = "all", value_parser = layers)]
    aov: Layers,
    /// Keeps in the EXR what is needed to solve again
    #[arg(long)]
    buffers: bool,
    /// How progress is shown, on stderr
    #[arg(long, value_name = "STYLE", default_value = "auto")]
    pub progress: progress::Style,
    /// Writes statistics as one JSON object
    #[arg(long, value_name = "FILE")]
    pub stats_json: Option<PathBuf>,
    /// Ends with status 65 where anything was dropped or missing
    #[arg(long)]
    strict: bool,
    /// Budget, like 8G or 512M
    #[arg(long, value_name = "SIZE", value_parser = bytes)]
    max_memory: Option<u64>,
    /// Says nothing but errors
    #[arg(short, long, conflicts_with = "verbose")]
    pub quiet: bool,
    /// Says more: how shifts ended
    #[arg(short, long)]
    pub verbose: bool,
}

/// Where nothing but an error or a time ends a render.
const MOST_SAMPLES: u32 = 1 << 20;

/// A list of layers.
type Layers = Vec<Layer>;

fn number(text: &str, ok: impl Fn(f32) -> bool, what: &str) -> std::result::Result<f32, String> {
    let value = text.parse::<f32>().ok().filter(|v| v.is_finite() && ok(*v));
    value.ok_or_else(|| format!("is not {what}"))
}

/// A number.
pub fn finite(text: &str) -> std::result::Result<f32, String> {
    number(text, |_| true, "a finite number")
}

/// A number above zero.
pub fn positive(text: &str) -> std::result::Result<f32, String> {
    number(text, |v| v > 0.0, "a number above 0")
}

/// `auto` or a number above zero.
pub fn alpha(text: &str) -> std::result::Result<Alpha, String> {
    if text == "auto" {
        return Ok(Alpha::Auto);
    }
    number(text, |v| v > 0.0, "auto or a number above 0").map(Alpha::Fixed)
}

fn duration(text: &str) -> std::result::Result<f64, String> {
    let units = [('s', 1.0), ('m', 60.0), ('h', 3600.0)];
    let parse = |(unit, seconds)| Some(text.strip_suffix(unit)?.parse::<f64>().ok()? * seconds);
    let value = units.into_iter().find_map(parse).filter(|v| v.is_finite() && *v > 0.0);
    value.ok_or_else(|| "is not a time like 90s, 5m or 1h".into())
}

fn non_negative(text: &str) -> std::result::Result<f32, String> {
    number(text, |v| v >= 0.0, "a number from 0 up")
}

fn fraction(text: &str) -> std::result::Result<f32, String> {
    number(text, |v| (0.0..=1.0).contains(&v), "a number from 0 to 1")
}

pub fn size(text: &str) -> std::result::Result<[u32; 2], String> {
    let parsed = text.split_once('x').and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
    let size: [u32; 2] = parsed.ok_or("is not of the form 1280x720")?;
    if size.iter().any(|&v| v == 0 || v > 1 << 16) || u64::from(size[0]) * u64::from(size[1]) > 1 << 28 {
        return Err("each side has 1 to 65536 pixels, the image at most 2^28".into());
    }
    Ok(size)
}

fn crop(text: &str) -> std::result::Result<[u32; 4], String> {
    let numbers: Option<Vec<u32>> = text.split(',').map(|v| v.trim().parse().ok()).collect();
    numbers.and_then(|v| v.try_into().ok()).ok_or_else(|| "is not of the form x0,y0,x1,y1".into())
}

fn layers(text: &str) -> std::result::Result<Layers, String> {
    match text {
        "all" => return Ok(Layer::ALL.to_vec()),
        "none" => return Ok(Vec::new()),
        _ => {}
    }
    let one = |name: &str| Layer::ALL.into_iter().find(|l| l.name().eq_ignore_ascii_case(name));
    let find = |name: &str| one(name.trim()).ok_or_else(|| format!("there is no layer {name:?}"));
    text.split(',').map(find).collect()
}

fn bytes(text: &str) -> std::result::Result<u64, String> {
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let shift = match text[digits.len()..].trim_end_matches(['B', 'b', 'i']).to_ascii_uppercase().as_str() {
        "" => 0,
        "K" => 10,
        "M" => 20,
        "G" => 30,
        "T" => 40,
        _ => return Err("has a unit other than K, M, G, T".into()),
    };
    let value = digits.parse::<u64>().ok().and_then(|v| v.checked_mul(1 << shift)).filter(|&v| v > 0);
    value.ok_or_else(|| "is not a size like 8G or 512M".into())
}

/// The typed outputs: the format follows from the name.
pub fn outputs(paths: &[PathBuf]) -> Result<Vec<Output>> {
    let mut outputs: Vec<Output> = Vec::new();
    for path in paths {
        let extension = path.extension().map(|e| e.to_ascii_lowercase());
        let format = match extension.as_deref().and_then(|e| e.to_str()) {
            Some("exr") => Format::Exr,
            Some("png") => Format::Png,
            _ => return Err(usage(format!("{}: the output's name ends in .exr or .png", path.display()))),
        };
        if outputs.iter().any(|o| o.path == *path) {
            return Err(usage(format!("{}: given twice as output", path.display())));
        }
        outputs.push(Output { path: path.clone(), format });
    }
    Ok(outputs)
}

fn usage(text: String) -> Error {
    Error::Usage(text)
}

impl RenderFlags {
    /// The job, after the checks that need several arguments.
    pub fn job(&self) -> Result<Job> {
        let outputs = outputs(&self.output)?;
        let denoised = self.denoised(&outputs)?;
        let has_exr = outputs.iter().any(|o| o.format == Format::Exr);
        if self.buffers && !has_exr {
            return Err(usage("--buffers needs an .exr among the outputs".into()));
        }
        let source = Source::parse(&self.scene);
        let [width, height] = self.size.unwrap_or(match source {
            Source::Builtin(_) => [512, 512],
            Source::File(_) => [1280, 720],
        });
        if let Some([x0, y0, x1, y1]) = self.crop
            && !(x0 < x1 && x1 <= width && y0 < y1 && y1 <= height)
        {
            return Err(usage(format!("--crop {x0},{y0},{x1},{y1}: is empty or leaves {width}x{height}")));
        }
        let layers = if has_exr { self.aov.clone() } else { Vec::new() };
        let (kind, method) = self.method()?;
        let (exposure, tone_map) = self.display.typed();
        let settings = Settings {
            kind,
            width,
            height,
            crop: self.crop,
            first_sample: 0,
            spp: self.samples(),
            common_random_numbers: self.common_random_numbers,
            max_depth: self.max_depth,
            rr_depth: self.rr_depth,
            seed: self.seed,
            filter: match self.filter {
                FilterFlag::Box => Filter::Box,
                FilterFlag::Gaussian => Filter::Gaussian,
                FilterFlag::BlackmanHarris => Filter::BlackmanHarris,
            },
            shift_threshold: self.shift_threshold,
            pair_mis: self.pair_mis == Switch::On,
            features: layers.iter().any(|l| l.needs_features())
                || self.buffers
                || denoised.is_some()
                || self.background == Switch::Off
                || matches!(method, Method::Guided | Method::Auto),
        };
        let cpus = || std::thread::available_parallelism().map_or(1, |n| n.get());
        Ok(Job {
            source,
            load: self.load_options(),
            environment: self.env.clone().map(|path| EnvironmentOptions {
                path,
                strength: self.env_strength,
                rotation: self.env_rotate,
            }),
            background: self.background == Switch::On,
            camera: self.camera.clone().map_or(CameraChoice::First, CameraChoice::Named),
            lens: self.aperture.zip(self.focus).map(|(f_number, focus)| Lens { f_number, focus }),
            settings,
            backend: match self.backend {
                BackendFlag::Embree => Backend::Embree,
                BackendFlag::Obvhs => Backend::Obvhs,
            },
            robust: self.robust,
            threads: self.threads.map_or_else(cpus, |n| n as usize),
            max_memory: self.max_memory,
            stop: Stop { seconds: self.time_limit, error: self.target_error.map(f64::from) },
            method,
            alpha: self.alpha,
            layers,
            buffers: self.buffers,
            outputs,
            denoised,
            exposure,
            tone_map,
            strict: self.strict,
        })
    }

    /// Where the denoised image goes.
    fn denoised(&self, others: &[Output]) -> Result<Option<Output>> {
        let Some(path) = &self.denoise else { return Ok(None) };
        if !denoise::AVAILABLE {
            return Err(denoise::unavailable());
        }
        if others.iter().any(|o| o.path == *path) {
            return Err(usage(format!("{}: given twice as output", path.display())));
        }
        Ok(outputs(std::slice::from_ref(path))?.pop())
    }

    fn method(&self) -> Result<(Kind, Method)> {
        let method = self.reconstruct.map(MethodFlag::method);
        let common = self.common_random_numbers;
        match (self.integrator, method) {
            (IntegratorFlag::Gpt, _) if common => Err(usage(
                "--common-random-numbers needs --integrator pt: gpt has gradients of its own".into(),
            )),
            (IntegratorFlag::Gpt, method) => Ok((Kind::GradientPath, method.unwrap_or_default())),
            (IntegratorFlag::Pt, method) if common => Ok((Kind::Path, method.unwrap_or_default())),
            (IntegratorFlag::Pt, None | Some(Method::None)) => Ok((Kind::Path, Method::None)),
            (IntegratorFlag::Pt, Some(_)) => Err(usage(
                "--reconstruct needs gradients: use --integrator gpt, or --common-random-numbers".into(),
            )),
        }
    }

    /// Samples a pixel; with common random numbers as many again are taken for the gradients.
    fn samples(&self) -> u32 {
        let stops = self.time_limit.is_some() || self.target_error.is_some();
        let spp = self.spp.unwrap_or(if stops { MOST_SAMPLES } else { 64 });
        if self.common_random_numbers { spp.div_ceil(2) } else { spp }
    }

    fn load_options(&self) -> LoadOptions {
        let light_unit = match self.light_unit {
            LightUnitFlag::Photometric => LightUnit::Photometric,
            LightUnitFlag::Radiometric => LightUnit::Radiometric,
            LightUnitFlag::Auto => LightUnit::Auto,
        };
        let max_memory = self.max_memory.unwrap_or(LoadOptions::default().max_memory);
        LoadOptions { light_unit, double_sided_emission: self.double_sided_emission, max_memory }
    }
}
