//! The error of a region, and the threshold it is held against (Dammertz et al. 2010; the talk, section 2).

use crate::error_metric::PixelError;

/// The error of a region of `pixels` pixels (real-valued) in a frame of `frame_area` pixels, from the exact sum of
/// its pixels' errors in steps of [`PixelError`]:
///
/// ```text
/// e_R = (r / N) sum e_p,   r = sqrt(N / N_img)   =>   e_R = sum e_p / sqrt(N N_img)
/// ```
///
/// Small regions may keep more error per pixel: r makes noise in a few pixels count less than noise over a large
/// area. `frame_area` is a setting, so that a crop keeps the meaning of the threshold.
pub fn region_error(error_sum: u64, pixels: f64, frame_area: f64) -> f64 {
    error_sum as f64 / (1u64 << PixelError::FRACTION_BITS) as f64 / (pixels * frame_area).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_frame_has_the_mean_error_and_a_part_has_r_times_its_mean() {
        let step = 1u64 << PixelError::FRACTION_BITS;
        assert_eq!(region_error(500 * step, 1000.0, 1000.0), 0.5);
        // A quarter of the frame at the same error per pixel: r = 1/2.
        assert_eq!(region_error(125 * step, 250.0, 1000.0), 0.25);
    }
}
