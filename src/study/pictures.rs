//! The pictures of a scene: each once, with a name and a description, as PNG inside the page.

use super::Plan;
use super::ladder::{Findings, Side};
use super::table::number;
use crate::analyze::metrics::pixel_rel_mse;
use crate::error::{Error, Result};
use crate::film::Plane;
use crate::reconstruct::Method;
use crate::render::sum;
use crate::store::png;
use base64::Engine;
use std::path::Path;

/// Side of a crop, pixels.
const CROP: usize = 48;

/// A picture in the page.
#[derive(Clone, Debug)]
pub struct Picture {
    /// In the page, unique.
    pub id: String,
    /// Below the picture and in the lists of the wipe.
    pub label: String,
    /// For who does not see it.
    pub alt: String,
    /// PNG as data URI.
    pub uri: String,
    pub width: usize,
    pub height: usize,
}

/// Pictures that belong together.
#[derive(Clone, Debug)]
pub struct Group {
    pub title: String,
    pub text: String,
    /// Shown enlarged, pixel by pixel, and not in the lists of the wipe.
    pub crops: bool,
    pub pictures: Vec<Picture>,
}

/// Makes pictures of one scene.
struct Studio<'a> {
    plan: &'a Plan,
    measured: &'a Findings,
    prefix: String,
    count: usize,
}

impl Studio<'_> {
    fn rgb8(&self, whole: &Plane) -> Vec<u8> {
        png::rgb8(whole, self.measured.reference.exposure, self.plan.tone_map)
    }

    fn encoded(&mut self, pixels: &[u8], size: [usize; 2], label: String, alt: String) -> Result<Picture> {
        let bytes = png::encode_rgb8(pixels, size[0], size[1])
            .map_err(|source| Error::Io { path: Path::new("picture").to_owned(), source })?;
        let uri =
            format!("data:image/png;base64,{}", base64::engine::general_purpose::STANDARD.encode(bytes));
        self.count += 1;
        let id = format!("{}-{}", self.prefix, self.count);
        Ok(Picture { id, label, alt, uri, width: size[0], height: size[1] })
    }

    fn whole(&mut self, plane: &Plane, label: String, what: &str) -> Result<Picture> {
        let alt = format!("{}, {what}", self.measured.name);
        self.encoded(&self.rgb8(plane), [plane.width, plane.height], label, alt)
    }

    /// The picture of a cell, with its error in the label; nothing where it was not measured.
    fn cell(&mut self, side: Side, spp: u32) -> Result<Option<Picture>> {
        let Some(cell) = self.measured.cell(side, spp) else { return Ok(None) };
        let label = format!(
            "{}, {spp} spp: relMSE {}, FLIP {}",
            side.name(),
            number(cell.rel_mse),
            number(cell.flip)
        );
        let what = format!("{} with {spp} samples a pixel", side.name());
        self.whole(&cell.shot.whole(), label, &what).map(Some)
    }

    fn reference(&mut self) -> Result<Picture> {
        let Findings { reference, .. } = self.measured;
        let size = [reference.image.width, reference.image.height];
        let label = format!("reference, {} spp", self.plan.reference_spp);
        let alt = format!("{}, the reference", self.measured.name);
        self.encoded(&reference.picture, size, label, alt)
    }
}

/// Differences about middle grey, scaled to the 99th percentile of their magnitude.
fn signed(plane: &Plane) -> Vec<u8> {
    let mut sizes: Vec<f32> =
        plane.data.iter().flatten().map(|v| v.abs()).filter(|v| v.is_finite()).collect();
    sizes.sort_by(f32::total_cmp);
    let scale = sizes.get(sizes.len() * 99 / 100).copied().filter(|s| *s > 0.0).unwrap_or(1.0);
    plane.data.iter().flatten().map(|v| (127.5 + 127.5 * (v / scale).clamp(-1.0, 1.0)) as u8).collect()
}

/// All groups of a scene; `index` makes the ids unique.
pub fn groups(plan: &Plan, measured: &Findings, index: usize) -> Result<Vec<Group>> {
    let mut studio = Studio { plan, measured, prefix: format!("p{index}"), count: 0 };
    let best = Side::Gradient(Method::default());
    let shown = plan.shown_spp();
    let mut groups = vec![ladder(&mut studio, best)?, methods(&mut studio, best, shown)?];
    groups.extend(crops(&mut studio, best, shown)?);
    groups.extend([weights(&mut studio)?, quartet(&mut studio, best, shown)?]);
    Ok(groups)
}

