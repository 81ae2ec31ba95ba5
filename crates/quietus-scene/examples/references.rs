//! Draws the scenes for which pbrt-v4 itself has made pictures, and says how far ours are from those. Prints the table
//! of `docs/pbrt.md`:
//!
//! `cargo run --release -p quietus-scene --example references -- 256`
//!
//! The number is that of samples per pixel; names of references after it choose among them. With `--pictures FOLDER`
//! each pair is written side by side, ours on the left.

use std::error::Error;
use std::path::{Path, PathBuf};

use exr::prelude::{ReadChannels, ReadLayers, read};
use glam::{DVec3, Vec3};
use quietus_trace::filter::Filter;
use quietus_trace::scene::Scene;
use quietus_trace::tile::{PixelWork, Sample, SampleSink, render_tile};
use quietus_trace::view::View;
use rayon::prelude::*;

/// A pair of reference pictures, its scene, and the exposure to look at it with.
struct Reference {
    name: &'static str,
    scene: &'static str,
    exposure: f32,
    /// Whether the scene's limit of sample values was lifted.
    unclamped: bool,
}

const fn reference(name: &'static str, scene: &'static str) -> Reference {
    Reference { name, scene, exposure: 1.0, unclamped: false }
}

const REFERENCES: [Reference; 15] = [
    reference("cornell-box", "cornell-box/cornell-box.pbrt"),
    reference("cornell-box-specular", "cornell-box/cornell-box-specular.pbrt"),
    reference("cornell-box-volume", "cornell-box/cornell-box-volume.pbrt"),
    reference("cornell-box-specular-volume", "cornell-box/cornell-box-specular-volume.pbrt"),
    reference("cb-volumetric-caustic", "cornell-box/volumetric-caustic.pbrt"),
    reference("volumetric-caustic-bdpt", "volumetric-caustic/volumetric-caustic.pbrt"),
    reference("veach-mis", "veach-mis/veach-mis.pbrt"),
    reference("veach-ajar", "veach-ajar/veach-ajar-local.pbrt"),
    reference("bmw-m6", "bmw-m6/bmw-m6-local.pbrt"),
    Reference { exposure: 0.043, ..reference("chopper-titan", "chopper-titan/chopper-titan-v4-local.pbrt") },
    Reference {
        exposure: 0.029,
        unclamped: true,
        ..reference("chopper-titan-noclamp", "chopper-titan/chopper-titan-v4-local.pbrt")
    },
    reference("grass", "generated/grass.pbrt"),
    reference("hairball", "generated/hairball.pbrt"),
    reference("many-lights-bokeh", "generated/many-lights-bokeh.pbrt"),
    reference("motion-blur", "generated/motion-blur.pbrt"),
];

/// Side of the blocks that are compared, in pixels: their means have little noise left.
const BLOCK: usize = 8;

/// Two independent halves of a picture.
struct Pair {
    size: [usize; 2],
    halves: [Vec<DVec3>; 2],
}

impl Pair {
    fn mean(&self, pixel: usize) -> DVec3 {
        0.5 * (self.halves[0][pixel] + self.halves[1][pixel])
    }

    /// Of that mean, as its halves show it.
    fn variance(&self, pixel: usize) -> DVec3 {
        let difference = 0.5 * (self.halves[0][pixel] - self.halves[1][pixel]);
        difference * difference
    }

    /// Means and their variances over blocks.
    fn blocks(&self) -> Vec<(DVec3, DVec3)> {
        let [width, height] = self.size;
        let block = |left: usize, top: usize| {
            let rows = top..(top + BLOCK).min(height);
            let pixels = rows.flat_map(|y| (left..(left + BLOCK).min(width)).map(move |x| y * width + x));
            let (mut sum, mut variance, mut count) = (DVec3::ZERO, DVec3::ZERO, 0.0);
            for pixel in pixels {
                sum += self.mean(pixel);
                variance += self.variance(pixel);
                count += 1.0;
            }
            (sum / count, variance / (count * count))
        };
        let corners = (0..height).step_by(BLOCK).flat_map(|y| (0..width).step_by(BLOCK).map(move |x| (x, y)));
        corners.map(|(x, y)| block(x, y)).collect()
    }

    fn picture_mean(&self) -> DVec3 {
        let pixels = self.halves[0].len();
        (0..pixels).map(|pixel| self.mean(pixel)).sum::<DVec3>() / pixels as f64
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut samples = 64;
    let (mut names, mut pictures) = (Vec::new(), None);
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        match word.parse() {
            Ok(number) => samples = number,
            Err(_) if word == "--pictures" => pictures = words.next().map(PathBuf::from),
            Err(_) => names.push(word),
        }
    }
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/scenes");
    println!("| reference | ours / pbrt: R | G | B | blocks off by | beyond noise | noise |");
    println!("|---|---|---|---|---|---|---|");
    for reference in REFERENCES.iter().filter(|r| names.is_empty() || names.iter().any(|name| name == r.name))
    {
        let theirs = their_pair(&scenes.join("references"), reference.name)?;
        match our_pair(&scenes.join(reference.scene), reference, theirs.size, samples) {
            Ok(ours) => {
                println!("| {} | {} |", reference.name, compare(&ours, &theirs));
                if let Some(folder) = &pictures {
                    write_beside(folder, reference, &ours, &theirs)?;
                }
            }
            Err(error) => println!("| {} | {error} |", reference.name),
        }
    }
    Ok(())
}

