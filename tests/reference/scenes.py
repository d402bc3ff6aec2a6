"""The reference scenes. A scene is a dictionary: meshes, camera (matrix, vertical field of view), lights, environment,
samples a pixel, max_depth (8 without; 1 = emitters seen directly, 2 = direct light); a material is a dictionary with the key `kind`:

    diffuse   color or texture, optionally alpha (mask: texture with binary alpha), emission
    metal     roughness; white, no Fresnel loss
    glass     roughness, ior 1.5, solid
    pane      thin smooth dielectric, ior 1.5
"""
import numpy as np
from geometry import block, look_at, quad, sphere

# Where surfaces can be passed, renderers count depth differently: deep enough that nothing is cut off.
DEEP = 64
SIZE = 64


def diffuse(*color):
    return {"kind": "diffuse", "color": list(color)}


GREY, RED, GREEN = diffuse(0.7, 0.7, 0.7), diffuse(0.6, 0.1, 0.08), diffuse(0.12, 0.45, 0.1)
LAMP = {"kind": "diffuse", "color": [0.5, 0.5, 0.5], "emission": [6.0, 5.5, 5.0]}


def room(light=True):
    """A box of two metres without a front, and a lamp under its ceiling."""
    walls = [
        quad((-1, 0, 1), (2, 0, 0), (0, 0, -2), GREY),
        quad((-1, 2, -1), (2, 0, 0), (0, 0, 2), GREY),
        quad((-1, 0, -1), (2, 0, 0), (0, 2, 0), GREY),
        quad((-1, 0, 1), (0, 0, -2), (0, 2, 0), RED),
        quad((1, 0, -1), (0, 0, 2), (0, 2, 0), GREEN),
    ]
    return walls + ([quad((-0.5, 1.98, -0.5), (1, 0, 0), (0, 0, 1), LAMP)] if light else [])


ROOM_CAMERA = {"matrix": look_at((0, 1, 3.6), (0, 1, 0)), "yfov": 0.66}
SHORT = ((0.36, 0.3, 0.36), (0.28, 0.299, 0.28), 17.0)
TALL = ((-0.36, 0.6, -0.3), (0.28, 0.599, 0.28), -18.0)


def cornell():
    return {"meshes": room() + [block(*SHORT, GREY), block(*TALL, GREY)], "camera": ROOM_CAMERA, "spp": 16384}


def metal():
    rough, mirror = {"kind": "metal", "roughness": 0.4}, {"kind": "metal", "roughness": 0.0}
    return {"meshes": room() + [block(*SHORT, rough), block(*TALL, mirror)], "camera": ROOM_CAMERA, "spp": 32768}


def glass():
    smooth, rough = ({"kind": "glass", "roughness": r} for r in (0.0, 0.4))
    spheres = [
        sphere((-0.45, 0.45, -0.3), 0.44, 24, 12, smooth, smooth=False),
        sphere((0.45, 0.45, 0.25), 0.44, 24, 12, rough, smooth=False),
    ]
    return {"meshes": room() + spheres, "camera": ROOM_CAMERA, "spp": 65536}


def twosided():
    """Every wall and block with its back to the light, and a smooth-shaded ball."""
    meshes = [m.flipped() for m in room(light=False)] + [room()[-1], block(*SHORT, GREY).flipped()]
    meshes.append(sphere((-0.4, 0.5, -0.3), 0.4, 48, 24, GREY, smooth=True))
    return {"meshes": meshes, "camera": ROOM_CAMERA, "spp": 16384}


def sky(direction):
    """Radiance of the sky in unit directions (…, 3): a gradient and a warm sun of 9 degrees."""
    up = direction[..., 1:2]
    blue = np.array([0.25, 0.4, 0.7]) * (0.6 + 0.4 * up) + np.array([0.1, 0.05, 0.0]) * (1 - up)
    sun = np.array([0.55, 0.7, 0.45])
    angle = np.arccos(np.clip(direction @ (sun / np.linalg.norm(sun)), -1, 1))[..., None]
    return blue + np.array([30.0, 26.0, 20.0]) * np.exp(-0.5 * (angle / np.radians(9.0)) ** 2)


