"""Assets as .glb files: valid glTF 2.0, and readable by another library; and in the cache: read unchanged."""

from __future__ import annotations

import io
import json
import struct
from dataclasses import asdict, replace
from typing import Any

import numpy as np
import pytest
import trimesh

from autodrive.base.transforms import rotation_from_quaternion
from autodrive.graphics.assets.asset import Asset, AssetNode, Detail
from autodrive.graphics.assets.glb import write_glb
from autodrive.graphics.assets.packed import pack, unpack
from autodrive.graphics.meshes.strips import shade_along, strips
from autodrive.protocol.labels import Label
from tests.support.example_asset import DIM, GLASS, assert_same, example, surface

BYTES = {5126: 4, 5125: 4, 5123: 2}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}
KINDS = {5126: "<f4", 5125: "<u4", 5123: "<u2"}


def parts(data: bytes) -> tuple[dict[str, Any], bytes]:
    """JSON tree and binary chunk, read as the standard defines."""
    length = struct.unpack("<I", data[12:16])[0]
    return json.loads(data[20 : 20 + length]), data[28 + length :]


def test_unpacking_returns_what_was_packed() -> None:
    asset, glb = unpack(pack(example(), b"file"))
    assert_same(asset, example())
    assert glb == b"file"


def test_strips_are_in_the_file_for_our_renderers_only() -> None:
    lines = [shade_along(np.array([(0.0, 0.0), (1.0, 0.0), (2.0, 1.0)]), 0.1, 0.5)]
    asset = replace(example(), strips=strips(lines))
    assert asset.strips is not None
    tree, binary = parts(write_glb(asset))
    for name, expected in (("vertices", asset.strips.vertices), ("triangles", asset.strips.triangles)):
        accessor = tree["accessors"][tree["nodes"][0]["extras"]["strips"][name]]
        start = tree["bufferViews"][accessor["bufferView"]]["byteOffset"]
        assert binary[start : start + expected.nbytes] == expected.tobytes()
    assert "extras" not in parts(write_glb(asset, ("full",)))[0]["nodes"][0]
    again = unpack(pack(asset, b""))[0].strips
    assert again is not None
    assert again.vertices.tobytes() == asset.strips.vertices.tobytes()
    assert again.vertices.dtype == asset.strips.vertices.dtype


def test_the_same_asset_gives_the_same_bytes() -> None:
    assert write_glb(example()) == write_glb(example())


def test_shared_surfaces_are_shared_in_the_file() -> None:
    assert len(parts(write_glb(example()))[0]["meshes"]) == 4  # three details of the body, one tyre


def test_the_file_follows_the_standard() -> None:
    data = write_glb(example())
    assert len(data) % 4 == 0
    assert struct.unpack("<III", data[:12]) == (0x46546C67, 2, len(data))
    tree, binary = parts(data)
    assert tree["buffers"] == [{"byteLength": len(binary)}]
    for view in tree["bufferViews"]:
        assert view["byteOffset"] % 4 == 0
        assert view["byteOffset"] + view["byteLength"] <= len(binary)
    for accessor in tree["accessors"]:
        view, width = tree["bufferViews"][accessor["bufferView"]], WIDTHS[accessor["type"]]
        assert view["byteLength"] == accessor["count"] * width * BYTES[accessor["componentType"]]
        values = np.frombuffer(
            binary, KINDS[accessor["componentType"]], accessor["count"] * width, view["byteOffset"]
        ).reshape(-1, width)
        assert accessor["min"] == values.min(axis=0).tolist()
        assert accessor["max"] == values.max(axis=0).tolist()
    for material in tree["materials"]:
        assert max(material.get("emissiveFactor", [0.0])) <= 1.0
    assert all(value != [] for value in tree.values())


def test_indices_have_two_bytes_where_that_is_enough() -> None:
    tree, _ = parts(write_glb(example()))
    kinds = set()
    for primitive in (p for mesh in tree["meshes"] for p in mesh["primitives"]):
        vertices = tree["accessors"][primitive["attributes"]["POSITION"]]["count"]
        kind = tree["accessors"][primitive["indices"]]["componentType"]
        assert kind == (5123 if vertices <= 65535 else 5125)  # 65535 means "restart" and must not be an index
        kinds.add(kind)
    assert kinds == {5123, 5125}