/// Ratios of means; then over blocks: the root mean square of the relative difference, what of it noise does not
/// explain, and what noise explains.
fn compare(ours: &Pair, theirs: &Pair) -> String {
    let ratio = ours.picture_mean() / theirs.picture_mean();
    let (mut square, mut noise, mut count) = (0.0, 0.0, 0.0);
    for ((a, var_a), (b, var_b)) in ours.blocks().into_iter().zip(theirs.blocks()) {
        for channel in 0..3 {
            // As in relMSE: dark blocks count by their absolute difference.
            let scale = b[channel] * b[channel] + 0.01;
            square += (a[channel] - b[channel]).powi(2) / scale;
            noise += (var_a[channel] + var_b[channel]) / scale;
            count += 1.0;
        }
    }
    let percent = |square: f64| 100.0 * (square / count).max(0.0).sqrt();
    format!(
        "{:.3} | {:.3} | {:.3} | {:.1} % | {:.1} % | {:.1} %",
        ratio.x,
        ratio.y,
        ratio.z,
        percent(square),
        percent(square - noise),
        percent(noise)
    )
}

fn their_pair(folder: &Path, name: &str) -> Result<Pair, Box<dyn Error>> {
    let half = |letter: char| -> Result<([usize; 2], Vec<DVec3>), Box<dyn Error>> {
        let picture = read()
            .no_deep_data()
            .largest_resolution_level()
            .rgb_channels(
                |size, _| (size.x(), vec![DVec3::ZERO; size.area()]),
                |(width, pixels): &mut (usize, Vec<DVec3>), at, (r, g, b): (f32, f32, f32)| {
                    pixels[at.y() * *width + at.x()] = Vec3::new(r, g, b).as_dvec3();
                },
            )
            .first_valid_layer()
            .all_attributes()
            .from_file(folder.join(format!("{name}_{letter}.exr")))?;
        let size = picture.layer_data.size;
        Ok(([size.x(), size.y()], picture.layer_data.channel_data.pixels.1))
    };
    let ((size, a), (_, b)) = (half('a')?, half('b')?);
    Ok(Pair { size, halves: [a, b] })
}

/// One half of one row.
struct Row(Vec<DVec3>);

impl SampleSink for Row {
    fn add(&mut self, work: &PixelWork, _: u32, sample: &Sample) {
        self.0[work.x as usize] += sample.radiance.as_dvec3() / f64::from(work.count);
    }
}

fn our_pair(
    path: &Path,
    reference: &Reference,
    size: [usize; 2],
    samples: u32,
) -> Result<Pair, Box<dyn Error>> {
    let loaded = quietus_scene::load(path)?;
    let (desc, picture) = (&loaded.scene, &loaded.scene.picture);
    let scene = Scene::build(desc)?;
    let limit = picture.max_component.filter(|_| !reference.unclamped).unwrap_or(f32::INFINITY);
    let view = View::new(
        &desc.cameras[0],
        size.map(|side| side as u32),
        Filter::BOX,
        picture.max_depth.unwrap_or(6),
        0,
    )?
    .with_exposure(picture.exposure.unwrap_or(Vec3::ONE), limit)?;
    let half = |replicate: u8| {
        let row = |y: usize| {
            let mut row = Row(vec![DVec3::ZERO; size[0]]);
            let count = samples.div_ceil(2);
            let run = |x| PixelWork { x, y: y as u32, pixel: 0, replicate, first: 0, count };
            let work: Vec<_> = (0..size[0] as u32).map(run).collect();
            render_tile(&scene, &view, &work, &mut row);
            row.0
        };
        (0..size[1]).into_par_iter().flat_map_iter(row).collect::<Vec<_>>()
    };
    Ok(Pair { size, halves: [half(0), half(1)] })
}

/// Writes ours and theirs beside each other.
fn write_beside(
    folder: &Path,
    reference: &Reference,
    ours: &Pair,
    theirs: &Pair,
) -> Result<(), Box<dyn Error>> {
    let [width, height] = ours.size;
    let pixel = |x: u32, y: u32| {
        let pair = if (x as usize) < width { ours } else { theirs };
        let color = pair.mean(y as usize * width + x as usize % width) * f64::from(reference.exposure);
        let encode = |value: f64| {
            let value = value.clamp(0.0, 1.0);
            let curved =
                if value <= 0.003_130_8 { 12.92 * value } else { 1.055 * value.powf(1.0 / 2.4) - 0.055 };
            (255.0 * curved).round() as u8
        };
        image::Rgb([encode(color.x), encode(color.y), encode(color.z)])
    };
    std::fs::create_dir_all(folder)?;
    let picture = image::RgbImage::from_fn(2 * width as u32, height as u32, pixel);
    picture.save(folder.join(format!("{}.png", reference.name)))?;
    Ok(())
}
