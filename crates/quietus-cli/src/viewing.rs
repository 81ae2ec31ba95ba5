//! `--view` and `quietus view`: a render that is watched and steered from a browser.

use std::net::{IpAddr, Ipv4Addr};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use clap::Args;
use quietus_film::{Film, Layout, TILE, Window, read_exr_planes};
use quietus_render::{
    Control, Goal, Live, PathTracer, RenderSettings, Rendered, Sampling, StoppedBy, Watched, render,
};
use quietus_view::{Options, ReferencePicture, Session, State, Token, View, Wish, moved};

use crate::args::RenderArgs;
use crate::args::values::{parse_ip, within};
use crate::error::{Ending, Failure};
use crate::plan::Plan;
use crate::render::{Audience, Ready, draw, keep};
use crate::report::sampling_name;
use crate::say;
use crate::source::scene_name;

/// Flags on the live view.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Live view")]
pub(crate) struct ViewingArgs {
    /// Show the render in a browser while it runs, at the address that is printed (see docs/view.md).
    #[arg(long)]
    pub view: bool,

    /// IP address to serve the view at; 0.0.0.0 for every one of this machine's. [default: 127.0.0.1]
    #[arg(long, value_name = "ADDRESS", value_parser = parse_ip)]
    pub bind: Option<IpAddr>,

    /// Port to serve the view at; 0 for any that is free. [default: 0]
    #[arg(long, value_name = "PORT", value_parser = within(0..=u16::MAX))]
    pub port: Option<u16>,

    /// EXR picture of the same frame for the view to compare with.
    #[arg(long, value_name = "FILE.exr")]
    pub reference: Option<PathBuf>,
}

/// Environment variable with the token of the address, where it has to stay the same from run to run.
const TOKEN: &str = "QUIETUS_VIEW_TOKEN";

/// Pixels of the coarse picture that a moved camera shows at once: drawn in a few hundredths of a second.
const COARSE_PIXELS: f64 = 40_000.0;

/// After so long without a move the camera has arrived.
const SETTLED: Duration = Duration::from_millis(200);

/// How often a picture that is not drawn any more is looked at by those who wait for requests.
const STILL_INTERVAL: Duration = Duration::from_millis(50);

/// A view and what it wants.
pub(crate) struct Viewing {
    view: View,
    /// Whether the view goes on when the picture is done.
    stays: bool,
    /// That of the render that runs, or ran last.
    live: Option<Arc<Live>>,
    /// What ended the render.
    wish: Option<Wish>,
    /// Set when the render has to end, for a wish or for Ctrl-C.
    stop: Arc<AtomicBool>,
    /// The noise that was asked for while it ran, as a share of white.
    noise: Option<f64>,
    /// Distance of what the camera moves around.
    pivot: Option<f32>,
    /// Size of the picture to compare with.
    reference: Option<[u32; 2]>,
}

impl Viewing {
    /// Serves the view, where one is asked for, and says where.
    ///
    /// # Errors
    /// Flags without `--view`, a reference that cannot be read, a port that cannot be had.
    pub(crate) fn start(args: &RenderArgs, stays: bool) -> Result<Option<Self>, Failure> {
        let ViewingArgs { view, bind, port, reference } = &args.viewing;
        if !view && !stays {
            let flags = [
                ("--bind", bind.is_some()),
                ("--port", port.is_some()),
                ("--reference", reference.is_some()),
            ];
            return match flags.iter().find(|(_, given)| *given) {
                Some((flag, _)) => Err(Failure::usage(format!("{flag} is for the live view: add --view"))),
                None => Ok(None),
            };
        }
        let reference = reference.as_deref().map(read_reference).transpose()?;
        let size = reference.as_ref().map(|reference| reference.size);
        let options = Options {
            bind: bind.unwrap_or(IpAddr::V4(Ipv4Addr::LOCALHOST)),
            port: port.unwrap_or(0),
            token: token()?,
            reference,
        };
        let view = View::start(options).map_err(|error| Failure::usage(error.to_string()))?;
        say::address(&view.address());
        let stop = Arc::default();
        Ok(Some(Self {
            view,
            stays,
            live: None,
            wish: None,
            stop,
            noise: None,
            pivot: None,
            reference: size,
        }))
    }

