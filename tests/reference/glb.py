"""Writes a scene of scenes.py as glTF 2.0, binary."""
import io
import json
import struct

import numpy as np
from PIL import Image

FLOAT, USHORT, ARRAY_BUFFER, ELEMENT_BUFFER = 5126, 5123, 34962, 34963
NEAREST, LINEAR, REPEAT = 9728, 9729, 10497


class Writer:
    """The JSON part and the binary part of a file, growing together."""

    def __init__(self):
        self.blob = b""
        self.json = {"asset": {"version": "2.0", "generator": "tests/reference/render.py"}, "scene": 0}
        self.extensions = set()

    def add(self, key, value):
        self.json.setdefault(key, []).append(value)
        return len(self.json[key]) - 1

    def view(self, data, target=None):
        self.blob += b"\0" * (-len(self.blob) % 4)
        view = {"buffer": 0, "byteOffset": len(self.blob), "byteLength": len(data)}
        if target:
            view["target"] = target
        self.blob += data
        return self.add("bufferViews", view)

    def accessor(self, array, component, kind, target, bounds=False):
        a = {"bufferView": self.view(array.tobytes(), target), "componentType": component, "type": kind,
             "count": array.size if kind == "SCALAR" else len(array)}
        if bounds:
            a["min"], a["max"] = array.min(0).tolist(), array.max(0).tolist()
        return self.add("accessors", a)

    def texture(self, pixels, nearest):
        png = io.BytesIO()
        Image.fromarray(pixels).save(png, "PNG")
        source = self.add("images", {"bufferView": self.view(png.getvalue()), "mimeType": "image/png"})
        mode = NEAREST if nearest else LINEAR
        sampler = self.add("samplers", {"magFilter": mode, "minFilter": mode, "wrapS": REPEAT, "wrapT": REPEAT})
        return self.add("textures", {"source": source, "sampler": sampler})

    def extension(self, owner, name, value):
        owner.setdefault("extensions", {})[name] = value
        self.extensions.add(name)

    def material(self, m):
        pbr = {"metallicFactor": 0.0, "roughnessFactor": m.get("roughness", 1.0)}
        out = {"pbrMetallicRoughness": pbr}
        if m["kind"] == "diffuse":
            self.extension(out, "KHR_materials_specular", {"specularFactor": 0.0})
            if "texture" in m:
                pbr["baseColorTexture"] = {"index": self.texture(m["texture"], "alpha" in m)}
            else:
                pbr["baseColorFactor"] = m["color"] + [1.0]
            if "alpha" in m:
                out.update(alphaMode="MASK", alphaCutoff=0.5, doubleSided=True)
            if "emission" in m:
                strength = max(m["emission"])
                out["emissiveFactor"] = [x / strength for x in m["emission"]]
                self.extension(out, "KHR_materials_emissive_strength", {"emissiveStrength": strength})
        elif m["kind"] == "metal":
            pbr["metallicFactor"] = 1.0
        else:
            pbr["roughnessFactor"] = m.get("roughness", 0.0)
            self.extension(out, "KHR_materials_transmission", {"transmissionFactor": 1.0})
            self.extension(out, "KHR_materials_ior", {"ior": 1.5})
            if m["kind"] == "glass":
                self.extension(out, "KHR_materials_volume", {"thicknessFactor": 1.0})
        return self.add("materials", out)

    def mesh(self, mesh):
        attributes = {"POSITION": self.accessor(mesh.positions, FLOAT, "VEC3", ARRAY_BUFFER, bounds=True)}
        if mesh.normals is not None:
            attributes["NORMAL"] = self.accessor(mesh.normals, FLOAT, "VEC3", ARRAY_BUFFER)
        if mesh.uvs is not None:
            attributes["TEXCOORD_0"] = self.accessor(mesh.uvs, FLOAT, "VEC2", ARRAY_BUFFER)
        indices = self.accessor(mesh.triangles.astype(np.uint16), USHORT, "SCALAR", ELEMENT_BUFFER)
        primitive = {"attributes": attributes, "indices": indices, "material": self.material(mesh.material)}
        return self.add("nodes", {"mesh": self.add("meshes", {"primitives": [primitive]})})

    def light(self, light, all_lights):
        out = {"type": light["kind"]}
        strength = np.array(light.get("intensity", light.get("irradiance")))
        out["color"], out["intensity"] = (strength / strength.max()).tolist(), float(strength.max())
        node = {}
        if light["kind"] != "point":
            along = np.array(light["direction"]) if "direction" in light else None
            along = np.subtract(light["target"], light["position"]) if along is None else along
            node["rotation"] = turn_from_minus_z(along / np.linalg.norm(along))
        if light["kind"] != "directional":
            node["translation"] = list(light["position"])
        if light["kind"] == "spot":
            out["spot"] = {"innerConeAngle": float(light["inner"]), "outerConeAngle": float(light["outer"])}
        all_lights.append(out)
        self.extension(node, "KHR_lights_punctual", {"light": len(all_lights) - 1})
        return self.add("nodes", node)

    def write(self, path):
        if self.extensions:
            self.json["extensionsUsed"] = sorted(self.extensions)
        self.blob += b"\0" * (-len(self.blob) % 4)
        self.json["buffers"] = [{"byteLength": len(self.blob)}]
        text = json.dumps(self.json, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        with open(path, "wb") as file:
            file.write(struct.pack("<III", 0x46546C67, 2, 28 + len(text) + len(self.blob)))
            file.write(struct.pack("<II", len(text), 0x4E4F534A) + text)
            file.write(struct.pack("<II", len(self.blob), 0x004E4942) + self.blob)


def turn_from_minus_z(d):
    """Quaternion x, y, z, w of the shortest turn from -z to the unit vector d."""
    axis = np.cross((0, 0, -1), d)
    q = np.append(axis, 1.0 - d[2])
    return (q / np.linalg.norm(q)).tolist()


def write_glb(scene, path):
    writer = Writer()
    nodes = [writer.mesh(mesh) for mesh in scene["meshes"]]
    punctual = []
    nodes += [writer.light(light, punctual) for light in scene.get("lights", [])]
    if punctual:
        writer.extension(writer.json, "KHR_lights_punctual", {"lights": punctual})
    camera = {"type": "perspective", "perspective": {"yfov": scene["camera"]["yfov"], "znear": 0.01}}
    matrix = scene["camera"]["matrix"].T.ravel().tolist()
    nodes.append(writer.add("nodes", {"camera": writer.add("cameras", camera), "matrix": matrix}))
    writer.add("scenes", {"nodes": nodes})
    writer.write(path)
