//! `cargo xtask gallery`: the pictures of docs/gallery.

use anyhow::Result;

use crate::run::{Quietus, root, shared_scenes};

/// Draws the embedded scene, the Cornell box and the flight helmet at 1280x720.
pub(crate) fn gallery() -> Result<()> {
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