    /// What draws has to stop for, and to show itself to.
    pub(crate) fn handles(&self) -> (Arc<AtomicBool>, Option<Arc<Live>>) {
        (Arc::clone(&self.stop), self.live.clone())
    }

    /// Shows a running render, and ends it when somebody wants another one, or `cancel` says so.
    pub(crate) fn watch(&mut self, watched: &Watched<'_>, cancel: &AtomicBool) {
        let Some(live) = self.live.clone() else { return };
        self.view.show(watched, &live);
        // The next wish is taken when this one was followed.
        if self.wish.is_none() {
            self.wish = self.view.next_wish(Duration::ZERO);
            self.pivot = self.pivot.or_else(|| depth_in_the_middle(watched.film));
        }
        if let Some(Wish::Noise(percent)) = self.wish {
            // No reason to end it.
            live.ask_noise(percent / 100.0);
            (self.noise, self.wish) = (Some(percent / 100.0), None);
        }
        // Relaxed: the flags guard no data.
        if self.wish.is_some() || cancel.load(Ordering::Relaxed) {
            self.stop.store(true, Ordering::Relaxed);
        }
    }

    /// Draws, shows and writes one picture, as often as somebody asks for another one.
    ///
    /// # Errors
    /// Anything that keeps the first picture from being drawn, or one from being written where nobody could ask again.
    pub(crate) fn picture(
        &mut self,
        args: &RenderArgs,
        plan: &Plan,
        ready: &mut Ready,
        frame: Option<u32>,
        cancel: &AtomicBool,
    ) -> Result<Ending, Failure> {
        let whole = ready.settings.window;
        self.begin(args, plan, ready, frame)?;
        let mut before = None;
        loop {
            self.stop.store(false, Ordering::Relaxed);
            let audience = Audience { cancel, viewing: Some(self) };
            let rendered = draw(args, plan, ready, frame, audience, before.take())?;
            if let Some(noise) = self.noise.take() {
                ready.ask_for_noise(noise);
            }
            let wish = match self.wish.take() {
                None | Some(Wish::Stop) => match self.keep(args, plan, ready, frame, &rendered, cancel)? {
                    Next::Wish(wish) => wish,
                    Next::End(ending) => return Ok(ending),
                },
                Some(wish) => wish,
            };
            if let Wish::Noise(percent) = wish {
                ready.ask_for_noise(percent / 100.0);
                // Who asks when the time is up wants to wait.
                ready.settings.time_limit = None;
                self.live.iter().for_each(|live| live.ask_noise(percent / 100.0));
                before = Some(rendered);
                self.view.go_on(self.live.clone());
            } else {
                drop(rendered);
                self.follow(args, ready, wish, whole);
                self.begin(args, plan, ready, frame)?;
            }
        }
    }

    /// Tells everybody what will be drawn.
    fn begin(
        &mut self,
        args: &RenderArgs,
        plan: &Plan,
        ready: &Ready,
        frame: Option<u32>,
    ) -> Result<(), Failure> {
        let RenderSettings { frame: size, window, sampling, .. } = ready.settings;
        let layout = Layout::new(size, window, 2)?;
        if let Some([width, height]) = self.reference.filter(|reference| *reference != size) {
            return Err(Failure::input(format!(
                "{}: expected the size of the frame, {}x{} pixels, found {width}x{height}",
                args.viewing.reference.as_deref().unwrap_or(Path::new("")).display(),
                size[0],
                size[1]
            )));
        }
        let live = Arc::new(Live::new(&layout));
        let moment = frame.map_or_else(String::new, |frame| format!(", frame {frame}"));
        let session = Session {
            title: format!("{}{moment}", scene_name(args)),
            frame: size,
            window: [window.x0, window.y0, window.x1, window.y1],
            sampling: sampling_name(sampling).to_owned(),
            has_tree: sampling.has_tree(),
            can_change_noise: goes_by_noise(sampling),
            can_restart: frame.is_none(),
            outputs: plan
                .outputs
                .iter()
                .map(|(path, _)| plan.name(path, frame).display().to_string())
                .collect(),
        };
        self.view.begin(session, layout, Arc::clone(&live));
        self.live = Some(live);
        self.pivot = None;
        Ok(())
    }

