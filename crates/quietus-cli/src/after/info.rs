//! `quietus info`: what is in a file.

use std::path::Path;

use quietus_film::{ExrInfo, OutputError, read_exr_info};
use quietus_scene::{Animation, SceneFile};

use super::significant;
use crate::error::Failure;
use crate::wishes::wishes;

/// The text that `quietus info FILE` prints.
///
/// # Errors
/// When the file is missing or is neither an EXR picture nor a scene.
pub(crate) fn describe(file: &Path) -> Result<String, Failure> {
    let is_exr = file.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("exr"));
    if is_exr {
        // Here the file is what is asked about, so everything wrong with it is a matter of input.
        let info = read_exr_info(file).map_err(|error: OutputError| Failure::input(error.to_string()))?;
        return Ok(describe_exr(&info));
    }
    let file = SceneFile::open(file)?;
    let loaded = file.still()?;
    let mut text = quietus_scene::summary(&loaded.scene).to_string();
    for (index, Animation { name, seconds }) in file.animations().iter().enumerate() {
        text.push_str(&format!("\nanimation {index}  {name}, {seconds:.3} s"));
    }
    if let scenes @ [_, _, ..] = file.scenes() {
        scenes.iter().for_each(|name| text.push_str(&format!("\nscene        {name}")));
    }
    for name in file.variants() {
        text.push_str(&format!("\nvariant      {name}"));
    }
    for wish in wishes(&loaded.scene.picture) {
        text.push_str(&format!("\nasks for     {}", wish.text));
    }
    for warning in &loaded.warnings {
        text.push_str(&format!("\nwarning: {warning}"));
    }
    Ok(text)
}

fn describe_exr(info: &ExrInfo) -> String {
    let [left, top, width, height] = info.frame;
    let mut lines = vec![format!("display window  {width}x{height} at ({left}, {top})")];
    for layer in &info.layers {
        if let Some(name) = &layer.name {
            lines.push(format!("layer           {name}"));
        }
        let [left, top, width, height] = layer.window;
        lines.push(format!("data window     {width}x{height} at ({left}, {top})"));
        for channel in &layer.channels {
            let mut line = format!(
                "channel         {:<9} {}  min {:<12} mean {:<12} max {}",
                channel.name,
                channel.kind,
                number(channel.min.into()),
                number(channel.mean),
                number(channel.max.into()),
            );
            if channel.nonfinite > 0 {
                line.push_str(&format!("  ({} not finite)", channel.nonfinite));
            }
            lines.push(line);
        }
        let settings = layer.metadata.iter();
        lines.extend(settings.map(|(name, value)| format!("{name:<15} {value}")));
    }
    lines.join("\n")
}

/// Six significant digits, without an exponent where that is readable.
fn number(value: f64) -> String {
    match value.abs() {
        0.0 | 1e-4..1e9 => significant(value, 6),
        _ => format!("{value:.5e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_six_digits() {
        let cases = [
            (0.0, "0"),
            (1.0, "1"),
            (-0.25, "-0.25"),
            (1234.5678, "1234.57"),
            (123_456_789.0, "123456789"),
            (1000.0, "1000"),
            (1e-7, "1.00000e-7"),
            (f64::INFINITY, "inf"),
        ];
        for (value, text) in cases {
            assert_eq!(number(value), text);
        }
    }
}
