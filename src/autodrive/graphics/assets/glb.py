"""Writes and reads assets as binary glTF 2.0 files (.glb).

In the file z is up; one root node turns it to glTF's y. A node has its "full" surfaces; "reduced" and "shadow" are
children of it, named with `SUFFIX`, so that a page can use or ignore them. `extras` holds what glTF does not define:
the joint and lamp of a node, the label of a primitive.
"""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Iterable
from dataclasses import asdict
from math import ceil, log2, sqrt
from typing import Any, NamedTuple

import numpy as np
import simplejpeg

from autodrive.graphics.assets.asset import Asset, AssetNode, Detail, Material, MeshSurface, NodeJoint, Points
from autodrive.protocol.labels import Label

SUFFIX: dict[Detail, str] = {"full": "", "reduced": "_lod1", "shadow": "_shadow"}
"""Added to the name of a node for each level of detail."""

JPEG_QUALITY = 92
"""Of textures, without colour subsampling; the loss is invisible."""

Y_UP_FROM_Z_UP = (-sqrt(0.5), 0.0, 0.0, sqrt(0.5))
"""Quaternion xyzw of the root node: x stays, z becomes y."""

_MAGIC, _VERSION, _JSON, _BIN = 0x46546C67, 2, 0x4E4F534A, 0x004E4942
_FLOAT, _UINT16, _UINT32 = 5126, 5123, 5125
_VERTICES, _INDICES = 34962, 34963
_REPEAT, _LINEAR, _LINEAR_MIPMAP_LINEAR = 10497, 9729, 9987
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}
_TYPES = {_FLOAT: np.dtype("<f4"), _UINT16: np.dtype("<u2"), _UINT32: np.dtype("<u4")}


def write_glb(asset: Asset, details: Iterable[Detail] = ("full", "reduced", "shadow")) -> bytes:
    """Content of the file. For viewers that do not know our levels of detail, write "full" only. Floats stay exact."""
    return _Writer(asset, tuple(details)).file()


def read_glb(data: bytes) -> Asset:
    """The Asset in a file of `write_glb`; its arrays are views of `data`. Raises `ValueError` for other files."""
    try:
        tree, binary = _chunks(data)
        if zlib.crc32(binary) != tree["asset"]["extras"]["crc32"]:
            raise ValueError("the checksum does not match the content")
        return _Reader(tree, binary).asset()
    except (KeyError, IndexError, TypeError, struct.error, json.JSONDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"not an asset's .glb: {type(error).__name__} {error}") from None


# -- writing ----------------------------------------------------------------------------------------------------


