//! Grids of values: what they are somewhere, and what bounds them in a part.

use glam::Vec3;

use crate::desc::Grid;

impl<T: Copy + Default + std::ops::Add<Output = T> + std::ops::Mul<f32, Output = T>> Grid<T> {
    #[inline(always)]
    pub(super) fn value(&self, [x, y, z]: [u32; 3]) -> T {
        if let Some(bricks) = &self.bricks {
            return self.value_in_brick(bricks, [x, y, z]);
        }
        let [nx, ny, _] = self.size.map(|n| n as usize);
        self.values[(z as usize * ny + y as usize) * nx + x as usize]
    }

    #[inline]
    fn value_in_brick(&self, bricks: &[u32], at: [u32; 3]) -> T {
        let [nx, ny, _] = self.blocks().map(|n| n as usize);
        let ([x, y, z], [i, j, k]) =
            (at.map(|a| (a / Self::BRICK) as usize), at.map(|a| (a % Self::BRICK) as usize));
        match bricks[(z * ny + y) * nx + x] {
            brick if brick == Self::NOTHING => T::default(),
            brick => {
                let side = Self::BRICK as usize;
                self.values[brick as usize * Self::BRICK_CELLS + (k * side + j) * side + i]
            }
        }
    }

    /// Its value at `p` in the unit cube.
    pub(super) fn at(&self, p: Vec3) -> T {
        let size = Vec3::from_array(self.size.map(|n| n as f32));
        let place = p * size - 0.5;
        let low = place.floor();
        let share = place - low;
        let low = low.as_ivec3().to_array();
        // Beyond the last middles there is 0: the nearest value counts with a weight of 0.
        let corner = |axis: usize, upper: bool| {
            let at = low[axis].saturating_add(i32::from(upper));
            let last = self.size[axis] as i32 - 1;
            let weight = if upper { share[axis] } else { 1.0 - share[axis] };
            (at.clamp(0, last) as u32, if (0..=last).contains(&at) { weight } else { 0.0 })
        };
        let mut sum = None;
        for i in 0..8 {
            let corners: [_; 3] = std::array::from_fn(|axis| corner(axis, i >> axis & 1 == 1));
            let part =
                self.value(corners.map(|(at, _)| at)) * corners.iter().map(|(_, w)| w).product::<f32>();
            sum = Some(sum.map_or(part, |sum: T| sum + part));
        }
        sum.unwrap_or_else(|| unreachable!("eight corners"))
    }

    /// A bound of its values in a part of the unit cube, and about their mean.
    pub(super) fn over(
        &self,
        part: [[f32; 2]; 3],
        uniform: &[Option<T>],
        zero: T,
        most: impl Fn(T, T) -> T,
    ) -> (T, T) {
        /// Voxels by which the part is widened, as places are rounded.
        const MARGIN: f32 = 0.01;
        let spans: [[u32; 2]; 3] = std::array::from_fn(|axis| {
            let [low, high] = part[axis].map(|edge| edge * self.size[axis] as f32 - 0.5);
            let last = self.size[axis] as i32 - 1;
            [(low - MARGIN).floor() as i32, (high + MARGIN).floor() as i32 + 1]
                .map(|i| i.clamp(0, last) as u32)
        });
        if let Some(bricks) = &self.bricks {
            return self.over_bricks(bricks, spans, uniform, zero, most);
        }
        let [[x0, x1], [y0, y1], [z0, z1]] = spans;
        let (mut bound, mut sum, mut count) = (zero, zero, 0_u32);
        for z in z0..=z1 {
            for y in y0..=y1 {
                for x in x0..=x1 {
                    let value = self.value([x, y, z]);
                    (bound, sum, count) = (most(bound, value), sum + value, count + 1);
                }
            }
        }
        (bound, sum * (1.0 / count as f32))
    }

    /// The same for a grid in bricks: those that are the same everywhere are looked at once.
    fn over_bricks(
        &self,
        bricks: &[u32],
        spans: [[u32; 2]; 3],
        uniform: &[Option<T>],
        zero: T,
        most: impl Fn(T, T) -> T,
    ) -> (T, T) {
        let [nx, ny, _] = self.blocks().map(|n| n as usize);
        let all = |axis: usize, [from, to]: [u32; 2]| {
            let [low, high] = spans[axis];
            low.max(from)..(high + 1).min(to)
        };
        let blocks = spans.map(|[low, high]| low / Self::BRICK..high / Self::BRICK + 1);
        let (mut bound, mut sum, mut count) = (zero, zero, 0.0_f32);
        for z in blocks[2].clone() {
            for y in blocks[1].clone() {
                for x in blocks[0].clone() {
                    let edges = [x, y, z].map(|b| [b * Self::BRICK, (b + 1) * Self::BRICK]);
                    let [xs, ys, zs] = [all(0, edges[0]), all(1, edges[1]), all(2, edges[2])];
                    let cells = (xs.len() * ys.len() * zs.len()) as f32;
                    count += cells;
                    let brick = bricks[(z as usize * ny + y as usize) * nx + x as usize];
                    if brick == Self::NOTHING {
                        continue;
                    }
                    if let Some(Some(value)) = uniform.get(brick as usize) {
                        (bound, sum) = (most(bound, *value), sum + *value * cells);
                        continue;
                    }
                    for at in cells_of([xs, ys, zs]) {
                        let value = self.value(at);
                        (bound, sum) = (most(bound, value), sum + value);
                    }
                }
            }
        }
        (bound, sum * (1.0 / count))
    }
}

/// All cells of a box, x fastest.
fn cells_of([xs, ys, zs]: [std::ops::Range<u32>; 3]) -> impl Iterator<Item = [u32; 3]> {
    zs.flat_map(move |z| {
        let xs = xs.clone();
        ys.clone().flat_map(move |y| xs.clone().map(move |x| [x, y, z]))
    })
}

impl<T: Copy + PartialEq> Grid<T> {
    /// For each brick its value, where that is the same everywhere.
    pub(super) fn uniform_bricks(&self) -> Vec<Option<T>> {
        let bricks = self.bricks.iter().flat_map(|_| self.values.chunks_exact(Self::BRICK_CELLS));
        bricks.map(|values| values.iter().all(|value| *value == values[0]).then_some(values[0])).collect()
    }
}
