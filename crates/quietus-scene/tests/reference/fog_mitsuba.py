"""The scene fog.pbrt drawn by Mitsuba 3: means and standard errors of the four quarters of the picture.

    pip install mitsuba==3.9.1 && python fog_mitsuba.py

The batches are independent; standard errors come from how far they are apart.
"""

import os
import tempfile

import mitsuba as mi
import numpy as np

mi.set_variant("scalar_rgb")
from mitsuba import ScalarTransform4f as Transform  # noqa: E402 (only there once the variant is set)

SIZE, SPP, BATCHES = 40, 32, 300
FOLDER = tempfile.mkdtemp()


def rgb(value):
    return {"type": "rgb", "value": value}


def medium(absorption, scattering, g):
    extinction = [a + s for a, s in zip(absorption, scattering)]
    albedo = [s / e for s, e in zip(scattering, extinction)]
    phase = {"type": "hg", "g": g}
    return {"type": "homogeneous", "albedo": rgb(albedo), "sigma_t": rgb(extinction), "phase": phase}


def quad(corners, reflectance, radiance=None):
    mesh = mi.Mesh("quad", 4, 2)
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = np.array(corners, dtype=np.float32).ravel()
    parameters["faces"] = np.array([0, 1, 2, 2, 3, 0], dtype=np.uint32)
    parameters.update()
    name = os.path.join(FOLDER, f"{len(os.listdir(FOLDER))}.ply")
    mesh.write_ply(name)
    wall = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": rgb(reflectance)}}
    shape = {"type": "ply", "filename": name, "face_normals": True, "bsdf": wall}
    if radiance:
        shape["emitter"] = {"type": "area", "radiance": rgb(radiance)}
    return shape


def scene():
    grey, fog = [0.73] * 3, {"type": "ref", "id": "fog"}
    look = Transform().look_at(origin=[278, 273, -800], target=[278, 273, 0], up=[0, 1, 0])
    film = {"type": "hdrfilm", "width": SIZE, "height": SIZE, "pixel_format": "rgb",
            "component_format": "float32", "rfilter": {"type": "box"}}
    return mi.load_dict({
        "type": "scene",
        "integrator": {"type": "volpath", "max_depth": 16},
        "fog": medium([0.0002, 0.0004, 0.0001], [0.0006, 0.0010, 0.0015], 0.4),
        "sensor": {"type": "perspective", "fov": 37.5, "to_world": look, "medium": fog, "film": film,
                   "sampler": {"type": "independent"}},
        "lamp": quad([[343, 548.7, 227], [343, 548.7, 332], [213, 548.7, 332], [213, 548.7, 227]], grey,
                     [60, 50, 40]),
        "red": quad([[552.8, 0, 0], [549.6, 0, 559.2], [556, 548.8, 559.2], [556, 548.8, 0]],
                    [0.65, 0.05, 0.05]),
        "green": quad([[0, 0, 559.2], [0, 0, 0], [0, 548.8, 0], [0, 548.8, 559.2]], [0.12, 0.45, 0.15]),
        "floor": quad([[552.8, 0, 0], [0, 0, 0], [0, 0, 559.2], [549.6, 0, 559.2]], grey),
        "ceiling": quad([[556, 548.8, 0], [556, 548.8, 559.2], [0, 548.8, 559.2], [0, 548.8, 0]], grey),
        "back": quad([[549.6, 0, 559.2], [0, 0, 559.2], [0, 548.8, 559.2], [556, 548.8, 559.2]], grey),
        "glass": {"type": "sphere", "center": [186, 90, 168], "radius": 90,
                  "bsdf": {"type": "dielectric", "int_ior": 1.5, "ext_ior": 1.0}, "exterior": fog,
                  "interior": medium([0.001, 0.006, 0.012], [0, 0, 0], 0.0)},
        "ball": {"type": "sphere", "center": [390, 250, 300], "radius": 100, "bsdf": {"type": "null"},
                 "exterior": fog, "interior": medium([0.002, 0.001, 0.0005], [0.02, 0.01, 0.03], -0.3)},
    })


if __name__ == "__main__":
    drawn = scene()
    batches = np.array([np.array(mi.render(drawn, spp=SPP, seed=1000 + i)) for i in range(BATCHES)])
    # With pbrt's cameras +x is on the other side of the picture.
    batches = batches[:, :, ::-1]
    half = SIZE // 2
    for top in (0, half):
        for left in (0, half):
            quarter = batches[:, top:top + half, left:left + half].mean((1, 2))
            error = quarter.std(0, ddof=1) / np.sqrt(BATCHES)
            print(f"({quarter.mean(0).round(6).tolist()}, {error.round(6).tolist()}),")
