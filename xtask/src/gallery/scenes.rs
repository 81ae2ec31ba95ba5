//! The contact sheet: every scene file beside the repository, small, with what it took.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::Args;
use image::imageops::{self, FilterType};
use image::{Rgb, RgbImage};

use crate::run::{Quietus, number, root, shared_scenes};

/// `cargo xtask gallery scenes`.
#[derive(Args)]
pub(crate) struct Scenes {
    /// Seconds of rendering that a scene may take
    #[arg(long, default_value_t = 30)]
    seconds: u32,
    /// Only scenes whose path holds this; the sheet and the table are left as they are
    #[arg(long)]
    only: Option<String>,
    /// Keep the pictures, 640 wide, in this folder
    #[arg(long)]
    keep: Option<PathBuf>,
}

/// Width of a scene's picture.
const WIDTH: u32 = 640;
/// Pictures beside each other on the sheet, and their size there: a sheet of a megabyte or two.
const COLUMNS: u32 = 4;
const CELL: [u32; 2] = [240, 180];
/// Between them.
const GAP: u32 = 4;

/// One scene, drawn or not.
struct Row {
    scene: String,
    outcome: Result<Drawn>,
}

struct Drawn {
    picture: RgbImage,
    spp: f64,
    load: f64,
    seconds: f64,
    stopped_by: String,
    warnings: Vec<String>,
}

impl Scenes {
    /// Draws all scenes, then writes the sheet and the table.
    pub(super) fn draw(&self) -> Result<()> {
        let quietus = Quietus::build()?;
        let folder = shared_scenes()?;
        let mut files = Vec::new();
        collect(&folder, &mut files)?;
        files.sort();
        let keep = self.keep.clone().unwrap_or_else(|| quietus.scratch.path().to_path_buf());
        std::fs::create_dir_all(&keep)?;
        let mut rows = Vec::new();
        for file in &files {
            let scene = file.strip_prefix(&folder).unwrap_or(file).display().to_string();
            if self.only.as_ref().is_some_and(|only| !scene.contains(only)) {
                continue;
            }
            let outcome = self.scene(&quietus, &folder, file, &keep.join(picture_name(&scene)));
            println!("{}", line(rows.len(), &scene, &outcome));
            rows.push(Row { scene, outcome });
        }
        if self.only.is_some() {
            return Ok(());
        }
        let gallery = root().join("docs/gallery");
        sheet(&rows).save(gallery.join("scenes.png"))?;
        self.write_table(&gallery.join("README.md"), &rows)
    }

    fn scene(&self, quietus: &Quietus, folder: &Path, file: &Path, png: &Path) -> Result<Drawn> {
        let (width, seconds) = (WIDTH.to_string(), self.seconds.to_string());
        let studio = folder.join("hdri/studio_small_03_1k.hdr").display().to_string();
        let (file_words, png_words) = (file.display().to_string(), png.display().to_string());
        let mut words = vec![&*file_words, "--width", &width, "--time", &seconds, "-o", &png_words];
        // These come without light.
        if ["flight-helmet", "animated-fox"].iter().any(|name| file_words.contains(name)) {
            words.extend(["--env", &*studio]);
        }
        // Its sky is brighter than any picture; the exposure is that of the reference beside the scenes.
        if file_words.contains("chopper-titan") {
            words.extend(["--exposure", "0.043"]);
        }
        let (stats, said) = quietus.render_and_listen(&words)?;
        let picture = image::open(png).context("the picture was not written")?.into_rgb8();
        Ok(Drawn {
            picture,
            spp: number(&stats, "spp_mean")?,
            load: number(&stats, "load_seconds")?,
            seconds: number(&stats, "wall_seconds")?,
            stopped_by: stats["stopped_by"].as_str().unwrap_or_default().to_owned(),
            warnings: warnings(&said, &file_words),
        })
    }

    /// Replaces what stands between the marks.
    fn write_table(&self, path: &Path, rows: &[Row]) -> Result<()> {
        const MARKS: [&str; 2] =
            ["<!-- scenes: written by cargo xtask gallery scenes -->\n", "<!-- end of scenes -->"];
        let text = std::fs::read_to_string(path)?;
        let (before, rest) = text.split_once(MARKS[0]).context("the gallery's README has lost its marks")?;
        let (_, after) = rest.split_once(MARKS[1]).context("the gallery's README has lost its marks")?;
        let mut table = format!(
            "Drawn by `cargo xtask gallery scenes --seconds {}`: {WIDTH} wide, with the samples, depth and filter \
             that each scene asks for, on {} threads.\n\n![The scenes](scenes.png)\n\n\
             | place | scene | samples per pixel | loading | rendering | said |\n|---|---|---|---|---|---|\n",
            self.seconds,
            std::thread::available_parallelism()?,
        );
        for (index, row) in rows.iter().enumerate() {
            writeln!(table, "{}", line(index, &row.scene, &row.outcome))?;
        }
        std::fs::write(path, format!("{before}{}\n{table}\n{}{after}", MARKS[0], MARKS[1]))?;
        Ok(())
    }
}

/// Scene files in `folder` and below.
fn collect(folder: &Path, files: &mut Vec<PathBuf>) -> Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            collect(&path, files)?;
        } else if path.extension().is_some_and(|e| ["pbrt", "gltf", "glb"].iter().any(|name| e == *name)) {
            files.push(path);
        }
    }
    Ok(())
}

