//! A look at the trees: an SVG of their leaves.

use std::fmt::Write;

use crate::{PixelRect, RegionTree, Regions};

/// Draws the leaves of the trees of all regions over the picture: complete ones pale, active ones filled, and the
/// borders of the regions' home areas. `trees` yields a tree for each region in turn, `None` where its policy
/// has none or it was not built yet. User units are pixels of the sampled grid.
pub fn tree_svg<'a>(regions: &Regions, trees: impl Iterator<Item = Option<&'a RegionTree>>) -> String {
    let (w, h) = (regions.grid().width(), regions.grid().height());
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {w} {h}\" width=\"{w}\" height=\"{h}\">\n\
         <title>Region tree: complete leaves pale, active leaves orange</title>\n\
         <style>rect{{stroke-width:.25;vector-effect:non-scaling-stroke}}\
         .c{{fill:#eef3f7;stroke:#7793a8}}.a{{fill:#f5a742;stroke:#8a4b00}}\
         .r{{fill:none;stroke:#1c1c1c;stroke-width:1}}</style>\n"
    );
    for (region, tree) in trees.enumerate() {
        let home = regions.home_rect(region as u32);
        for leaf in tree.iter().flat_map(|tree| tree.leaves()) {
            let class = if leaf.complete { 'c' } else { 'a' };
            // Leaves reach one tile beyond the region's home; what lies there is the neighbour's to say.
            let x0 = leaf.area.x0.max(home.x0.into());
            let y0 = leaf.area.y0.max(home.y0.into());
            let (width, height) =
                (leaf.area.x1.min(home.x1.into()) - x0, leaf.area.y1.min(home.y1.into()) - y0);
            if width > 0.0 && height > 0.0 {
                rect(&mut svg, class, [x0, y0, width, height]);
            }
        }
        let PixelRect { x0, y0, .. } = home;
        rect(&mut svg, 'r', [x0.into(), y0.into(), home.width().into(), home.height().into()]);
    }
    svg.push_str("</svg>\n");
    svg
}

fn rect(svg: &mut String, class: char, [x, y, width, height]: [f64; 4]) {
    // Writing to a string cannot fail.
    let _ = writeln!(
        svg,
        "<rect class=\"{class}\" x=\"{x:.2}\" y=\"{y:.2}\" width=\"{width:.2}\" height=\"{height:.2}\"/>"
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        ErrorPlane, PixelError, TileGrid,
        region_tree::{Split, TreeSettings},
        summed_area::SummedArea,
    };

    #[test]
    fn every_leaf_inside_its_home_is_drawn_once() {
        let regions = Regions::new(TileGrid::new(40, 24), 2);
        let plane = ErrorPlane::new(*regions.grid());
        plane.store_tile(3, &[PixelError::from_f32(1.0); 64]);
        let settings = TreeSettings { target_error: 0.01, frame_area: 960.0, split: Split::Continuous };
        let trees: Vec<RegionTree> = (0..regions.len())
            .map(|region| {
                let (mut sums, mut tree) = (SummedArea::default(), RegionTree::default());
                sums.load(&plane, regions.error_rect(region));
                tree.rebuild(&sums, &settings);
                tree
            })
            .collect();
        let svg = tree_svg(&regions, trees.iter().map(Some));
        let drawn =
            svg.lines().filter(|l| l.starts_with("<rect class=\"a") || l.starts_with("<rect class=\"c"));
        let area: f64 = drawn
            .map(|line| {
                let value = |key: &str| -> f64 {
                    let rest = &line[line.find(&format!(" {key}=\"")).unwrap() + key.len() + 3..];
                    rest[..rest.find('"').unwrap()].parse().unwrap()
                };
                value("width") * value("height")
            })
            .sum();
        // Coordinates are rounded to 0.01: the leaves' areas add up to the picture within that.
        assert!((area - 960.0).abs() < 5.0, "{area}");
        assert!(svg.contains("class=\"a\"") && svg.contains("class=\"c\""));
        assert_eq!(svg.matches("class=\"r\"").count(), 4);
        assert!(svg.ends_with("</svg>\n"));
    }
}
