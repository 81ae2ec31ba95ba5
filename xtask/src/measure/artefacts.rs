//! Box artefacts as a number.

use quietus_film::Picture;

/// How much a picture's error keeps to its tiles.
pub(super) struct Artefacts {
    /// Mean squared error in display space.
    pub(super) mse: f64,
    /// Energy of the mean error of 8x8 blocks on the tile grid, over that of blocks displaced by half a tile both
    /// ways. 1 where errors know nothing of tiles; up to 4 where each tile has an error of its own.
    pub(super) block_ratio: f64,
    /// Mean squared step of the error between neighbours across a tile's edge, over that between neighbours
    /// inside a tile.
    pub(super) edge_ratio: f64,
    /// Error of the most wrong tile's mean, as share of white.
    pub(super) worst_tile: f64,
}

/// Brightness in display space: the square root stands for gamma, as in the error metric.
fn display(picture: &Picture) -> Vec<f64> {
    let grey = |c: &[f32; 4]| (f64::from(c[0]) + f64::from(c[1]) + f64::from(c[2])) / 3.0;
    picture.beauty.iter().map(|c| grey(c).clamp(0.0, 1.0).sqrt()).collect()
}

/// Compares a picture with a reference of the same size, of whole tiles.
pub(super) fn artefacts(picture: &Picture, reference: &Picture) -> Artefacts {
    let [w, h] = picture.frame.map(|side| side as usize);
    let error: Vec<f64> = display(picture).iter().zip(display(reference)).map(|(a, b)| a - b).collect();
    let blocks = |offset: usize| -> Vec<f64> {
        let starts = |side: usize| (0..).map(move |i| offset + 8 * i).take_while(move |&s| s + 8 <= side);
        starts(h)
            .flat_map(|y| starts(w).map(move |x| (x, y)))
            .map(|(x, y)| (y..y + 8).flat_map(|y| &error[y * w + x..y * w + x + 8]).sum::<f64>() / 64.0)
            .collect()
    };
    let energy = |means: &[f64]| means.iter().map(|m| m * m).sum::<f64>() / means.len() as f64;
    let (aligned, displaced) = (blocks(0), blocks(4));
    let (mut across, mut inside) = ((0.0, 0u32), (0.0, 0u32));
    for y in 0..h {
        for x in 0..w {
            for (neighbour, edge) in [((x + 1, y), x % 8 == 7), ((x, y + 1), y % 8 == 7)] {
                if neighbour.0 < w && neighbour.1 < h {
                    let step = error[y * w + x] - error[neighbour.1 * w + neighbour.0];
                    let sum = if edge { &mut across } else { &mut inside };
                    sum.0 += step * step;
                    sum.1 += 1;
                }
            }
        }
    }
    Artefacts {
        mse: error.iter().map(|e| e * e).sum::<f64>() / error.len() as f64,
        block_ratio: energy(&aligned) / energy(&displaced),
        edge_ratio: (across.0 / f64::from(across.1)) / (inside.0 / f64::from(inside.1)),
        worst_tile: aligned.iter().fold(0.0, |worst: f64, m| worst.max(m.abs())),
    }
}