def pattern():
    """An RGBA image, not square, with no symmetry."""
    y, x = np.mgrid[0:10, 0:16]
    colors = np.stack([40 + 13 * x, 30 + 20 * y, 220 - 9 * x - 7 * y], -1)
    colors[(x // 4 + y // 5) % 2 == 0] //= 2
    colors[0:2, 0:5] = (250, 240, 60)
    return np.dstack([colors, np.full((10, 16), 255)]).astype(np.uint8)


def textured():
    tiles = {"kind": "diffuse", "texture": pattern()}
    meshes = [
        quad((-20, 0, 20), (40, 0, 0), (0, 0, -40), tiles, uv_range=((-7.3, -5.2), (9.1, 11.4))),
        sphere((-0.9, 1.0, 0.2), 1.0, 64, 32, tiles, smooth=True),
        block((1.3, 0.5, -0.2), (0.5, 0.499, 0.5), 30.0, GREY),
    ]
    return {
        "meshes": meshes,
        "camera": {"matrix": look_at((0, 4.0, 4.5), (0, 0.4, 0)), "yfov": 0.7},
        "environment": sky,
        "spp": 32768,
    }


def lights():
    """Point, spot and directional light. The rim of the spot is 0.033 degrees wide: the falloffs of glTF
    (quadratic in the cosine) and Mitsuba (linear in the angle) differ, a hard rim does not."""
    punctual = [
        {"kind": "point", "position": [-0.5, 1.5, 0.4], "intensity": [0.9, 0.8, 0.6]},
        {"kind": "spot", "position": [0.6, 1.8, 0.8], "target": [-0.3, 0.0, -0.4], "intensity": [3.0, 3.0, 4.0],
         "inner": np.radians(21.967), "outer": np.radians(22.0)},
        {"kind": "directional", "direction": [-0.35, -0.75, -1.0], "irradiance": [0.5, 0.6, 0.4]},
    ]
    meshes = room(light=False) + [block(*SHORT, GREY), block(*TALL, GREY)]
    return {"meshes": meshes, "camera": ROOM_CAMERA, "lights": punctual, "spp": 32768}


def pane():
    """A thin pane across the room, and a picture behind it."""
    picture = quad((-0.7, 0.5, -0.98), (1.4, 0, 0), (0, 1.0, 0), {"kind": "diffuse", "texture": pattern()},
                   uv_range=((0, 0), (1, 1)))
    front = quad((-0.8, 0.05, -0.2), (1.5, 0, 0.3), (0, 1.6, 0), {"kind": "pane"})
    return {"meshes": room() + [picture, front], "camera": ROOM_CAMERA, "spp": 49152, "max_depth": DEEP}


def leaf():
    """An RGBA image with binary alpha: a lopsided blob with holes."""
    y, x = np.mgrid[0:24, 0:18]
    inside = ((x - 8) / 8.0) ** 2 + ((y - 13) / 10.5) ** 2 < 1
    holes = ((x % 7 == 3) & (y % 5 > 2)) | ((x > 11) & (y > 15) & (y < 19))
    alpha = np.where(inside & ~holes, 255, 0)
    return np.dstack([np.full((24, 18), v) for v in (90, 160, 60)] + [alpha]).astype(np.uint8)


def leaves():
    material = {"kind": "diffuse", "texture": leaf(), "alpha": True}
    uv = ((0, 0), (1, 1))
    cards = [
        quad((-0.75, 0.1, -0.4), (0.8, 0, 0.2), (0.0, 1.1, 0.1), material, uv_range=uv),
        quad((0.05, 0.3, 0.1), (0.7, 0.1, -0.4), (-0.1, 0.9, 0.1), material, uv_range=uv),
        quad((-0.4, 1.3, -0.3), (0.8, 0, 0.0), (0, 0.1, -0.7), material, uv_range=((-0.2, 0.1), (1.9, 1.4))),
    ]
    return {"meshes": room() + cards, "camera": ROOM_CAMERA, "spp": 24576, "max_depth": DEEP}


SCENES = {f.__name__: f for f in (cornell, metal, glass, textured, lights, pane, leaves, twosided)}