    /// Writes what was drawn and, where the view stays, waits for somebody to ask for more.
    fn keep(
        &mut self,
        args: &RenderArgs,
        plan: &Plan,
        ready: &Ready,
        frame: Option<u32>,
        rendered: &Rendered,
        cancel: &AtomicBool,
    ) -> Result<Next, Failure> {
        let is_done = rendered.stopped_by == StoppedBy::Done;
        self.view.end(if is_done { State::Finished } else { State::Stopped }, &rendered.statistics);
        self.show_still(rendered);
        let kept = keep(args, plan, ready, frame, rendered);
        let is_last = frame.is_none() && self.stays && !cancel.load(Ordering::Relaxed);
        match &kept {
            Ok(_) => {
                let names: Vec<_> = plan.outputs.iter().map(|(path, _)| plan.name(path, frame)).collect();
                let names: Vec<_> = names.iter().map(|path| path.display().to_string()).collect();
                self.view.say(format!("wrote {}", names.join(", ")), false);
            }
            Err(failure) => {
                self.view.say(format!("not written: {failure}"), true);
                if is_last {
                    say::warning(format_args!("{failure}; the picture is kept, “Stop and save” tries again"));
                }
            }
        }
        if !is_last {
            return kept.map(Next::End);
        }
        while !cancel.load(Ordering::Relaxed) {
            self.show_still(rendered);
            match self.view.next_wish(STILL_INTERVAL) {
                // Once more, perhaps to a disk that has room by now.
                Some(Wish::Stop) => return self.keep(args, plan, ready, frame, rendered, cancel),
                Some(Wish::Noise(_)) if !goes_by_noise(ready.settings.sampling) => (),
                Some(wish) => return Ok(Next::Wish(wish)),
                None => (),
            }
        }
        // It was written before.
        kept.map(Next::End)
    }

    fn show_still(&mut self, rendered: &Rendered) {
        if let Some(live) = self.live.clone() {
            self.view.show_still(&rendered.film, &rendered.sampling, &live);
        }
    }

    /// Changes what will be drawn, and shows it coarsely at once. Moves are followed until the camera rests.
    fn follow(&mut self, args: &RenderArgs, ready: &mut Ready, wish: Wish, whole: Window) {
        let mut next = Some(wish);
        while let Some(wish) = next.take() {
            let changed = match wish {
                Wish::Move(motion) => {
                    let mut distance = self.pivot.unwrap_or(ready.camera.focus_distance);
                    let camera = moved(&ready.camera, &mut distance, &motion);
                    self.pivot = Some(distance);
                    camera.is_some_and(|camera| ready.look_through(args, camera))
                }
                Wish::Home => ready.look_through(args, ready.scene_camera.clone()),
                Wish::Crop(window) => ready.crop(window.unwrap_or(whole)),
                Wish::Noise(percent) => ready.ask_for_noise(percent / 100.0),
                Wish::Stop => {
                    // As soon as there is something to be stopped.
                    self.wish = Some(Wish::Stop);
                    return;
                }
            };
            if !changed {
                self.view.say("that cannot be drawn: the picture stays as it is", true);
            }
            // Everything that has been asked for meanwhile is drawn at once.
            next = self.view.next_wish(Duration::ZERO);
            if next.is_none() {
                self.show_coarse(args, ready);
                next = self.view.next_wish(SETTLED);
            }
        }
    }

