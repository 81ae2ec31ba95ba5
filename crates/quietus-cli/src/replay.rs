//! What to say when the tracer panics: where, and the command that draws that sample again.

use std::fmt::Display;

use quietus_render::{Fault, RenderSettings};

use crate::args::RenderArgs;
use crate::report::name;

/// Names the sample that panicked, and the command that draws its pixel alone up to that sample. Replicates take
/// turns, so sample i of any of R replicates is drawn once the pixel has R (i + 1) samples.
pub(crate) fn fault_message(
    args: &RenderArgs,
    settings: &RenderSettings,
    max_depth: u32,
    frame: Option<u32>,
    fault: &Fault,
) -> String {
    let Fault { x, y, replicate, index, message } = fault;
    let mut command = Words(vec!["quietus render".to_owned()]);
    if args.fixed_seed {
        command.0.push("--fixed-seed".to_owned());
    }
    command.scene(args);
    command.moment(args, frame);
    let [width, height] = settings.frame;
    command.flag("--size", format_args!("{width}x{height}"));
    command.flag("--crop", format_args!("{x},{y},{},{}", x + 1, y + 1));
    command.flag("--spp", 2 * (u64::from(*index) + 1));
    command.flag("--max-depth", max_depth);
    command.option("--filter", args.filter.map(name));
    command.option("--exposure", args.exposure());
    command.option("--max-component", args.max_component);
    command.option("--clamp-indirect", args.clamp_indirect);
    command.flag("--seed", args.seed);
    command.flag("--threads", 1);
    command.flag("-o", "replay.exr");
    format!(
        "the tracer panicked at pixel ({x}, {y}), replicate {replicate}, sample {index}, seed {}: {message}\n\
         this draws the pixel alone: {}",
        args.seed,
        command.0.join(" ")
    )
}

/// A command line for a POSIX shell.
struct Words(Vec<String>);

impl Words {
    /// Which scene is drawn.
    fn scene(&mut self, args: &RenderArgs) {
        self.0.extend(args.scene.as_ref().map(|scene| quoted(&scene.display().to_string())));
        self.option("--camera", args.camera.as_ref());
        self.option("--scene-in-file", args.scene_in_file.as_ref());
        self.option("--variant", args.variant.as_ref());
        self.option("--env", args.env.as_ref().map(|env| env.display()));
    }

    /// Which moment of it.
    fn moment(&mut self, args: &RenderArgs, frame: Option<u32>) {
        let Some(frame) = frame else { return };
        self.flag("--frame", frame);
        self.option("--fps", args.fps);
        self.option("--shutter", args.shutter);
        self.option("--animation", args.animation.as_ref());
    }

    fn option(&mut self, name: &str, value: Option<impl Display>) {
        if let Some(value) = value {
            self.flag(name, value);
        }
    }

    fn flag(&mut self, name: &str, value: impl Display) {
        self.0.extend([name.to_owned(), quoted(&value.to_string())]);
    }
}

/// As one word.
fn quoted(text: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./,+:@%".contains(c);
    if !text.is_empty() && text.chars().all(plain) {
        return text.to_owned();
    }
    format!("'{}'", text.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;
    use std::time::Instant;

    use clap::Parser;
    use quietus_film::Window;
    use quietus_trace::desc::PictureDefaults;

    use super::*;
    use crate::args::{Cli, Command};
    use crate::plan::Plan;
    use crate::render::{Audience, draw, prepare};
    use crate::source::Source;

    fn parse(words: &[&str]) -> RenderArgs {
        match Cli::try_parse_from(words).unwrap().command {
            Some(Command::Render(args)) => *args,
            other => panic!("not a render: {other:?}"),
        }
    }

    #[test]
    fn a_panic_comes_with_the_command_that_draws_its_pixel_alone() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("a.png");
        let args = parse(&[
            "quietus",
            "render",
            "my scene.glb",
            "--seed",
            "42",
            "--max-depth",
            "5",
            "--filter",
            "box",
            "-o",
            out.to_str().unwrap(),
        ]);
        let camera = quietus_scene::embedded().cameras.remove(0);
        let picture = PictureDefaults::default();
        let decided = Plan::new(&args).unwrap().decide(&args, &camera, &picture).unwrap();
        let fault = Fault { x: 7, y: 9, replicate: 1, index: 20, message: "oh".to_owned() };
        let message = fault_message(&args, &decided.settings, decided.look.max_depth, None, &fault);
        let expected = "the tracer panicked at pixel (7, 9), replicate 1, sample 20, seed 42: oh\n\
                        this draws the pixel alone: quietus render 'my scene.glb' --size 640x360 --crop 7,9,8,10 \
                        --spp 42 --max-depth 5 --filter box --seed 42 --threads 1 -o replay.exr";
        assert_eq!(message, expected);
        let command = message.rsplit(": ").next().unwrap().replace("'my scene.glb'", "scene.glb");
        let replay = parse(&command.split(' ').collect::<Vec<_>>());
        assert_eq!(replay.crop, Some(Window { x0: 7, y0: 9, x1: 8, y1: 10 }));
        assert_eq!((replay.spp, replay.seed, replay.filter), (Some(42), 42, args.filter));
    }

    #[test]
    fn the_command_printed_draws_the_sample_that_panicked() {
        let args = parse(&["quietus", "render", "--size", "24x16", "--seed", "3", "--camera", "main"]);
        let (plan, fault) =
            (Plan::new(&args).unwrap(), Fault { x: 7, y: 9, replicate: 1, index: 20, message: "oh".into() });
        let prepared = |args: &RenderArgs, plan: &Plan| {
            let mut source = Source::open(args, None).unwrap();
            prepare(args, plan, &mut source, None, Instant::now()).unwrap()
        };
        let ready = prepared(&args, &plan);
        let message = fault_message(&args, &ready.settings, ready.look.max_depth, None, &fault);
        let replay = parse(&message.rsplit(": ").next().unwrap().split(' ').collect::<Vec<_>>());
        let ready = prepared(&replay, &Plan::new(&replay).unwrap());
        let plan = Plan::new(&replay).unwrap();
        let cancel = AtomicBool::new(false);
        let audience = Audience { cancel: &cancel, viewing: None };
        let rendered = draw(&replay, &plan, &ready, None, audience, None).unwrap();
        // Two replicates of 21 samples each: the last one is number 20.
        assert_eq!((rendered.film.sample_counts(), rendered.statistics.samples), (vec![42], 42));
        assert_eq!(ready.settings.window, Window { x0: 7, y0: 9, x1: 8, y1: 10 });
    }

    #[test]
    fn names_are_quoted_for_the_shell_where_needed() {
        assert_eq!(quoted("a/b-1.glb"), "a/b-1.glb");
        assert_eq!(quoted("it's"), r"'it'\''s'");
        assert_eq!(quoted(""), "''");
    }
}
