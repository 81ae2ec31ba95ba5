"""Draws an exported scene with Mitsuba 3 and prints what it took, as one line of JSON.

    python mitsuba_peer.py VARIANT FOLDER --samples N --threads T --seeds 1 2 [--warm-up]

FOLDER holds scene.json, a dictionary for mi.load_dict in which {"matrix": [16 numbers, row by row]} stands for
transforms. For every seed the picture is written as floats, row by row, to FOLDER/VARIANT-SEED.raw.
"""

import argparse
import json
import os
import resource
import time

START = time.perf_counter()

import drjit as dr  # noqa: E402
import mitsuba as mi  # noqa: E402
import numpy as np  # noqa: E402


def resolve(value):
    """Turns matrices into Mitsuba's transforms."""
    if isinstance(value, dict):
        if set(value) == {"matrix"}:
            return mi.ScalarTransform4f(np.array(value["matrix"], dtype=np.float64).reshape(4, 4))
        return {key: resolve(entry) for key, entry in value.items()}
    return value


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("variant")
    parser.add_argument("folder")
    parser.add_argument("--samples", type=int, required=True)
    parser.add_argument("--threads", type=int, required=True)
    parser.add_argument("--seeds", type=int, nargs="+", required=True)
    parser.add_argument("--warm-up", action="store_true", help="draw once before measuring: leaves compiling out")
    arguments = parser.parse_args()
    os.chdir(arguments.folder)
    mi.set_variant(arguments.variant)
    dr.set_thread_count(arguments.threads)
    with open("scene.json", encoding="utf-8") as file:
        scene = mi.load_dict(resolve(json.load(file)))
    load_seconds = time.perf_counter() - START
    if arguments.warm_up:
        np.array(mi.render(scene, spp=arguments.samples, seed=1000))
    # Its samplers round up what they cannot stratify: 32 becomes 35, and a picture takes as long as that.
    sampler = scene.sensors()[0].sampler().clone()
    sampler.set_sample_count(arguments.samples)
    wall, cpu = [], []
    for seed in arguments.seeds:
        wall_start, cpu_start = time.perf_counter(), time.process_time()
        picture = np.array(mi.render(scene, spp=arguments.samples, seed=seed), dtype=np.float32)
        wall.append(time.perf_counter() - wall_start)
        cpu.append(time.process_time() - cpu_start)
        picture[:, :, :3].tofile(f"{arguments.variant}-{seed}.raw")
    print(json.dumps({
        "load_seconds": load_seconds,
        "wall_seconds": wall,
        "cpu_seconds": cpu,
        "samples": sampler.sample_count(),
        "peak_bytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024,
    }))


if __name__ == "__main__":
    main()