fn ladder(studio: &mut Studio, best: Side) -> Result<Group> {
    let mut pictures = Vec::new();
    for &spp in &studio.plan.spp {
        for side in [Side::Path, best] {
            pictures.extend(studio.cell(side, spp)?);
        }
    }
    pictures.push(studio.reference()?);
    let text =
        format!("Path tracing (PT) beside gradient-domain path tracing ({}) at equal samples.", best.name());
    Ok(Group { title: "More samples".into(), text, crops: false, pictures })
}

fn methods(studio: &mut Studio, best: Side, shown: u32) -> Result<Group> {
    let mut pictures = Vec::new();
    for side in studio.measured.sides().into_iter().filter(|s| *s != best && *s != Side::Path) {
        pictures.extend(studio.cell(side, shown)?);
    }
    let (spp, shot, score) = &studio.measured.equal_time;
    let (rel_mse, flip) = (number(score.rel_mse), number(score.flip));
    let label = format!("PT at equal CPU time, {spp} spp: relMSE {rel_mse}, FLIP {flip}");
    pictures.push(studio.whole(
        &shot.whole(),
        label,
        &format!("PT with {spp} samples a pixel, equal CPU time"),
    )?);
    let text = format!(
        "The other methods at {shown} spp, and path tracing for as long as {} takes at {shown} spp.",
        best.name()
    );
    Ok(Group { title: format!("Other methods, {shown} spp"), text, crops: false, pictures })
}

/// The window of a crop about a block.
fn window(block: [usize; 2], size: [usize; 2]) -> [usize; 4] {
    let range = |b: usize, n: usize| {
        let length = CROP.min(n);
        let start = (b * 16 + 8).saturating_sub(CROP / 2).min(n - length);
        (start, start + length)
    };
    let ((x0, x1), (y0, y1)) = (range(block[0], size[0]), range(block[1], size[1]));
    [x0, y0, x1, y1]
}

/// The blocks of 16×16 pixels where `best` gains most and least over `path`, by their summed errors.
fn extremes(path: &Plane, best: &Plane, reference: &Plane) -> [[usize; 2]; 2] {
    let columns = reference.width.div_ceil(16);
    let mut sums = vec![[0.0f64; 2]; columns * reference.height.div_ceil(16)];
    for y in 0..reference.height {
        for x in 0..reference.width {
            let block = &mut sums[y / 16 * columns + x / 16];
            for (sum, image) in block.iter_mut().zip([path, best]) {
                let error = pixel_rel_mse(image.at(x, y), reference.at(x, y));
                *sum += if error.is_finite() { error } else { 0.0 };
            }
        }
    }
    // Blocks in which nothing happens have no say: those below a hundredth of the mean error.
    let floor = 0.01 * sums.iter().map(|s| s[0]).sum::<f64>() / sums.len() as f64;
    let gain = |i: &usize| sums[*i][0] / sums[*i][1].max(1e-300);
    let alive = || (0..sums.len()).filter(|i| sums[*i][0].max(sums[*i][1]) > floor);
    let place = |i: usize| [i % columns, i / columns];
    let most = alive().max_by(|a, b| gain(a).total_cmp(&gain(b))).unwrap_or(0);
    let least = alive().min_by(|a, b| gain(a).total_cmp(&gain(b))).unwrap_or(0);
    [place(most), place(least)]
}

