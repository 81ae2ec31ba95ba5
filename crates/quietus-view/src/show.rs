//! From film and sampling to the board: what changed, as far as anybody looks.

use std::time::{Duration, Instant};

use quietus::{AdaptiveSampling, Regions};
use quietus_film::{Film, TileCopy};
use quietus_render::{Live, Progress};

use crate::board::Board;
use crate::layer::{LAYERS, Layer, PixelValues};
use crate::message::{Moment, TREE, header};

/// Tiles that are encoded before the board is locked once to take them.
const CHUNK: usize = 64;

/// How often masks are looked through for changes.
const MASK_INTERVAL: Duration = Duration::from_millis(250);

/// How often the leaves of the trees are collected.
const TREE_INTERVAL: Duration = Duration::from_millis(500);

/// How often the times of rebuilds are collected.
const REBUILD_INTERVAL: Duration = Duration::from_secs(1);

/// What the render's thread remembers from one showing to the next.
#[derive(Default)]
pub(crate) struct Shower {
    status_at: Option<Instant>,
    masks_at: Option<Instant>,
    tree_at: Option<Instant>,
    rebuilds_at: Option<Instant>,
    /// Rebuilds that were reported.
    rebuilds: usize,
}

/// Whether it is time again, and if so notes the time.
fn is_due(last: &mut Option<Instant>, interval: Duration) -> bool {
    let due = last.is_none_or(|last| last.elapsed() >= interval);
    if due {
        *last = Some(Instant::now());
    }
    due
}

impl Shower {
    /// Brings the board up to date.
    pub(crate) fn show(&mut self, board: &Board, film: &Film, sampling: &AdaptiveSampling, live: &Live) {
        if board.lock().clients() == 0 {
            // The flags stay set until somebody comes.
            return;
        }
        let (kept, fresh) = Self::choose_layers(board);
        let film_layers = |layers: [bool; LAYERS]| {
            Layer::ALL
                .into_iter()
                .filter(move |&l| l != Layer::Active && layers[l as usize])
                .collect::<Vec<_>>()
        };
        let all = 0..film.layout().tiles().iter().product::<u32>() as usize;
        let fresh = film_layers(fresh);
        if !fresh.is_empty() {
            store_tiles(board, film, &fresh, all);
        }
        store_tiles(board, film, &film_layers(kept), live.take_changed());
        if kept[Layer::Active as usize] && is_due(&mut self.masks_at, MASK_INTERVAL) {
            store_masks(board, sampling);
        }
        let wants_tree = board.lock().wants_tree();
        if wants_tree && is_due(&mut self.tree_at, TREE_INTERVAL) {
            store_tree(board, sampling);
        }
        answer_probes(board, film, sampling);
    }

    /// Keeps the layers that are looked at, and forgets the others. Tells which are kept, and which of them are empty.
    fn choose_layers(board: &Board) -> ([bool; LAYERS], [bool; LAYERS]) {
        let (mut kept, mut fresh) = ([false; LAYERS], [false; LAYERS]);
        let mut content = board.lock();
        for layer in Layer::ALL {
            let wanted = content.wants(layer);
            let Some(canvas) = &mut content.canvas else { continue };
            if wanted {
                fresh[layer as usize] = !canvas.has(layer);
                canvas.keep(layer);
            } else {
                canvas.forget(layer);
            }
            kept[layer as usize] = wanted;
        }
        (kept, fresh)
    }

    /// Whether figures are to be renewed.
    pub(crate) fn is_status_due(&mut self, interval: Duration) -> bool {
        is_due(&mut self.status_at, interval)
    }

    /// The figures of this moment.
    pub(crate) fn moment(&mut self, progress: &Progress, sampling: &AdaptiveSampling) -> Moment {
        Moment {
            seconds: progress.elapsed.as_secs_f64(),
            spp: progress.spp_mean,
            rate: progress.samples_per_second,
            converged: progress.converged_fraction,
            rebuild_ms: is_due(&mut self.rebuilds_at, REBUILD_INTERVAL)
                .then(|| self.slowest_new_rebuild(sampling))
                .flatten(),
            noise_asked: progress.noise.map(|noise| 100.0 * noise.asked),
            noise: progress.noise.and_then(|noise| noise.measured).map(|noise| 100.0 * noise.reached),
        }
    }

