"""Writes assets as binary glTF 2.0 files (.glb).

In the file z is up; one root node turns it to glTF's y. A node has its "full" surfaces; "reduced" and "shadow" are
children of it, named with `SUFFIX`, so that a page can use or ignore them. `extras` holds what glTF does not define:
the joint and lamp of a node, the label of a primitive, the strips on the ground (in the root node). Textures of another
asset have only a name.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterable
from dataclasses import asdict
from math import ceil, log2, sqrt
from typing import Any

import numpy as np

from autodrive.graphics.assets.asset import Asset, AssetNode, Detail, Material, MeshSurface
from autodrive.graphics.assets.packed import jpeg

SUFFIX: dict[Detail, str] = {"full": "", "reduced": "_lod1", "shadow": "_shadow"}
"""Added to the name of a node for each level of detail."""

Y_UP_FROM_Z_UP = (-sqrt(0.5), 0.0, 0.0, sqrt(0.5))
"""Quaternion xyzw of the root node: x stays, z becomes y."""

_MAGIC, _VERSION, _JSON, _BIN = 0x46546C67, 2, 0x4E4F534A, 0x004E4942
_VERTICES, _INDICES = 34962, 34963
_COMPONENTS = {"<f4": 5126, "<u2": 5123, "<u4": 5125}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}
_REPEAT, _LINEAR, _LINEAR_MIPMAP_LINEAR = 10497, 9729, 9987
_SAMPLER = {"magFilter": _LINEAR, "minFilter": _LINEAR_MIPMAP_LINEAR, "wrapS": _REPEAT, "wrapT": _REPEAT}


def write_glb(asset: Asset, details: Iterable[Detail] = ("full", "reduced", "shadow")) -> bytes:
    """Content of the file. For viewers that do not know our levels of detail, write "full" only. Floats stay exact."""
    return _GlbWriter(asset, tuple(details)).file()


class _GlbWriter:
    """Collects the JSON tree and the binary chunk; arrays shared in the Asset are shared in the file."""

    def __init__(self, asset: Asset, details: tuple[Detail, ...]) -> None:
        self._asset = asset
        self._details = details
        self._binary = bytearray()
        self._views: list[dict[str, Any]] = []
        self._accessors: list[dict[str, Any]] = []
        self._meshes: list[dict[str, Any]] = []
        self._nodes: list[dict[str, Any]] = []
        self._materials: dict[Material, int] = {}
        self._textures = {name: i for i, name in enumerate((*asset.textures, *asset.foreign_textures))}
        self._known: dict[tuple[object, ...], int] = {}
        self._kept: list[np.ndarray] = []

    def file(self) -> bytes:
        """Header, tree and binary chunk."""
        images = [
            {"name": name, "mimeType": "image/jpeg", "bufferView": self._view(jpeg(image))}
            for name, image in self._asset.textures.items()
        ]
        images += [{"name": name} for name in self._asset.foreign_textures]
        self._add_nodes()
        materials = [self._material(material) for material in self._materials]
        tree = {
            "asset": {"version": "2.0", "generator": "AutoDRIVE Simulator"},
            "extensionsUsed": ["KHR_materials_emissive_strength"] if any("extensions" in m for m in materials) else [],
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": self._nodes,
            "meshes": self._meshes,
            "materials": materials,
            "textures": [{"source": i, "sampler": 0} for i in range(len(images))],
            "images": images,
            "samplers": [_SAMPLER] if images else [],
            "accessors": self._accessors,
            "bufferViews": self._views,
            "buffers": [{"byteLength": len(self._binary)}] if self._binary else [],
        }
        # glTF does not allow empty lists
        used = {key: value for key, value in tree.items() if value != []}
        body = _chunk(_JSON, json.dumps(used, separators=(",", ":"), default=float).encode(), b" ")
        body += _chunk(_BIN, bytes(self._binary), b"\0") if self._binary else b""
        return struct.pack("<III", _MAGIC, _VERSION, 12 + len(body)) + body

    def _add_nodes(self) -> None:
        """The root, then the nodes of the Asset in their order, then the children with other levels of detail."""
        root: dict[str, Any] = {"name": self._asset.name, "rotation": list(Y_UP_FROM_Z_UP)}
        strips = self._asset.strips
        if strips is not None and "reduced" in self._details:  # only our renderers draw them
            vertices = self._accessor(strips.vertices.view(np.float32), "<f4", "SCALAR")
            root["extras"] = {
                "strips": {"vertices": vertices, "triangles": self._accessor(strips.triangles, "<u4", "SCALAR")}
            }
        if self._asset.extent is not None:
            root.setdefault("extras", {})["extent"] = [*self._asset.extent]
        own = {node.name: self._node(node) for node in self._asset.nodes}
        if len(own) < len(self._asset.nodes):
            raise ValueError(f"asset '{self._asset.name}': two nodes have the same name")
        self._nodes = [root, *own.values()]
        for number, node in enumerate(self._asset.nodes, 1):
            (own[node.parent] if node.parent else root).setdefault("children", []).append(number)
        for node in self._asset.nodes:
            for detail in self._details:
                surfaces, name = node.surfaces.get(detail), node.name + SUFFIX[detail]
                if surfaces and detail != "full":
                    own[node.name].setdefault("children", []).append(len(self._nodes))
                    self._nodes.append({"name": name, "mesh": self._mesh(name, surfaces), "extras": {"detail": detail}})

    def _node(self, node: AssetNode) -> dict[str, Any]:
        w, x, y, z = node.orientation
        written: dict[str, Any] = {"name": node.name}
        if any(node.position):
            written["translation"] = [float(value) for value in node.position]
        if (w, x, y, z) != (1.0, 0.0, 0.0, 0.0):
            written["rotation"] = [float(value) for value in (x, y, z, w)]
        extras: dict[str, Any] = {"joint": asdict(node.joint)} if node.joint else {}
        if node.lamp:
            extras["lamp"] = node.lamp
        if extras:
            written["extras"] = extras
        surfaces = node.surfaces.get("full")
        if surfaces and "full" in self._details:
            written["mesh"] = self._mesh(node.name, surfaces)
        return written

    def _mesh(self, name: str, surfaces: tuple[MeshSurface, ...]) -> int:
        key = ("mesh", id(surfaces))
        if key not in self._known:
            self._known[key] = len(self._meshes)
            self._meshes.append({"name": name, "primitives": [self._primitive(surface) for surface in surfaces]})
        return self._known[key]

    def _primitive(self, surface: MeshSurface) -> dict[str, Any]:
        if len(surface.triangles) == 0:
            raise ValueError(f"asset '{self._asset.name}': a surface has no triangles; omit it")
        attributes = {
            "POSITION": self._accessor(surface.positions, "<f4", "VEC3"),
            "NORMAL": self._accessor(surface.normals, "<f4", "VEC3"),
        }
        if surface.uvs is not None:
            attributes["TEXCOORD_0"] = self._accessor(surface.uvs, "<f4", "VEC2")
        if surface.open is not None:
            attributes["COLOR_0"] = self._accessor(np.repeat(surface.open[:, None], 3, axis=1), "<f4", "VEC3")
        index = "<u2" if len(surface.positions) < 65536 else "<u4"  # index 65535 of 16 bits means "restart"
        return {
            "attributes": attributes,
            "indices": self._accessor(surface.triangles, index, "SCALAR"),
            "material": self._number(surface.material),
            "extras": {"label": surface.label.name},
        }

    def _number(self, material: Material) -> int:
        if material.beneath is not None:
            self._number(material.beneath)
        return self._materials.setdefault(material, len(self._materials))

    def _accessor(self, values: np.ndarray, dtype: str, kind: str) -> int:
        key = (id(values), dtype, kind)
        if key not in self._known:
            content = values.reshape(-1, _WIDTHS[kind]).astype(dtype)
            self._kept.append(values)  # as long as its id counts
            self._known[key] = len(self._accessors)
            self._accessors.append(
                {
                    "bufferView": self._view(content.tobytes(), _VERTICES if dtype == "<f4" else _INDICES),
                    "componentType": _COMPONENTS[dtype],
                    "count": len(content),
                    "type": kind,
                    "min": content.min(axis=0).tolist(),
                    "max": content.max(axis=0).tolist(),
                }
            )
        return self._known[key]

    def _view(self, content: bytes, target: int | None = None) -> int:
        """A part of the binary chunk that starts at a multiple of 4 bytes."""
        view = {"buffer": 0, "byteOffset": len(self._binary), "byteLength": len(content)}
        self._views.append(view if target is None else {**view, "target": target})
        self._binary += content + bytes(-len(content) % 4)
        return len(self._views) - 1

    def _material(self, material: Material) -> dict[str, Any]:
        surface: dict[str, Any] = {
            "baseColorFactor": [*map(float, material.color), 1.0],
            "metallicFactor": float(material.metallic),
            "roughnessFactor": float(material.roughness),
        }
        if material.texture:
            surface["baseColorTexture"] = {"index": self._textures[material.texture]}
        written: dict[str, Any] = {"name": material.name, "pbrMetallicRoughness": surface}
        if material.is_paint:
            written["extras"] = {"paint": True}
        if any(material.window_light):
            written["extras"] = {"windows": [*map(float, material.window_light)]}
        if material.beneath is not None:
            written["extras"] = {"beneath": self._materials[material.beneath]}
        brightest = max(material.emission)
        if brightest > 0.0:
            # a factor is at most 1; dividing by a power of 2 is exact
            strength = 2.0 ** max(0, ceil(log2(brightest)))
            written["emissiveFactor"] = [float(value) / strength for value in material.emission]
            if strength > 1.0:
                written["extensions"] = {"KHR_materials_emissive_strength": {"emissiveStrength": strength}}
        return written


def _chunk(kind: int, content: bytes, filler: bytes) -> bytes:
    content += filler * (-len(content) % 4)
    return struct.pack("<II", len(content), kind) + content
