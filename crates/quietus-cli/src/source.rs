//! What is drawn: the built-in scene, or a file that stays open while its frames are drawn.

use std::collections::HashSet;
use std::path::Path;

use quietus_scene::{Choice, Loaded, SceneFile};
use quietus_trace::desc::{Environment, SceneDesc};

use crate::args::RenderArgs;
use crate::error::Failure;
use crate::say;
use crate::timeline::{self, Timeline};

/// A scene, read once, and what is put around it.
pub(crate) struct Source {
    /// What messages call it.
    name: String,
    /// `None` for the built-in scene.
    file: Option<SceneFile>,
    /// Which animation frames are of; there is one where there are frames.
    animation: Option<usize>,
    environment: Surroundings,
    /// Warnings that were said.
    said: HashSet<String>,
}

/// What is around the scene.
enum Surroundings {
    /// What the file says, or what is made up for it.
    Own,
    /// Nothing.
    None,
    /// This.
    Other(Environment),
}

impl Source {
    /// Reads what `args` name.
    ///
    /// # Errors
    /// When a file cannot be read, or lacks the animation that is asked for.
    pub(crate) fn open(args: &RenderArgs, timeline: Option<&Timeline>) -> Result<Self, Failure> {
        let choice = Choice { variant: args.variant.as_deref(), scene: args.scene_in_file.as_deref() };
        let mut file = match args.scene.as_deref() {
            None if choice != Choice::default() => {
                return Err(Failure::usage("the built-in scene has neither variants nor other scenes"));
            }
            path => path.map(|path| SceneFile::open_choice(path, choice)).transpose()?,
        };
        if let (Some(file), Some([width, height])) = (&mut file, args.size)
            && width.min(height) > 0
        {
            file.set_picture_shape(width as f32 / height as f32);
        }
        let animation = match (timeline, &file) {
            (None, _) => None,
            (Some(_), None) => {
                return Err(Failure::usage("the built-in scene has no frames: it stands still"));
            }
            (Some(timeline), Some(file)) => Some(Self::animation(args, timeline, file)?),
        };
        let environment = match args.env.as_deref() {
            None => Surroundings::Own,
            Some(word) if word == Path::new("none") => Surroundings::None,
            Some(word) if word == Path::new("even") => Surroundings::Other(quietus_scene::even_sky()),
            Some(path) => Surroundings::Other(quietus_scene::load_environment(path)?),
        };
        Ok(Self { name: scene_name(args), file, animation, environment, said: HashSet::new() })
    }

    /// Picks the animation, and says which where that is not plain.
    fn animation(args: &RenderArgs, timeline: &Timeline, file: &SceneFile) -> Result<usize, Failure> {
        let (index, animation) = timeline::pick(file, args.animation.as_deref())?;
        let (name, seconds) = (&animation.name, animation.seconds);
        let count = file.animations().len();
        if args.animation.is_none() && count > 1 {
            say::aside(format_args!("drawing `{name}`, the first of {count} animations"));
        }
        let last = (f64::from(seconds) * timeline.fps).floor();
        if timeline.frames().last().is_some_and(|frame| f64::from(frame) > last) {
            say::aside(format_args!(
                "`{name}` ends after {seconds:.3} s, with frame {last}: later ones show its last pose"
            ));
        }
        Ok(index)
    }

    /// Name of the animation that frames are of.
    pub(crate) fn animation_name(&self) -> Option<&str> {
        Some(&self.file.as_ref()?.animations()[self.animation?].name)
    }

    /// The scene in its own pose, or while the shutter is open. Warnings are said, each once.
    ///
    /// # Errors
    /// When the scene cannot be made.
    pub(crate) fn scene(&mut self, shutter: Option<[f32; 2]>) -> Result<SceneDesc, Failure> {
        let mut loaded = match (&self.file, self.animation, shutter) {
            (None, ..) => Loaded { scene: quietus_scene::embedded(), warnings: Vec::new() },
            (Some(file), Some(animation), Some(shutter)) => file.animated(animation, shutter)?,
            (Some(file), ..) => file.still()?,
        };
        match &self.environment {
            Surroundings::Own => {}
            Surroundings::None => loaded.uncover(),
            Surroundings::Other(environment) => loaded.surround(environment.clone()),
        }
        for warning in &loaded.warnings {
            if self.said.insert(warning.to_string()) {
                say::warning(format_args!("{}: {warning}", self.name));
            }
        }
        Ok(loaded.scene)
    }
}

/// What messages call the scene.
pub(crate) fn scene_name(args: &RenderArgs) -> String {
    args.scene.as_ref().map_or_else(|| "built-in scene".to_owned(), |path| path.display().to_string())
}
