"""A small asset that uses every feature of `assets.asset`, and a comparison of assets."""

from __future__ import annotations

import numpy as np

from autodrive.graphics.assets.asset import Asset, AssetNode, Material, MeshSurface, NodeJoint
from autodrive.protocol.labels import Label

CHECKS = Material("checks", (0.5, 0.25, 0.125), roughness=0.7, metallic=0.1, texture="checks")
GLASS = Material("glass", (0.9, 0.1, 0.05), roughness=0.1, emission=(5.7, 0.3, 0.1))
DIM = Material("dim", (0.2, 0.3, 0.4), emission=(0.1, 0.2, 0.3), is_paint=True)


def checkerboard() -> np.ndarray:
    """Pixels of shape (32, 48, 3)."""
    rows, columns = np.mgrid[0:32, 0:48] // 8
    bright = np.where((rows + columns) % 2, 220, 30).astype(np.uint8)
    return np.stack([bright, bright, 255 - bright], axis=-1)


def surface(material: Material, label: Label, seed: int, vertices: int = 12) -> MeshSurface:
    """Some random triangles."""
    random = np.random.default_rng(seed)
    normals = random.normal(size=(vertices, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return MeshSurface(
        material=material,
        positions=random.normal(size=(vertices, 3)).astype(np.float32),
        normals=normals.astype(np.float32),
        triangles=random.integers(0, vertices, size=(20, 3)).astype(np.uint32),
        label=label,
        uvs=random.random((vertices, 2)).astype(np.float32) if material.texture else None,
    )


def example() -> Asset:
    """A body, a wheel that moves and spins, a lamp and a rod; some surfaces are shared."""
    tyre = (surface(DIM, Label.VEHICLE, 2),)
    return Asset(
        name="example",
        nodes=(
            AssetNode(
                "body",
                position=(0.1, -0.2, 1.0 / 3.0),
                orientation=(0.5, 0.5, -0.5, 0.5),
                surfaces={
                    "full": (surface(CHECKS, Label.BOX, 0), surface(GLASS, Label.SIGN, 1)),
                    "reduced": (surface(CHECKS, Label.BOX, 3),),
                    "shadow": (surface(DIM, Label.BOX, 4, vertices=70_000),),
                },
            ),
            AssetNode("hub", "body", joint=NodeJoint("slide", "compression_front_left")),
            AssetNode(
                "wheel",
                "hub",
                joint=NodeJoint("hinge", "spin_front_left", axis=(0.0, 1.0, 0.0)),
                surfaces={"full": tyre},
            ),
            AssetNode("rod", "body", joint=NodeJoint("crank", "steering", gain=-1.5, arm=(0.01, 0.02, 0.0))),
            AssetNode("lamp", "body", lamp="head_left", surfaces={"full": tyre, "reduced": tyre}),
        ),
        textures={"checks": checkerboard()},
    )


def assert_same(one: Asset, other: Asset, *, texture_tolerance: float = 3.0) -> None:
    """Everything is equal; textures, which JPEG blurs, within a mean difference of 255."""
    assert one.name == other.name
    assert one.textures.keys() == other.textures.keys()
    for name, texture in one.textures.items():
        assert texture.shape == other.textures[name].shape
        assert np.abs(texture.astype(int) - other.textures[name]).mean() < texture_tolerance
    assert len(one.nodes) == len(other.nodes)
    for a, b in zip(one.nodes, other.nodes, strict=True):
        for field in ("name", "parent", "position", "orientation", "joint", "lamp"):
            assert getattr(a, field) == getattr(b, field)
        assert a.surfaces.keys() == b.surfaces.keys()
        for detail in a.surfaces:
            for s, t in zip(a.surfaces[detail], b.surfaces[detail], strict=True):
                assert (s.material, s.label) == (t.material, t.label)
                for field in ("positions", "normals", "triangles", "uvs"):
                    left, right = getattr(s, field), getattr(t, field)
                    assert (left is None) == (right is None)
                    if left is not None:
                        assert left.dtype == right.dtype
                        np.testing.assert_array_equal(left, right)
