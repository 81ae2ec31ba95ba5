//! When a picture is good enough, and which samples may be spent on it.

use quietus_render::{Goal, Sampling};

use crate::args::{RenderArgs, SamplingArg};
use crate::error::Failure;

/// Region error of a presentable picture, for samplings that cannot go by noise.
pub(crate) const TARGET_ERROR: f64 = 0.001;
/// Noise of a presentable picture, as a share of white.
const NOISE: f64 = 0.01;
/// The talk's limit: what is not done by then is not worth more of everybody else's time.
const MAX_SAMPLES: u32 = 4096;
/// Below this a pixel's error is too uncertain to act on (the talk, section 3.2).
const MIN_SAMPLES: u32 = 16;
/// Samples of `--sampling uniform` without `--spp`.
const UNIFORM_SAMPLES: u32 = 64;

/// When a picture is good enough.
pub(crate) fn goal(args: &RenderArgs, sampling: Sampling) -> Result<Goal, Failure> {
    if let (Some(_), false) = (args.noise, sampling.can_forecast()) {
        return Err(Failure::usage(match sampling {
            Sampling::Unbiased => {
                "--noise is for --sampling quietus and uniform: unbiased sampling decides once how many samples a pixel \
                 gets, and going on until the picture is good enough would bias it; it goes by --target-error"
            }
            _ => "--noise is for --sampling quietus and uniform; the others go by --target-error",
        }));
    }
    Ok(match (args.noise, args.target_error) {
        (Some(noise), _) => Goal::Noise(noise),
        (None, Some(error)) => Goal::TargetError(error),
        (None, None) if !sampling.can_forecast() => Goal::TargetError(TARGET_ERROR),
        (None, None) if sampling == Sampling::Uniform || args.time.is_some() => Goal::Limits,
        (None, None) => Goal::Noise(NOISE),
    })
}

/// How samples are spread, if that makes sense with the other flags.
pub(crate) fn sampling(args: &RenderArgs) -> Result<Sampling, Failure> {
    let asked = if args.unbiased { Some(SamplingArg::Unbiased) } else { args.sampling };
    let chosen = match (asked, args.spp) {
        (Some(chosen), None) | (Some(chosen @ SamplingArg::Uniform), Some(_)) => chosen,
        (None, Some(_)) => SamplingArg::Uniform,
        (None, None) => SamplingArg::Quietus,
        (Some(_), Some(_)) => {
            return Err(Failure::usage(
                "--spp is for --sampling uniform; adaptive sampling goes by --target-error, --min-samples and \
                 --max-samples",
            ));
        }
    };
    if chosen == SamplingArg::Uniform {
        let flags = [
            ("--target-error", args.target_error.is_some()),
            ("--min-samples", args.min_samples.is_some() && args.noise.is_none()),
            ("--max-samples", args.max_samples.is_some() && args.noise.is_none()),
        ];
        if let Some((flag, _)) = flags.iter().find(|(_, given)| *given) {
            return Err(Failure::usage(format!(
                "{flag} is for adaptive sampling; uniform sampling goes by --spp, --noise and --time"
            )));
        }
    }
    Ok(match chosen {
        SamplingArg::Quietus => Sampling::Quietus,
        SamplingArg::Unbiased => Sampling::Unbiased,
        SamplingArg::Talk => Sampling::Talk,
        SamplingArg::FreeRunning => Sampling::FreeRunning,
        SamplingArg::Tile => Sampling::Tile,
        SamplingArg::Dammertz => Sampling::Dammertz,
        SamplingArg::Pixel => Sampling::Pixel,
        SamplingArg::Uniform => Sampling::Uniform,
    })
}

/// Smallest and largest number of samples per pixel, in a scene that asks for `wished` ones.
pub(crate) fn sample_limits(
    args: &RenderArgs,
    sampling: Sampling,
    goal: Goal,
    wished: Option<u32>,
) -> Result<(u32, u32), Failure> {
    // Who asks for a noise or a time says when it is enough; what the scene's author took for enough does not count.
    let wished = wished.map(|samples| samples.max(1)).filter(|_| goes_by_samples(goal, sampling));
    if sampling == Sampling::Uniform && goes_by_samples(goal, sampling) {
        let unlimited = args.time.map(|_| u32::MAX);
        let spp = args.spp.or(unlimited).or(wished).unwrap_or(UNIFORM_SAMPLES);
        return Ok((spp, spp));
    }
    // A limit given alone moves the other one's default out of its way.
    let most = if goes_by_samples(goal, sampling) { MAX_SAMPLES } else { u32::MAX };
    let default = wished.unwrap_or(most);
    let max = args.max_samples.unwrap_or(default.max(args.min_samples.unwrap_or(0)));
    let min = args.min_samples.unwrap_or(MIN_SAMPLES.min(max));
    if min > max {
        return Err(Failure::usage(format!("--min-samples {min} is more than --max-samples {max}")));
    }
    Ok((min, max))
}

/// Whether a number of samples per pixel, where nobody gives one, has to end a picture.
pub(crate) fn goes_by_samples(goal: Goal, sampling: Sampling) -> bool {
    match goal {
        Goal::Noise(_) => false,
        Goal::TargetError(_) => true,
        Goal::Limits => sampling == Sampling::Uniform,
    }
}
