//! The ray kernel on generated scenes: build, primary, bounce and shadow rays. `cargo bench -p quietus-trace`.

// The comparison with Embree uses the rest of it.
#[allow(dead_code)]
mod common;

use std::time::Duration;

use common::{Scene, count_hits};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};

fn kernel(criterion: &mut Criterion) {
    for scene in [Scene::atrium(), Scene::lump()] {
        let mut group = criterion.benchmark_group(scene.name);
        group.sample_size(10).warm_up_time(Duration::from_secs(1)).measurement_time(Duration::from_secs(5));
        group.throughput(Throughput::Elements(scene.mesh.triangles.len() as u64));
        group.bench_function("build", |b| b.iter(|| scene.build()));
        let accel = scene.build();
        for rays in scene.rays(&accel, 640, 480) {
            group.throughput(Throughput::Elements(rays.rays.len() as u64));
            group.bench_function(rays.kind, |b| b.iter(|| count_hits(&accel, &rays)));
        }
        group.finish();
    }
}

criterion_group!(benches, kernel);
criterion_main!(benches);
