#!/usr/bin/env python3
"""Reference images by Mitsuba 3, and the same scenes as GLB files. How to run it: see README.md beside this file.

For each scene: NAME.glb, NAME.exr (mean.R/G/B, sem.R/G/B: the standard error of the mean, attributes maxDepth and
samplesPerPixel) and, where light comes from infinity, NAME-sky.exr.
"""
import argparse
import os
import time

import mitsuba as mi
import numpy as np
import OpenEXR
from glb import write_glb
from scenes import SCENES, SIZE

HERE = os.path.dirname(os.path.abspath(__file__))
# Samples a pixel of one run; the runs are independent and their spread gives the standard error.
RUN = 512


def bitmap(pixels, raw, nearest):
    return {"type": "bitmap", "bitmap": mi.Bitmap(np.ascontiguousarray(pixels)), "raw": raw,
            "filter_type": "nearest" if nearest else "bilinear", "wrap_mode": "repeat"}


def bsdf(m):
    if m["kind"] == "glass":
        if m["roughness"] == 0:
            return {"type": "dielectric", "int_ior": 1.5, "ext_ior": 1.0}
        return {"type": "roughdielectric", "distribution": "ggx", "alpha": m["roughness"] ** 2,
                "int_ior": 1.5, "ext_ior": 1.0}
    if m["kind"] == "pane":
        return {"type": "thindielectric", "int_ior": 1.5, "ext_ior": 1.0}
    if m["kind"] == "metal":
        inner = {"type": "conductor", "material": "none"}
        if m["roughness"] > 0:
            inner = {"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": m["roughness"] ** 2}
        return {"type": "twosided", "inner": inner}
    if "texture" in m:
        color = bitmap(m["texture"][..., :3], raw=False, nearest="alpha" in m)
    else:
        color = {"type": "rgb", "value": m["color"]}
    out = {"type": "twosided", "inner": {"type": "diffuse", "reflectance": color}}
    if "alpha" in m:
        covered = (m["texture"][..., 3:] >= 128).astype(np.float32)
        out = {"type": "mask", "opacity": bitmap(covered, raw=True, nearest=True), "inner": out}
    return out


def shape(name, mesh):
    props = mi.Properties()
    props["bsdf"] = mi.load_dict(bsdf(mesh.material))
    if "emission" in mesh.material:
        radiance = {"type": "rgb", "value": mesh.material["emission"]}
        props["emitter"] = mi.load_dict({"type": "area", "radiance": radiance})
    out = mi.Mesh(name, len(mesh.positions), len(mesh.triangles), props=props,
                  has_vertex_normals=mesh.normals is not None, has_vertex_texcoords=mesh.uvs is not None)
    p = mi.traverse(out)
    p["vertex_positions"], p["faces"] = mesh.positions.ravel(), mesh.triangles.ravel()
    if mesh.normals is not None:
        p["vertex_normals"] = mesh.normals.ravel()
    if mesh.uvs is not None:
        p["vertex_texcoords"] = mesh.uvs.ravel()
    p.update()
    return out


def light(spec):
    if spec["kind"] == "point":
        return {"type": "point", "position": spec["position"], "intensity": {"type": "rgb", "value": spec["intensity"]}}
    if spec["kind"] == "directional":
        return {"type": "directional", "direction": spec["direction"],
                "irradiance": {"type": "rgb", "value": spec["irradiance"]}}
    return {"type": "spot", "to_world": mi.ScalarTransform4f().look_at(spec["position"], spec["target"], [0, 1, 0]),
            "intensity": {"type": "rgb", "value": spec["intensity"]},
            "beam_width": float(np.degrees(spec["inner"])), "cutoff_angle": float(np.degrees(spec["outer"]))}


def directions(u, v):
    """Unit directions of a lat-long image: u = atan2(x, -z) / 2 pi, v = acos(y) / pi."""
    v, u = np.meshgrid(v, u, indexing="ij")
    theta, phi = np.pi * v, 2 * np.pi * u
    return np.stack([np.sin(theta) * np.sin(phi), np.cos(theta), -np.sin(theta) * np.cos(phi)], -1)