    /// Draws a small picture of everything, and shows it.
    fn show_coarse(&mut self, args: &RenderArgs, ready: &Ready) {
        let RenderSettings { frame: [width, height], window, .. } = ready.settings;
        let scale = (f64::from(width) * f64::from(height) / COARSE_PIXELS).sqrt().max(1.0);
        let frame = [width, height].map(|side| (f64::from(side) / scale).ceil() as u32);
        let shrink = |side: u32, axis: usize| u64::from(side) * u64::from(frame[axis]);
        let (full, down) =
            ([width, height], |a: u64, axis: usize| (a / u64::from([width, height][axis])) as u32);
        let up = |a: u64, axis: usize| a.div_ceil(u64::from(full[axis])) as u32;
        let small = Window {
            x0: down(shrink(window.x0, 0), 0),
            y0: down(shrink(window.y0, 1), 1),
            x1: up(shrink(window.x1, 0), 0),
            y1: up(shrink(window.y1, 1), 1),
        };
        let settings = RenderSettings {
            frame,
            window: small,
            sampling: Sampling::Uniform,
            goal: Goal::TargetError(1.0),
            min_samples: 2,
            max_samples: 2,
            time_limit: None,
            ..ready.settings.clone()
        };
        let Ok(view) = ready.view_of(args, &ready.camera, frame) else { return };
        let tracer = PathTracer { scene: &ready.scene, view: &view };
        let control = &mut Control { cancel: &AtomicBool::new(false), watch: &mut |_| (), live: None };
        // What is wrong with it will be told by the render proper.
        if let Ok(rendered) = render(&tracer, &settings, control) {
            let picture = rendered.film.picture(|_| 0.0);
            let large = |side: u32, axis: usize| {
                (u64::from(side) * u64::from(full[axis]) / u64::from(frame[axis])) as i32
            };
            let place = [large(small.x0, 0), large(small.y0, 1), large(small.x1, 0), large(small.y1, 1)];
            self.view.show_coarse(place, [small.width(), small.height()], &picture.beauty);
        }
    }
}

/// Whether it can be steered for noise.
pub(crate) fn goes_by_noise(sampling: Sampling) -> bool {
    matches!(sampling, Sampling::Quietus | Sampling::Uniform)
}

/// What comes after a picture.
enum Next {
    /// Another one.
    Wish(Wish),
    /// Nothing.
    End(Ending),
}

/// The token of the environment, if there is one.
fn token() -> Result<Option<Token>, Failure> {
    let Some(text) = std::env::var_os(TOKEN) else { return Ok(None) };
    let token = Token::chosen(&text.to_string_lossy());
    token.map(Some).map_err(|error| Failure::usage(format!("{TOKEN}: {error}")))
}

fn read_reference(path: &Path) -> Result<ReferencePicture, Failure> {
    let planes = read_exr_planes(path)?;
    let lacking = || Failure::input(format!("{}: expected the channels R, G and B", path.display()));
    let pixels = planes.rgb().ok_or_else(lacking)?;
    Ok(ReferencePicture {
        size: planes.size,
        pixels: pixels.into_iter().map(|[r, g, b]| [r, g, b, 1.0]).collect(),
    })
}

/// Distance of what the middle of the picture shows; `None` where nothing is seen, or not yet.
fn depth_in_the_middle(film: &Film) -> Option<f32> {
    let Window { x0, y0, x1, y1 } = film.layout().window();
    let [column, row] = [(x1 - x0) / 2, (y1 - y0) / 2];
    let tile = film.tile(film.layout().tile_index(column / TILE, row / TILE));
    Some(tile.aovs(column % TILE, row % TILE).depth()).filter(|depth| *depth > 0.0)
}
