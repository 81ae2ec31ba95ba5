//! Which moments of an animation are drawn, and what their pictures are called.

use std::path::{Path, PathBuf};

use quietus_scene::{Animation, SceneFile};

use crate::args::RenderArgs;
use crate::error::Failure;

/// Frames per second of films.
const FPS: f64 = 24.0;
/// Share of a frame's time for which its shutter is open: half of it, as in film cameras.
const SHUTTER: f64 = 0.5;

/// Frames to draw.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Timeline {
    /// First and last frame.
    frames: [u32; 2],
    /// Frames per second.
    pub fps: f64,
    /// Share of a frame's time for which the shutter is open.
    pub shutter: f64,
    /// Whether pictures are numbered even where their names do not say how.
    numbered: bool,
    /// Whether all frames have the same seed.
    fixed_seed: bool,
}

impl Timeline {
    /// What the flags ask for; `None` for one picture of the scene as it is stored.
    ///
    /// # Errors
    /// Flags that mean nothing without a frame.
    pub(crate) fn new(args: &RenderArgs) -> Result<Option<Self>, Failure> {
        let frames = args.frames.or(args.frame.map(|frame| [frame; 2]));
        let Some(frames) = frames else {
            let flags = [
                ("--fps", args.fps.is_some()),
                ("--shutter", args.shutter.is_some()),
                ("--animation", args.animation.is_some()),
                ("--fixed-seed", args.fixed_seed),
            ];
            return match flags.iter().find(|(_, given)| *given) {
                None => Ok(None),
                Some((flag, _)) => Err(Failure::usage(format!("{flag} needs --frame or --frames"))),
            };
        };
        let (fps, shutter) = (args.fps.unwrap_or(FPS), args.shutter.unwrap_or(SHUTTER));
        let (numbered, fixed_seed) = (args.frames.is_some(), args.fixed_seed);
        Ok(Some(Self { frames, fps, shutter, numbered, fixed_seed }))
    }

    /// The frames in turn.
    pub(crate) fn frames(&self) -> impl Iterator<Item = u32> + use<> {
        self.frames[0]..=self.frames[1]
    }

    /// When the shutter opens and closes for `frame`, in seconds: it opens at the frame's own time.
    pub(crate) fn shutter(&self, frame: u32) -> [f32; 2] {
        let frame = f64::from(frame);
        [frame, frame + self.shutter].map(|frame| (frame / self.fps) as f32)
    }

    /// The seed of `frame` where `seed` is asked for.
    pub(crate) fn seed_of(&self, seed: u64, frame: u32) -> u64 {
        if self.fixed_seed { seed } else { Self::seed(seed, frame) }
    }

