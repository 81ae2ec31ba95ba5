//! Goes on from hostile checkpoints. Whatever the bytes are, there is an error with words or a picture that is drawn to its
//! end. The ordinary tests replay the corpus through the same function.

use std::num::NonZeroUsize;
use std::sync::atomic::AtomicBool;

use quietus_film::Window;
use quietus_render::checkpoint::{Checkpoint, sealed};
use quietus_render::{
    Control, Goal, Keeping, Machinery, RenderError, RenderSettings, Rendered, Sampling, Tracer,
    render_keeping,
};
use quietus_trace::tile::{PixelWork, Sample, SampleSink, TileCounts};

/// Draws something without a scene.
struct Stripes;

impl Tracer for Stripes {
    fn render_tile(&self, work: &[PixelWork], sink: &mut impl SampleSink) -> TileCounts {
        for run in work {
            for index in run.first..run.first + run.count {
                let value = ((run.x * 7 + index * 5 + u32::from(run.replicate)) % 11) as f32;
                sink.add(run, index, &Sample { radiance: [value, 1.0, 0.5].into(), ..Sample::default() });
            }
        }
        TileCounts::default()
    }
}

/// The picture that checkpoints are of.
pub fn settings(sampling: Sampling) -> RenderSettings {
    RenderSettings {
        frame: [20, 12],
        window: Window { x0: 0, y0: 0, x1: 20, y1: 12 },
        sampling,
        goal: Goal::TargetError(0.02),
        min_samples: 4,
        max_samples: 40,
        time_limit: None,
        threads: NonZeroUsize::MIN,
        machinery: Machinery::default(),
        weights: None,
        aov_noise: [None; 3],
    }
}

/// Any bytes, taken for whole, as a checkpoint, and what is drawn from it.
pub fn checkpoint(bytes: &[u8], sampling: Sampling) -> Result<Rendered, String> {
    let sealed = sealed(bytes);
    let settings = settings(sampling);
    let layout = settings.layout().map_err(|error| error.to_string())?;
    let checkpoint = Checkpoint::from_bytes(&sealed).map_err(|error| error.to_string())?;
    let state = checkpoint.state(&layout).map_err(|error| error.to_string())?;
    draw(&settings, &mut Keeping { from: Some(state), ..Keeping::default() })
        .map_err(|error| error.to_string())
}

/// Draws to the end.
pub fn draw(settings: &RenderSettings, keeping: &mut Keeping) -> Result<Rendered, RenderError> {
    let control = &mut Control { cancel: &AtomicBool::new(false), watch: &mut |_| (), live: None };
    render_keeping(&Stripes, settings, control, keeping)
}