class _Writer:
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
        self._textures = {name: i for i, name in enumerate(asset.textures)}
        self._known: dict[tuple[object, ...], int] = {}

    def file(self) -> bytes:
        """Header, tree and binary chunk."""
        images = [
            {"name": name, "mimeType": "image/jpeg", "bufferView": self._view(_jpeg(image))}
            for name, image in self._asset.textures.items()
        ]
        self._add_nodes()
        materials = [self._material(material) for material in self._materials]
        tree = {
            "asset": {
                "version": "2.0",
                "generator": "AutoDRIVE Simulator",
                "extras": {"crc32": zlib.crc32(self._binary)},
            },
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
        text = json.dumps(
            {key: value for key, value in tree.items() if value != []}, separators=(",", ":"), default=float
        )
        parts = [_chunk(_JSON, text.encode(), b" ")]
        if self._binary:
            parts.append(_chunk(_BIN, bytes(self._binary), b"\0"))
        body = b"".join(parts)
        return struct.pack("<III", _MAGIC, _VERSION, 12 + len(body)) + body

    def _add_nodes(self) -> None:
        """The root, then the nodes of the Asset in their order, then the children with other levels of detail."""
        root: dict[str, Any] = {"name": self._asset.name, "rotation": list(Y_UP_FROM_Z_UP)}
        own = {node.name: self._node(node) for node in self._asset.nodes}
        if len(own) < len(self._asset.nodes):
            raise ValueError(f"asset '{self._asset.name}': two nodes have the same name")
        self._nodes = [root, *own.values()]
        for number, node in enumerate(self._asset.nodes, 1):
            (own[node.parent] if node.parent else root).setdefault("children", []).append(number)
        for node in self._asset.nodes:
            for detail in self._details:
                surfaces = node.surfaces.get(detail)
                if surfaces and detail != "full":
                    own[node.name].setdefault("children", []).append(len(self._nodes))
                    self._nodes.append(self._detail(node.name + SUFFIX[detail], detail, surfaces))

    def _detail(self, name: str, detail: Detail, surfaces: tuple[MeshSurface, ...]) -> dict[str, Any]:
        return {"name": name, "mesh": self._mesh(name, surfaces), "extras": {"detail": detail}}

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
            "POSITION": self._accessor(surface.positions, "VEC3"),
            "NORMAL": self._accessor(surface.normals, "VEC3"),
        }
        if surface.uvs is not None:
            attributes["TEXCOORD_0"] = self._accessor(surface.uvs, "VEC2")
        return {
            "attributes": attributes,
            "indices": self._indices(surface.triangles, len(surface.positions)),
            "material": self._materials.setdefault(surface.material, len(self._materials)),
            "extras": {"label": surface.label.name},
        }

    def _accessor(self, values: Points, kind: str) -> int:
        key = ("vertices", id(values), kind)
        if key not in self._known:
            content = np.ascontiguousarray(values, dtype="<f4")
            limits = {"min": content.min(axis=0).tolist(), "max": content.max(axis=0).tolist()}
            self._known[key] = self._add_accessor(content, _FLOAT, kind, _VERTICES, limits)
        return self._known[key]

    def _indices(self, triangles: np.ndarray, vertices: int) -> int:
        key = ("indices", id(triangles), vertices)
        if key not in self._known:
            flat = triangles.ravel()
            component = _UINT16 if vertices < 65536 else _UINT32  # index 65535 of 16 bits means "restart"
            limits = {"min": [int(flat.min())], "max": [int(flat.max())]}
            content = flat.astype(_TYPES[component])
            self._known[key] = self._add_accessor(content, component, "SCALAR", _INDICES, limits)
        return self._known[key]

    def _add_accessor(
        self, content: np.ndarray, component: int, kind: str, target: int, limits: dict[str, list[Any]]
    ) -> int:
        view = self._view(content.tobytes(), target)
        written = {"bufferView": view, "componentType": component, "count": len(content), "type": kind, **limits}
        self._accessors.append(written)
        return len(self._accessors) - 1

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
        brightest = max(material.emission)
        if brightest > 0.0:
            # a factor is at most 1; dividing by a power of 2 is exact
            strength = 2.0 ** max(0, ceil(log2(brightest)))
            written["emissiveFactor"] = [float(value) / strength for value in material.emission]
            if strength > 1.0:
                written["extensions"] = {"KHR_materials_emissive_strength": {"emissiveStrength": strength}}
        return written


_SAMPLER = {"magFilter": _LINEAR, "minFilter": _LINEAR_MIPMAP_LINEAR, "wrapS": _REPEAT, "wrapT": _REPEAT}


def _jpeg(image: np.ndarray) -> bytes:
    return simplejpeg.encode_jpeg(
        np.ascontiguousarray(image), quality=JPEG_QUALITY, colorspace="RGB", colorsubsampling="444"
    )


def _chunk(kind: int, content: bytes, filler: bytes) -> bytes:
    content += filler * (-len(content) % 4)
    return struct.pack("<II", len(content), kind) + content


# -- reading ----------------------------------------------------------------------------------------------------


class _Pose(NamedTuple):
    position: tuple[float, float, float]
    orientation: tuple[float, float, float, float]