def test_another_reader_finds_every_triangle_at_its_place_with_z_turned_to_y() -> None:
    scene = trimesh.load_scene(io.BytesIO(write_glb(example())), file_type="glb", process=False)
    assert {"body", "hub", "wheel", "rod", "lamp", "body_lod1", "body_shadow", "lamp_lod1"} <= set(scene.graph.nodes)
    body = example().nodes[0]
    world_from_body = np.reshape(rotation_from_quaternion(body.orientation), (3, 3))
    details: list[tuple[str, Detail]] = [("body_lod1", "reduced"), ("body_shadow", "shadow")]
    for name, detail in details:
        part = body.surfaces[detail][0]
        x, y, z = world_from_body @ part.positions.T + np.reshape(body.position, (3, 1))
        transform, geometry = scene.graph.get(name)
        mesh = scene.geometry[geometry]
        np.testing.assert_allclose(
            trimesh.transform_points(mesh.vertices, transform), np.stack([x, z, -y], 1), atol=1e-6
        )
        np.testing.assert_array_equal(mesh.faces, part.triangles)


def test_another_reader_finds_the_materials_and_the_texture() -> None:
    scene = trimesh.load_scene(io.BytesIO(write_glb(example())), file_type="glb", process=False)
    glass = next(m.visual.material for m in scene.geometry.values() if m.visual.material.name == "glass")
    np.testing.assert_allclose(np.array(glass.emissiveFactor) * 8.0, GLASS.emission)  # 8: strength, a power of 2
    assert (glass.roughnessFactor, glass.metallicFactor) == (GLASS.roughness, GLASS.metallic)
    body = next(mesh for name, mesh in scene.geometry.items() if name == "body_lod1")
    uvs = example().nodes[0].surfaces["reduced"][0].uvs
    assert uvs is not None
    # this reader inverts v: its images start at the lower left corner
    np.testing.assert_allclose(body.visual.uv, np.stack([uvs[:, 0], 1.0 - uvs[:, 1]], 1), atol=1e-6)


def test_levels_of_detail_can_be_omitted() -> None:
    tree, _ = parts(write_glb(example(), ["full"]))
    assert [node["name"] for node in tree["nodes"]] == ["example", *(node.name for node in example().nodes)]


def test_joints_lamps_labels_and_paint_are_extras() -> None:
    tree, _ = parts(write_glb(example()))
    extras = {node["name"]: node.get("extras", {}) for node in tree["nodes"]}
    rod = example().nodes[3].joint
    assert rod is not None
    assert extras["rod"] == {"joint": {**asdict(rod), "axis": list(rod.axis), "arm": list(rod.arm)}}
    assert extras["lamp"] == {"lamp": "head_left"}
    assert (extras["body_lod1"], extras["body_shadow"]) == ({"detail": "reduced"}, {"detail": "shadow"})
    body = tree["meshes"][0]["primitives"]
    assert [one["extras"]["label"] for one in body] == ["BOX", "SIGN"]
    assert [material["name"] for material in tree["materials"] if material.get("extras") == {"paint": True}] == ["dim"]
    factors = {one["name"]: one.get("extensions", {}) for one in tree["materials"]}
    assert factors["glass"] == {"KHR_materials_emissive_strength": {"emissiveStrength": 8.0}}
    assert (factors["dim"], tree["extensionsUsed"]) == ({}, list(factors["glass"]))


def test_duplicate_names_and_surfaces_without_triangles_are_errors() -> None:
    with pytest.raises(ValueError, match="same name"):
        write_glb(Asset("twice", (AssetNode("a"), AssetNode("a"))))
    some = surface(DIM, Label.BOX, 0)
    nothing = replace(some, triangles=some.triangles[:0])
    with pytest.raises(ValueError, match="no triangles"):
        write_glb(Asset("empty", (AssetNode("a", surfaces={"full": (nothing,)}),)))


def test_an_asset_without_surfaces_can_be_written() -> None:
    tree, binary = parts(write_glb(Asset("empty", (AssetNode("a"),))))
    assert ([node["name"] for node in tree["nodes"]], binary) == (["empty", "a"], b"")
