//! A renderer that draws whole passes, as one on a GPU does: sample counts of all pixels go in, errors come out. Its film
//! holds the sum of all samples and that of the even ones, as many renderers' films do.
//!
//! ```sh
//! cargo run --release -p quietus --example whole_passes
//! ```

use quietus::{PixelError, ReplicateMean, Settings, WholePasses};

const WIDTH: u32 = 320;
const HEIGHT: u32 = 200;

/// A pixel of the film: the sum of all samples, that of samples 0, 2, 4, ..., and how many there are in all.
#[derive(Clone, Copy, Default)]
struct Pixel {
    sum: f32,
    even_sum: f32,
    count: u32,
}

impl Pixel {
    /// The means of even and of odd samples.
    fn replicates(&self) -> [(u32, f32); 2] {
        let (even, odd) = (self.count.div_ceil(2), self.count / 2);
        [(even, self.even_sum / even as f32), (odd, (self.sum - self.even_sum) / odd as f32)]
    }
}

/// Sample `number` of a pixel: light that a few samples in a hundred meet, the rarer the farther to the right.
fn trace(pixel: usize, number: u32) -> f32 {
    let seed = (pixel as u64) << 32 | u64::from(number);
    let hash = (seed ^ seed >> 31).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let random = ((hash ^ hash >> 29).wrapping_mul(0x94d0_49bb_1331_11eb) >> 40) as f32 / (1 << 24) as f32;
    let rarity = 1.0 + (pixel as u32 % WIDTH) as f32 / 8.0;
    if random * rarity < 1.0 { 0.2 * rarity } else { 0.0 }
}

/// What a kernel does, one thread to a pixel: draws samples `first..end`.
fn kernel(film: &mut [Pixel], first: &[u32], end: &[u32]) {
    for (index, pixel) in film.iter_mut().enumerate() {
        for number in first[index]..end[index] {
            let value = trace(index, number);
            pixel.sum += value;
            pixel.even_sum += if number % 2 == 0 { value } else { 0.0 };
            pixel.count += 1;
        }
    }
}

fn main() -> Result<(), quietus::SettingsError> {
    let mut passes = WholePasses::new(Settings { max_samples: 2048, ..Settings::new(WIDTH, HEIGHT) })?;
    let mut film = vec![Pixel::default(); (WIDTH * HEIGHT) as usize];
    while let Some(pass) = passes.next_pass() {
        kernel(&mut film, pass.first(), pass.end());
        let errors: Vec<PixelError> = film
            .iter()
            .map(|pixel| {
                let halves = pixel.replicates().map(|(count, mean)| (count, [mean; 3]));
                let [even, odd] =
                    halves.each_ref().map(|(count, rgb)| ReplicateMean { count: *count, channels: rgb });
                pass.pixel_error(&[even, odd])
            })
            .collect();
        println!("pass {}: {} samples", pass.pass(), pass.work().map(|(_, run)| run.len()).sum::<usize>());
        pass.finish(&errors);
    }
    let column = |x: u32| (0..HEIGHT).map(|y| film[(y * WIDTH + x) as usize].count).sum::<u32>() / HEIGHT;
    println!("samples per pixel from left to right: {:?}", [0, 80, 160, 240, 319].map(column));
    Ok(())
}
