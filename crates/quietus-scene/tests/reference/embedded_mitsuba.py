"""Draws the embedded scene with Mitsuba 3, an independent renderer, as a reference for tests.

What Mitsuba cannot express exactly is replaced, in the test that reads the picture too: metals are perfectly smooth
(its GGX masks by another function) and the porcelain ball is diffuse. Written from the description of the scene, not
from its code: numbers stand here a second time on purpose.

    python3 -m venv venv && venv/bin/pip install mitsuba==3.9.1 numpy
    venv/bin/python embedded_mitsuba.py embedded.exr --batches 32 --spp 96

The EXR holds float channels: R, G, B are means over all batches; V.R, V.G, V.B the variances of these means, from the
spread of the batches, which have independent seeds.
"""

import argparse

import mitsuba as mi
import numpy as np

mi.set_variant("scalar_rgb")
from mitsuba import ScalarTransform4f as T  # noqa: E402  (exists once a variant is set)

SIZE = 64
MAX_DEPTH = 8


def rgb(r, g, b):
    return {"type": "rgb", "value": [r, g, b]}


def diffuse(*color):
    return {"type": "diffuse", "reflectance": rgb(*color)}


def metal(eta, k):
    return {"type": "conductor", "eta": rgb(*eta), "k": rgb(*k)}


def glass(*tint):
    return {
        "type": "dielectric",
        "int_ior": 1.5,
        "ext_ior": 1.0,
        "specular_transmittance": rgb(*tint),
    }


GOLD = metal((0.143, 0.375, 1.442), (3.983, 2.386, 1.603))
SILVER = metal((0.155, 0.117, 0.138), (4.828, 3.122, 2.147))


def two_sided(bsdf):
    return {"type": "twosided", "bsdf": bsdf}


def sphere(center, radius, bsdf, **more):
    return {"type": "sphere", "center": list(center), "radius": radius, "bsdf": bsdf, **more}


def wall(corner, edge_u, edge_v, bsdf, **more):
    """The parallelogram at `corner`; texture coordinates 0..1 along both edges."""
    corner, u, v = (np.array(x, dtype=float) for x in (corner, edge_u, edge_v))
    n = np.cross(u, v)
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1], matrix[:3, 2] = u / 2, v / 2, n / np.linalg.norm(n)
    matrix[:3, 3] = corner + u / 2 + v / 2
    return {"type": "rectangle", "to_world": T(matrix), "bsdf": two_sided(bsdf), **more}


def block(center, half, turn_degrees, bsdf):
    to_world = T().translate(list(center)).rotate([0, 1, 0], turn_degrees).scale(list(half))
    return {"type": "cube", "to_world": to_world, "bsdf": two_sided(bsdf)}


def checkers():
    """Floor tiles, 0.4 m wide: uv runs over the floor's 3.2 m x 4.2 m from the front left corner."""
    return {
        "type": "checkerboard",
        "color0": rgb(0.66, 0.62, 0.56),
        "color1": rgb(0.30, 0.27, 0.25),
        "to_uv": T().scale([3.2 * 1.25, 4.2 * 1.25, 1.0]),
    }


def scene():
    white = diffuse(0.74, 0.71, 0.66)
    left, right = diffuse(0.62, 0.20, 0.11), diffuse(0.08, 0.27, 0.33)
    lamp = np.array([-0.70, 1.42, 0.02])
    lamp_radius = 0.1
    top = lamp[1] + lamp_radius + 0.035 + 0.03
    eye, target = [0.12, 1.40, 2.75], [0.03, 0.56, -0.4]
    return {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": MAX_DEPTH, "rr_depth": 1000},
        "sensor": {
            "type": "perspective",
            "fov_axis": "y",
            "fov": 34.0,
            "to_world": T().look_at(origin=eye, target=target, up=[0, 1, 0]),
            "sampler": {"type": "independent"},
            "film": {
                "type": "hdrfilm",
                "width": SIZE,
                "height": SIZE,
                "rfilter": {"type": "box"},
                "component_format": "float32",
                "pixel_format": "rgb",
            },
        },
        "floor": wall([-1.6, 0, 3.0], [3.2, 0, 0], [0, 0, -4.2],
                      {"type": "diffuse", "reflectance": checkers()}),
        "ceiling": wall([-1.6, 2, -1.2], [3.2, 0, 0], [0, 0, 4.2], white),
        "back": wall([-1.6, 0, -1.2], [3.2, 0, 0], [0, 2, 0], white),
        "front": wall([1.6, 0, 3.0], [-3.2, 0, 0], [0, 2, 0], white),
        "left": wall([-1.6, 0, 3.0], [0, 0, -4.2], [0, 2, 0], left),
        "right": wall([1.6, 0, -1.2], [0, 0, 4.2], [0, 2, 0], right),
        "lamp": sphere(lamp, lamp_radius, diffuse(0, 0, 0),
                       emitter={"type": "area", "radiance": rgb(34.0, 26.0, 17.0)}),
        "skylight": wall([0.1, 1.99, -0.3], [1.0, 0, 0], [0, 0, 1.2], diffuse(0, 0, 0),
                         emitter={"type": "area", "radiance": rgb(5.0, 6.0, 7.2)}),
        "socket": block(lamp + [0, lamp_radius + 0.035, 0], [0.016, 0.03, 0.016], 0, GOLD),
        "cord": block([lamp[0], (top + 2.0) / 2, lamp[2]], [0.004, (2.0 - top) / 2, 0.004], 0,
                      diffuse(0.05, 0.05, 0.05)),
        "plinth": block([0.98, 0.30, -0.72], [0.24, 0.30, 0.24], np.degrees(0.35), diffuse(0.72, 0.70, 0.67)),
        "porcelain": sphere([0.98, 0.80, -0.72], 0.2, diffuse(0.05, 0.16, 0.42)),
        "mirror": sphere([-0.72, 0.42, -0.55], 0.42, SILVER),
        "glass": sphere([0.20, 0.34, -0.04], 0.34, glass(1.0, 1.0, 1.0)),
        "amber": sphere([-0.36, 0.13, 0.36], 0.13, glass(1.0, 0.62, 0.18)),
        "gold": sphere([0.92, 0.15, 0.10], 0.15, GOLD),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("output")
    parser.add_argument("--batches", type=int, default=32)
    parser.add_argument("--spp", type=int, default=256)
    arguments = parser.parse_args()
    loaded = mi.load_dict(scene())
    pictures = np.stack([
        np.array(mi.render(loaded, spp=arguments.spp, seed=seed), dtype=np.float64)
        for seed in range(arguments.batches)
    ])
    mean = pictures.mean(axis=0)
    variance = pictures.var(axis=0, ddof=1) / arguments.batches
    channels = np.concatenate([mean, variance], axis=2).astype(np.float32)
    names = ["R", "G", "B", "V.R", "V.G", "V.B"]
    mi.Bitmap(channels, channel_names=names).write(arguments.output)


if __name__ == "__main__":
    main()