/// Crops of all methods at two places: one group each.
fn crops(studio: &mut Studio, best: Side, shown: u32) -> Result<Vec<Group>> {
    let measured = studio.measured;
    let (spp, equal, _) = &measured.equal_time;
    let reference = sum(&measured.reference.image, &measured.reference.direct);
    let mut shots = vec![("reference".to_owned(), reference)];
    let image = |side: Side| {
        measured.cell(side, shown).map(|c| (format!("{}, {shown} spp", side.name()), c.shot.whole()))
    };
    shots.extend(image(Side::Path));
    shots.push((format!("PT, {spp} spp (equal time)"), equal.whole()));
    shots.extend(measured.sides().into_iter().filter(|s| *s != Side::Path).filter_map(image));
    let (Some(path), Some(ours)) = (measured.cell(Side::Path, shown), measured.cell(best, shown)) else {
        return Ok(Vec::new());
    };
    let blocks = extremes(&path.shot.image, &ours.shot.image, &measured.reference.image);
    let name = best.name();
    let titles =
        [format!("Where {name} gains most, {shown} spp"), format!("Where {name} gains least, {shown} spp")];
    let mut groups = Vec::new();
    for (block, title) in blocks.into_iter().zip(titles) {
        let mut pictures = Vec::new();
        for (name, plane) in &shots {
            let [x0, y0, x1, y1] = window(block, [plane.width, plane.height]);
            let part = Plane::from_fn(x1 - x0, y1 - y0, |x, y| plane.at(x0 + x, y0 + y));
            pictures.push(studio.whole(&part, name.clone(), &format!("crop: {name}"))?);
        }
        let text = format!(
            "The block of 16\u{d7}16 pixels, with what is around it, whose error over path tracing's \
                            at equal samples is the {} of the image.",
            if groups.is_empty() { "least" } else { "greatest" }
        );
        groups.push(Group { title, text, crops: true, pictures });
    }
    Ok(groups)
}

fn weights(studio: &mut Studio) -> Result<Group> {
    let spp = studio.plan.spp.first().copied().unwrap_or(1);
    let mut pictures: Vec<Picture> = studio.cell(Side::Path, spp)?.into_iter().collect();
    let [with, without] = &studio.measured.pair_weights;
    for (shot, how) in [(with, "with"), (without, "without")] {
        let label = format!("L2 {how} the weights of pairs, {spp} spp");
        pictures.push(studio.whole(&shot.whole(), label.clone(), &label)?);
    }
    let text =
        "Pixels alone; the least-squares image; and the same without the weights between a path and its \
                shifted twin, which blows up where a shift squeezes many paths into few."
            .into();
    Ok(Group { title: format!("Weights of pairs, {spp} spp"), text, crops: false, pictures })
}

fn quartet(studio: &mut Studio, best: Side, shown: u32) -> Result<Group> {
    let measured = studio.measured;
    let run = &measured.buffers;
    let mut pictures =
        vec![studio.whole(&run.primal, format!("primal, {shown} spp"), "the sampled colours")?];
    for (plane, name, what) in [(&run.dx, "dx", "to the right"), (&run.dy, "dy", "downwards")] {
        let label = format!("{name}, {shown} spp (grey is zero)");
        let alt = format!("{}, sampled differences {what}", measured.name);
        pictures.push(studio.encoded(&signed(plane), [plane.width, plane.height], label, alt)?);
    }
    pictures.extend(studio.cell(best, shown)?);
    let text = "What is sampled, without very direct light, and the image that fits it.".into();
    Ok(Group { title: "Colours, differences, result".into(), text, crops: false, pictures })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crops_stay_inside() {
        assert_eq!(window([0, 0], [64, 48]), [0, 0, 48, 48]);
        assert_eq!(window([3, 2], [64, 48]), [16, 0, 64, 48]);
        assert_eq!(window([0, 0], [10, 300]), [0, 0, 10, 48]);
    }

    #[test]
    fn extremes_are_found() {
        let reference = Plane::from_fn(48, 32, |_, _| [1.0; 3]);
        let noisy = |x0: usize, size: f32| {
            Plane::from_fn(48, 32, move |x, y| [1.0 + if x / 16 == x0 && y < 16 { size } else { 0.1 }; 3])
        };
        // The left block is bad in path tracing alone, the right one in ours.
        assert_eq!(extremes(&noisy(0, 1.0), &noisy(2, 1.0), &reference), [[0, 0], [2, 0]]);
    }

    #[test]
    fn differences_are_shown_about_grey() {
        let plane = Plane::from_fn(3, 1, |x, _| [x as f32 - 1.0; 3]);
        assert_eq!(signed(&plane), [0, 0, 0, 127, 127, 127, 255, 255, 255]);
        assert_eq!(signed(&Plane::new(1, 1)), [127; 3]);
    }
}
