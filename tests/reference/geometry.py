"""Meshes of the reference scenes: arrays of positions, indices, and, where wanted, normals and texture coordinates.

World space is right-handed, y up, metres; triangles are counter-clockwise seen from the front.
"""
import numpy as np


class Mesh:
    """Triangles with one material (a dictionary, see materials.py)."""

    def __init__(self, positions, triangles, material, normals=None, uvs=None):
        self.positions = np.asarray(positions, np.float32)
        self.triangles = np.asarray(triangles, np.uint32)
        self.material = material
        self.normals = None if normals is None else np.asarray(normals, np.float32)
        self.uvs = None if uvs is None else np.asarray(uvs, np.float32)

    def flipped(self):
        """The same triangles seen from the other side."""
        return Mesh(self.positions, self.triangles[:, ::-1], self.material, self.normals, self.uvs)


def quad(corner, edge_u, edge_v, material, uv_range=None):
    """A parallelogram; its front is the side from which `edge_u` to `edge_v` turns counter-clockwise."""
    corner, edge_u, edge_v = (np.asarray(x, float) for x in (corner, edge_u, edge_v))
    positions = [corner, corner + edge_u, corner + edge_u + edge_v, corner + edge_v]
    uvs = None
    if uv_range is not None:
        (u0, v0), (u1, v1) = uv_range
        # glTF's v runs down the image, so that the texture stands upright where edge_v points up.
        uvs = [(u0, v1), (u1, v1), (u1, v0), (u0, v0)]
    return Mesh(positions, [(0, 1, 2), (0, 2, 3)], material, uvs=uvs)


def block(centre, half, degrees, material):
    """A box turned about y."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [t for a, b, c_, d in faces for t in ((a, b, c_), (a, c_, d))]
    return Mesh(corners @ turn.T + centre, triangles, material)


def sphere(centre, radius, columns, rows, material, smooth):
    """A sphere of latitude and longitude, with vertex normals or flat; u runs once around, v from pole to pole."""
    v, u = np.meshgrid(np.linspace(0, 1, rows + 1), np.linspace(0, 1, columns + 1), indexing="ij")
    theta, phi = np.pi * v, 2 * np.pi * u
    n = np.stack([np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)], -1)
    n[:, -1] = n[:, 0]
    n[0], n[-1] = (0, 1, 0), (0, -1, 0)
    at = lambda row, column: row * (columns + 1) + column
    triangles = []
    for row in range(rows):
        for column in range(columns):
            a, b = at(row, column), at(row + 1, column)
            if row > 0:
                triangles.append((a, b, a + 1))
            if row < rows - 1:
                triangles.append((a + 1, b, b + 1))
    normals = n.reshape(-1, 3)
    positions = normals * radius + centre
    uvs = np.stack([u, v], -1).reshape(-1, 2)
    return Mesh(positions, triangles, material, normals if smooth else None, uvs if smooth else None)


def look_at(origin, target):
    """Camera-to-world matrix of a camera that looks along its -z, y up."""
    origin, target = np.asarray(origin, float), np.asarray(target, float)
    z = (origin - target) / np.linalg.norm(origin - target)
    x = np.cross((0, 1, 0), z)
    x /= np.linalg.norm(x)
    m = np.eye(4)
    m[:3, 0], m[:3, 1], m[:3, 2], m[:3, 3] = x, np.cross(z, x), z, origin
    return m
