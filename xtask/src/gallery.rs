//! `cargo xtask gallery`: the pictures of docs/gallery.

mod scenes;

use anyhow::Result;
use clap::Subcommand;

use crate::run::{Quietus, root, shared_scenes};

/// Pictures that are asked for by name.
#[derive(Subcommand)]
pub(crate) enum Gallery {
    /// Every scene file beside the repository on one sheet, with a table in docs/gallery/README.md
    Scenes(scenes::Scenes),
}

/// Draws what is asked for.
pub(crate) fn gallery(what: Option<Gallery>) -> Result<()> {
    match what {
        None => large(),
        Some(Gallery::Scenes(scenes)) => scenes.draw(),
    }
}

/// Draws the embedded scene, the Cornell box and the flight helmet at 1280x720.
fn large() -> Result<()> {
    let quietus = Quietus::build()?;
    let scenes = shared_scenes()?;
    let folder = root().join("docs/gallery");
    let draw = |name: &str, words: &[&str]| -> Result<()> {
        let png = folder.join(name).display().to_string();
        let mut all = words.to_vec();
        all.extend(["-o", &png]);
        let stats = quietus.render(&all)?;
        println!(
            "| {name} | {} | {:.1} | {:.1} |",
            words.join(" "),
            stats["spp_mean"],
            stats["wall_seconds"]
        );
        Ok(())
    };
    println!("| picture | words | spp | seconds |\n|---|---|---|---|");
    let path = |scene: &str| scenes.join(scene).display().to_string();
    let (cornell, helmet) =
        (path("cornell-box/gltf/CornellBox.glb"), path("flight-helmet/FlightHelmet.gltf"));
    let studio = path("hdri/studio_small_03_1k.hdr");
    draw("embedded.png", &["--size", "960x540", "--target-error", "0.0005"])?;
    draw("cornell-box.png", &[&cornell, "--size", "1280x720"])?;
    draw("flight-helmet.png", &[&helmet, "--size", "1280x720", "--env", &studio])
}