    /// The seed of `frame`: its own, whichever other frames are drawn. That of one frame tells nothing of that of the next
    /// (the generator SplitMix64 of Steele, Lea and Flood 2014, at place `frame`).
    fn seed(seed: u64, frame: u32) -> u64 {
        let mixed = seed.wrapping_add((u64::from(frame) + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
        let mixed = (mixed ^ mixed >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ mixed >> 31
    }

    /// Where the picture of `frame` goes: the last run of `#` in the file's name becomes the frame's number, of at
    /// least as many digits; where there is none and the pictures are many, four digits go before the extension.
    pub(crate) fn name(&self, path: &Path, frame: u32) -> PathBuf {
        let Some(name) = path.file_name().and_then(|name| name.to_str()) else { return path.to_owned() };
        if let Some(end) = name.rfind('#') {
            let start = name[..end]
                .rfind(|c| c != '#')
                .map_or(0, |at| at + name[at..].chars().next().map_or(1, char::len_utf8));
            let digits = end + 1 - start;
            return path.with_file_name(format!("{}{frame:0digits$}{}", &name[..start], &name[end + 1..]));
        }
        match path.extension().and_then(|extension| extension.to_str()) {
            Some(extension) if self.numbered => path.with_extension(format!("{frame:04}.{extension}")),
            _ => path.to_owned(),
        }
    }
}

/// The animation of `file` called `wanted`, or with that number, or the first one.
///
/// # Errors
/// When there is none.
pub(crate) fn pick<'a>(file: &'a SceneFile, wanted: Option<&str>) -> Result<(usize, &'a Animation), Failure> {
    let all = file.animations();
    let found = match wanted {
        None => (!all.is_empty()).then_some(0),
        Some(wanted) => all
            .iter()
            .position(|animation| animation.name == wanted)
            .or_else(|| wanted.parse().ok().filter(|&index: &usize| index < all.len())),
    };
    match found {
        Some(index) => Ok((index, &all[index])),
        None if all.is_empty() => Err(Failure::usage("the scene has no animations to take a frame from")),
        None => {
            let names: Vec<_> = all.iter().map(|animation| format!("`{}`", animation.name)).collect();
            let (wanted, names) = (wanted.unwrap_or_default(), names.join(", "));
            Err(Failure::usage(format!("no animation is called `{wanted}`; the scene has {names}")))
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;
    use crate::args::{Cli, Command};

    fn timeline(flags: &str) -> Result<Option<Timeline>, String> {
        let words = ["quietus", "render"].into_iter().chain(flags.split_whitespace());
        match Cli::try_parse_from(words).map_err(|error| error.to_string())?.command {
            Some(Command::Render(args)) => Timeline::new(&args).map_err(|failure| failure.message),
            _ => unreachable!("`render` parses as `render`"),
        }
    }

    #[test]
    fn frames_have_their_times() {
        let film = timeline("--frames 2-4").unwrap().unwrap();
        assert_eq!(film.frames().collect::<Vec<_>>(), [2, 3, 4]);
        assert_eq!(film.shutter(12), [0.5, 0.5 + 0.5 / 24.0]);
        let still = timeline("--frame 30 --fps 60 --shutter 0").unwrap().unwrap();
        assert_eq!((still.frames().count(), still.shutter(30)), (1, [0.5, 0.5]));
        assert_eq!(timeline("").unwrap(), None);
    }

    #[test]
    fn pictures_are_numbered() {
        let (film, one) =
            (timeline("--frames 1-2").unwrap().unwrap(), timeline("--frame 7").unwrap().unwrap());
        let cases = [
            ("out.####.exr", "out.0007.exr", "out.0007.exr"),
            ("a#/ü##-#.png", "a#/ü##-7.png", "a#/ü##-7.png"),
            ("##.png", "07.png", "07.png"),
            ("ü#.png", "ü7.png", "ü7.png"),
            ("dir/a.b.png", "dir/a.b.0007.png", "dir/a.b.png"),
        ];
        for (name, many, single) in cases {
            assert_eq!(film.name(name.as_ref(), 7), Path::new(many));
            assert_eq!(one.name(name.as_ref(), 7), Path::new(single));
        }
        assert_eq!(film.name("a#.png".as_ref(), 1234), Path::new("a1234.png"));
    }

    #[test]
    fn every_frame_has_a_seed_of_its_own() {
        let seeds: std::collections::HashSet<u64> =
            (0..2).flat_map(|seed| (0..500).map(move |frame| Timeline::seed(seed, frame))).collect();
        assert_eq!(seeds.len(), 1000);
        // The first numbers of the published generator with the seed 0.
        assert_eq!(Timeline::seed(0, 0), 0xe220_a839_7b1d_cdaf);
        assert_eq!(Timeline::seed(0, 1), 0x6e78_9e6a_a1b9_65f4);
    }

    #[test]
    fn flags_that_mean_nothing_are_refused() {
        for flags in ["--fps 12", "--shutter 0.2", "--animation Walk", "--fixed-seed"] {
            assert!(timeline(flags).unwrap_err().contains("needs --frame"), "{flags}");
        }
        let bad = [
            "--frame 1 --frames 1-2",
            "--frames 5-2",
            "--frames 5",
            "--frame -1",
            "--frame 1 --fps 0",
            "--frame 1 --fps nan",
            "--frame 1 --shutter 1.5",
            "--frame 1 --shutter -0.1",
        ];
        for flags in bad {
            assert!(timeline(flags).is_err(), "{flags}");
        }
    }
}