/// `a/b.pbrt` becomes `a-b.png`.
fn picture_name(scene: &str) -> String {
    format!("{}.png", Path::new(scene).with_extension("").display().to_string().replace(['/', '\\'], "-"))
}

/// The program's warnings, without the scene's path.
fn warnings(said: &str, scene: &str) -> Vec<String> {
    let prefix = format!("warning: {scene}: ");
    let text = |line: &str| line.strip_prefix(&prefix).or(line.strip_prefix("warning: ")).map(str::to_owned);
    said.lines().filter_map(text).collect()
}

/// A row of the table.
fn line(index: usize, scene: &str, outcome: &Result<Drawn>) -> String {
    let place = format!("{}, {}", index as u32 / COLUMNS + 1, index as u32 % COLUMNS + 1);
    match outcome {
        Ok(Drawn { spp, load, seconds, stopped_by, warnings, .. }) => {
            let time = if stopped_by == "time" { ", time was up" } else { "" };
            let said = warnings.join("; ").replace('|', "/");
            format!("| {place} | {scene} | {spp:.0}{time} | {load:.1} s | {seconds:.1} s | {said} |")
        }
        Err(error) => format!(
            "| {place} | {scene} | | | | not drawn: {} |",
            format!("{error:#}").replace(['|', '\n'], " ")
        ),
    }
}

/// All pictures beside and below each other, each as large as it can be in its cell; black where there is none.
fn sheet(rows: &[Row]) -> RgbImage {
    let count = rows.len() as u32;
    let [width, height] = CELL.map(|side| side + GAP);
    let mut sheet =
        RgbImage::from_pixel(COLUMNS * width + GAP, count.div_ceil(COLUMNS) * height + GAP, Rgb([32; 3]));
    for (index, row) in (0..).zip(rows) {
        let Ok(drawn) = &row.outcome else { continue };
        let (w, h) = drawn.picture.dimensions();
        let scale = f64::min(f64::from(CELL[0]) / f64::from(w), f64::from(CELL[1]) / f64::from(h));
        let [w, h] = [w, h].map(|side| ((f64::from(side) * scale).round() as u32).max(1));
        let small = imageops::resize(&drawn.picture, w, h, FilterType::Triangle);
        let x = index % COLUMNS * width + GAP + (CELL[0].saturating_sub(w)) / 2;
        let y = index / COLUMNS * height + GAP + (CELL[1].saturating_sub(h)) / 2;
        imageops::replace(&mut sheet, &small, x.into(), y.into());
    }
    sheet
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(width: u32, height: u32) -> Result<Drawn> {
        let picture = RgbImage::from_pixel(width, height, Rgb([200; 3]));
        let warnings = vec!["a | b".to_owned()];
        Ok(Drawn { picture, spp: 12.3, load: 0.04, seconds: 30.01, stopped_by: "time".to_owned(), warnings })
    }

    #[test]
    fn rows_say_what_happened() {
        assert_eq!(
            line(5, "a/b.pbrt", &drawn(1, 1)),
            "| 2, 2 | a/b.pbrt | 12, time was up | 0.0 s | 30.0 s | a / b |"
        );
        let refused = line(0, "c.glb", &Err(anyhow::anyhow!("no such\nfile | here")));
        assert_eq!(refused, "| 1, 1 | c.glb | | | | not drawn: no such file   here |");
        assert_eq!(picture_name("a/b.pbrt"), "a-b.png");
        let said =
            "warning: /x/a.pbrt: 3:1: odd\n/x/a.pbrt asks for: much\nwarning: 2 samples were not finite";
        assert_eq!(warnings(said, "/x/a.pbrt"), ["3:1: odd", "2 samples were not finite"]);
    }

    /// Five pictures are two rows, each in the middle of its cell; what was not drawn leaves its cell empty.
    #[test]
    fn the_sheet_holds_every_picture() {
        let outcomes =
            [drawn(640, 360), drawn(10, 400), Err(anyhow::anyhow!("no")), drawn(1, 1), drawn(640, 480)];
        let rows = outcomes.map(|outcome| Row { scene: String::new(), outcome });
        let sheet = sheet(&rows);
        assert_eq!(sheet.dimensions(), (4 * 244 + 4, 2 * 184 + 4));
        let centre = |column: u32, row: u32| sheet.get_pixel(column * 244 + 4 + 120, row * 184 + 4 + 90).0[0];
        assert_eq!(
            [centre(0, 0), centre(1, 0), centre(2, 0), centre(3, 0), centre(0, 1)],
            [200, 200, 32, 200, 200]
        );
    }

    #[test]
    fn the_table_stands_between_its_marks() {
        let folder = tempfile::tempdir().unwrap();
        let readme = folder.path().join("README.md");
        let text = std::fs::read_to_string(root().join("docs/gallery/README.md")).unwrap();
        std::fs::write(&readme, &text).unwrap();
        let scenes = Scenes { seconds: 7, only: None, keep: None };
        let rows = [Row { scene: "a.glb".to_owned(), outcome: drawn(1, 1) }];
        for _ in 0..2 {
            scenes.write_table(&readme, &rows).unwrap();
        }
        let written = std::fs::read_to_string(&readme).unwrap();
        assert_eq!(written.matches("| 1, 1 | a.glb |").count(), 1);
        assert!(written.contains("`cargo xtask gallery scenes --seconds 7`"));
        assert_eq!(written.split("<!--").next(), text.split("<!--").next());
    }
}