class _Reader:
    def __init__(self, tree: dict[str, Any], binary: memoryview) -> None:
        self._tree = tree
        self._binary = binary
        self._textures = {i: image["name"] for i, image in enumerate(tree.get("images", []))}
        self._materials = [self._material(written) for written in tree.get("materials", [])]
        self._accessors: dict[int, np.ndarray] = {}
        self._meshes: dict[int, tuple[MeshSurface, ...]] = {}

    def asset(self) -> Asset:
        nodes = self._tree["nodes"]
        is_own = [i > 0 and "detail" not in node.get("extras", {}) for i, node in enumerate(nodes)]
        parents = {child: i for i, node in enumerate(nodes) for child in node.get("children", [])}
        return Asset(
            name=nodes[0]["name"],
            nodes=tuple(self._node(node, parents[i], nodes) for i, node in enumerate(nodes) if is_own[i]),
            textures={image["name"]: self._image(image["bufferView"]) for image in self._tree.get("images", [])},
        )

    def _node(self, node: dict[str, Any], parent: int, nodes: list[dict[str, Any]]) -> AssetNode:
        pose, extras = _pose(node), node.get("extras", {})
        surfaces: dict[Detail, tuple[MeshSurface, ...]] = {"full": self._mesh(node["mesh"])} if "mesh" in node else {}
        for child in (nodes[i] for i in node.get("children", [])):
            if detail := child.get("extras", {}).get("detail"):
                surfaces[detail] = self._mesh(child["mesh"])
        return AssetNode(
            name=node["name"],
            parent=nodes[parent]["name"] if parent else "",
            position=pose.position,
            orientation=pose.orientation,
            joint=_joint(extras["joint"]) if "joint" in extras else None,
            lamp=extras.get("lamp", ""),
            surfaces=surfaces,
        )

    def _mesh(self, number: int) -> tuple[MeshSurface, ...]:
        if number not in self._meshes:
            written = self._tree["meshes"][number]["primitives"]
            self._meshes[number] = tuple(self._surface(primitive) for primitive in written)
        return self._meshes[number]

    def _surface(self, primitive: dict[str, Any]) -> MeshSurface:
        attributes = primitive["attributes"]
        return MeshSurface(
            material=self._materials[primitive["material"]],
            positions=self._accessor(attributes["POSITION"]),
            normals=self._accessor(attributes["NORMAL"]),
            triangles=self._accessor(primitive["indices"]),
            label=Label[primitive["extras"]["label"]],
            uvs=self._accessor(attributes["TEXCOORD_0"]) if "TEXCOORD_0" in attributes else None,
        )

    def _accessor(self, number: int) -> np.ndarray:
        """Vertices of shape (n, width); indices as triangles of shape (m, 3)."""
        if number not in self._accessors:
            written = self._tree["accessors"][number]
            dtype, width = _TYPES[written["componentType"]], _WIDTHS[written["type"]]
            flat = np.frombuffer(self._view(written["bufferView"]), dtype=dtype, count=written["count"] * width)
            if width == 1:
                flat, width = flat.astype(np.uint32), 3
            self._accessors[number] = flat.reshape(-1, width)
        return self._accessors[number]

    def _view(self, number: int) -> memoryview:
        view = self._tree["bufferViews"][number]
        return self._binary[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]

    def _image(self, view: int) -> np.ndarray:
        return simplejpeg.decode_jpeg(bytes(self._view(view)), colorspace="RGB")

    def _material(self, written: dict[str, Any]) -> Material:
        surface = written["pbrMetallicRoughness"]
        extension = written.get("extensions", {}).get("KHR_materials_emissive_strength", {})
        strength = extension.get("emissiveStrength", 1.0)
        red, green, blue = (strength * factor for factor in written.get("emissiveFactor", (0.0, 0.0, 0.0)))
        texture = surface.get("baseColorTexture")
        return Material(
            name=written["name"],
            color=tuple(surface["baseColorFactor"][:3]),
            roughness=surface["roughnessFactor"],
            metallic=surface["metallicFactor"],
            emission=(red, green, blue),
            texture=self._textures[texture["index"]] if texture else "",
            is_paint=written.get("extras", {}).get("paint", False),
        )


def _pose(node: dict[str, Any]) -> _Pose:
    x, y, z, w = node.get("rotation", (0.0, 0.0, 0.0, 1.0))
    return _Pose(tuple(node.get("translation", (0.0, 0.0, 0.0))), (w, x, y, z))


def _joint(written: dict[str, Any]) -> NodeJoint:
    return NodeJoint(**{**written, "axis": tuple(written["axis"]), "arm": tuple(written["arm"])})


def _chunks(data: bytes) -> tuple[dict[str, Any], memoryview]:
    """JSON tree and binary chunk of a file."""
    magic, version, length = struct.unpack_from("<III", data)
    if (magic, version, length) != (_MAGIC, _VERSION, len(data)):
        raise ValueError("not a complete binary glTF 2.0 file")
    contents: dict[int, memoryview] = {}
    at = 12
    while at < length:
        size, kind = struct.unpack_from("<II", data, at)
        contents[kind] = memoryview(data)[at + 8 : at + 8 + size]
        at += 8 + size
    return json.loads(bytes(contents[_JSON])), contents.get(_BIN, memoryview(b""))