def mitsuba_scene(scene):
    out = {"type": "scene", "integrator": {"type": "path", "max_depth": scene["max_depth"]}}
    for i, mesh in enumerate(scene["meshes"]):
        out[f"mesh{i}"] = shape(f"mesh{i}", mesh)
    for i, spec in enumerate(scene.get("lights", [])):
        out[f"light{i}"] = light(spec)
    if "environment" in scene:
        # Mitsuba's columns lie at (i + 1/2) / w, its rows at j / (h - 1).
        w, h = 1024, 512
        pixels = scene["environment"](directions((np.arange(w) + 0.5) / w, np.arange(h) / (h - 1)))
        out["sky"] = {"type": "envmap", "bitmap": mi.Bitmap(pixels.astype(np.float32))}
    # Mitsuba's cameras look along +z with x to the left.
    to_world = scene["camera"]["matrix"] @ np.diag([-1, 1, -1, 1])
    out["sensor"] = {
        "type": "perspective", "fov": float(np.degrees(scene["camera"]["yfov"])), "fov_axis": "y",
        "near_clip": 1e-3, "far_clip": 1e4, "to_world": mi.ScalarTransform4f(to_world.tolist()),
        "sampler": {"type": "independent"},
        "film": {"type": "hdrfilm", "width": SIZE, "height": SIZE, "rfilter": {"type": "box"},
                 "pixel_format": "rgb", "component_format": "float32"}}
    return mi.load_dict(out)


def write_exr(path, channels, **attributes):
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **attributes}
    with OpenEXR.File(header, channels) as file:
        file.write(path)


def write_sky(path, environment):
    """The environment in our convention, texels at their centres."""
    w, h = 256, 128
    pixels = environment(directions((np.arange(w) + 0.5) / w, (np.arange(h) + 0.5) / h)).astype(np.float16)
    write_exr(path, {c: np.ascontiguousarray(pixels[..., i]) for i, c in enumerate("RGB")})


def render(name, scene, spp):
    loaded = mitsuba_scene(scene)
    runs = max(spp // RUN, 2)
    total, squares = 0.0, 0.0
    started = time.time()
    for i in range(runs):
        image = np.array(mi.render(loaded, spp=RUN, seed=1000 + i), dtype=np.float64)
        total, squares = total + image, squares + image * image
    mean = total / runs
    sem = np.sqrt(np.maximum(squares / runs - mean * mean, 0) / (runs - 1))
    channels = {}
    for i, c in enumerate("RGB"):
        channels[f"mean.{c}"] = np.ascontiguousarray(mean[..., i].astype(np.float32))
        channels[f"sem.{c}"] = np.ascontiguousarray(sem[..., i].astype(np.float32))
    write_exr(os.path.join(HERE, f"{name}.exr"), channels, software=f"Mitsuba {mi.__version__}",
              samplesPerPixel=runs * RUN, maxDepth=scene["max_depth"])
    pixels = np.sqrt((sem**2).sum()) / mean.sum()
    print(f"{name}: {runs * RUN} spp, mean {mean.mean():.5f}, relative standard error of the mean {100 * pixels:.4f} %, "
          f"of a pixel (median) {100 * np.median(sem[mean > 0] / mean[mean > 0]):.3f} %, {time.time() - started:.0f} s",
          flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", nargs="*", default=list(SCENES), help="names; all without")
    parser.add_argument("--spp", type=int, help="samples a pixel instead of the scene's own")
    parser.add_argument("--glb-only", action="store_true", help="write the scene files, render nothing")
    args = parser.parse_args()
    mi.set_variant("llvm_ad_rgb")
    for name in args.scene:
        scene = {"max_depth": 8, **SCENES[name]()}
        write_glb(scene, os.path.join(HERE, f"{name}.glb"))
        if "environment" in scene:
            write_sky(os.path.join(HERE, f"{name}-sky.exr"), scene["environment"])
        if not args.glb_only:
            render(name, scene, args.spp or scene["spp"])


if __name__ == "__main__":
    main()