    /// Of the rebuilds since this was last asked, in milliseconds.
    fn slowest_new_rebuild(&mut self, sampling: &AdaptiveSampling) -> Option<f64> {
        let rebuilds = sampling.statistics().rebuilds;
        let seen = std::mem::replace(&mut self.rebuilds, rebuilds.len());
        // They come region by region: the latest ones are those of the highest numbers.
        let mut latest = rebuilds;
        latest.sort_by_key(|rebuild| rebuild.generation);
        latest.iter().skip(seen).map(|rebuild| rebuild.nanoseconds as f64 * 1e-6).reduce(f64::max)
    }
}

/// Encodes the tiles and pins them up. Tiles without a sample are left out.
fn store_tiles(board: &Board, film: &Film, layers: &[Layer], tiles: impl Iterator<Item = usize>) {
    let bytes: usize = layers.iter().map(|layer| layer.tile_bytes()).sum();
    let mut buffer = vec![0; CHUNK * bytes];
    let mut tiles =
        tiles.filter_map(|index| Some((index, film.tile(index))).filter(|(_, tile)| has_samples(tile)));
    loop {
        // Encoded without the lock, a few at a time, so that nobody waits for it for long.
        let mut indices = Vec::with_capacity(CHUNK);
        for (buffer, (index, tile)) in buffer.chunks_exact_mut(bytes).zip(tiles.by_ref()) {
            let mut rest = buffer;
            for layer in layers {
                let (mine, others) = rest.split_at_mut(layer.tile_bytes());
                layer.encode(&tile, mine);
                rest = others;
            }
            indices.push(index);
        }
        let mut content = board.lock();
        let Some(canvas) = &mut content.canvas else { return };
        for (mut rest, index) in buffer.chunks_exact(bytes).zip(&indices) {
            for &layer in layers {
                let (mine, others) = rest.split_at(layer.tile_bytes());
                canvas.store(layer, *index, mine);
                rest = others;
            }
        }
        if indices.len() < CHUNK {
            return;
        }
    }
}

fn has_samples(tile: &TileCopy) -> bool {
    let counts = |row, column| tile.replicates(column, row).iter().any(|replicate| replicate.count > 0);
    (0..tile.window.height()).any(|row| (0..tile.window.width()).any(|column| counts(row, column)))
}

fn store_masks(board: &Board, sampling: &AdaptiveSampling) {
    let masks: Vec<u64> = (0..sampling.grid().tiles()).map(|tile| sampling.active_mask(tile)).collect();
    let mut content = board.lock();
    if let Some(canvas) = &mut content.canvas {
        for (tile, mask) in masks.iter().enumerate() {
            canvas.store(Layer::Active, tile, &mask.to_le_bytes());
        }
    }
}

/// Pins up the leaves of all trees if they changed.
fn store_tree(board: &Board, sampling: &AdaptiveSampling) {
    let regions = Regions::new(*sampling.grid(), sampling.settings().regions_per_axis);
    let (mut complete, mut active) = (Vec::new(), Vec::new());
    for (region, tree) in sampling.region_trees().iter().enumerate() {
        let home = regions.home_rect(region as u32);
        for leaf in tree.iter().flat_map(|tree| tree.leaves()) {
            // Leaves reach beyond the region's home; what lies there is the neighbour's to say.
            let x0 = leaf.area.x0.max(home.x0.into()) as f32;
            let y0 = leaf.area.y0.max(home.y0.into()) as f32;
            let x1 = leaf.area.x1.min(home.x1.into()) as f32;
            let y1 = leaf.area.y1.min(home.y1.into()) as f32;
            if x0 < x1 && y0 < y1 {
                if leaf.complete { &mut complete } else { &mut active }.push([x0, y0, x1, y1]);
            }
        }
    }
    let mut content = board.lock();
    let mut bytes = header(TREE, 0, content.session_number);
    [&complete, &active].iter().for_each(|leaves| bytes.extend((leaves.len() as u32).to_le_bytes()));
    complete.iter().chain(&active).flatten().for_each(|side| bytes.extend(side.to_le_bytes()));
    if *content.tree.1 != bytes {
        content.tree = (content.tree.0 + 1, bytes.into());
    }
}

fn answer_probes(board: &Board, film: &Film, sampling: &AdaptiveSampling) {
    let probes: Vec<_> = board.lock().probes.drain().collect();
    let window = film.layout().window();
    for (client, [x, y]) in probes {
        if !(window.x0..window.x1).contains(&x) || !(window.y0..window.y1).contains(&y) {
            continue;
        }
        let [column, row] = [x - window.x0, y - window.y0].map(|side| side / quietus_film::TILE);
        let index = film.layout().tile_index(column, row);
        let values = PixelValues::new(&film.tile(index), [x, y], sampling.active_mask(index as u32));
        board.lock().answers.insert(client, values);
    }
}
