"""MuJoCo behind a few verbs: reset, step (from compiled code), contacts, save, restore. Nobody else knows MuJoCo."""

# pyright: reportAttributeAccessIssue=false
# (the bindings are compiled and ship no types)

from __future__ import annotations

import copy
import ctypes
import functools
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

import llvmlite.binding as llvm
import mujoco
import numpy as np
from numba.core import config, types
from numpy.typing import NDArray

from autodrive.errors import EngineError
from autodrive.state import Floats, Integers


def _mujoco_library() -> ctypes.CDLL:
    folder = Path(mujoco.__file__).parent
    for pattern in ("libmujoco.so*", "libmujoco*.dylib", "mujoco.dll"):
        for path in folder.glob(pattern):
            return ctypes.CDLL(str(path))
    raise EngineError(f"MuJoCo's library is not in {folder}; reinstall the package mujoco-core")


_library = _mujoco_library()


def _external(name: str, function: Any, *arguments: Any) -> Callable[..., Any]:
    """A C function that compiled code calls by name, so that what calls it can be kept in Numba's cache."""
    if config.DISABLE_JIT:
        sizes = {types.intp: ctypes.c_ssize_t, types.int32: ctypes.c_int32}
        prototype = ctypes.CFUNCTYPE(None, *(sizes[argument] for argument in arguments))
        return ctypes.cast(function, prototype)
    llvm.add_symbol(name, ctypes.cast(function, ctypes.c_void_p).value)
    return types.ExternalFunction(name, types.void(*arguments))  # pyright: ignore[reportReturnType]


mj_step1 = _external("mj_step1", _library.mj_step1, types.intp, types.intp)
"""(mjModel*, mjData*): what follows from positions and velocities: kinematics, contacts, constraints."""
mj_step2 = _external("mj_step2", _library.mj_step2, types.intp, types.intp)
"""(mjModel*, mjData*): forces, accelerations, and the next positions and velocities."""
mj_contact_force = _external(
    "mj_contactForce", _library.mj_contactForce, types.intp, types.intp, types.int32, types.intp
)
"""(mjModel*, mjData*, contact, double[6]*): force and torque in the contact's frame, normal first."""
copy_memory = _external("memmove", ctypes.memmove, types.intp, types.intp, types.intp)
"""(to, from, bytes)."""


class Views(NamedTuple):
    """The engine's memory, as compiled code reads and writes it."""

    model: int
    """Address of mjModel."""
    data: int
    """Address of mjData."""
    qpos: Floats
    qvel: Floats
    applied: Floats
    """Generalised force from outside (qfrc_applied); of a free body: force in the map, torque about its origin in its
    own axes."""
    geom_position: Floats
    geom_rotation: Floats
    """Row-major, shape (n_geom, 9)."""
    shape_geom: Integers
    """The engine's geom of each shape."""
    contact_count: NDArray[np.int32]
    """Number of contacts now, shape (1,)."""
    contacts: NDArray[np.int64]
    """Address of the first contact now, shape (1,)."""
    warnings: NDArray[np.int32]
    """How often the engine gave up on a state, for each of its reasons."""
    contact_layout: Integers
    """Bytes: from one contact to the next, and from its start to its position and to its pair of geoms."""


def text(numbers: Iterable[float]) -> str:
    """Numbers as MuJoCo's files write them, to the last bit."""
    return " ".join(f"{number:.17g}" for number in numbers)


class Geom(NamedTuple):
    """A collision shape of the engine's."""

    number: int
    kind: int
    size: Floats
    bounding_radius: float
    body: int
    qpos: int
    """Where its body's pose begins in qpos, or -1 if it never moves."""
    dof: int
    """Likewise its velocity in qvel."""


class Engine:
    """Rigid bodies and contacts. Free bodies only: each has 7 numbers in qpos and 6 in qvel."""

    def __init__(self, mjcf: str) -> None:
        self.model = mujoco.MjModel.from_xml_string(mjcf)
        self.data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, self.data)

    def body(self, name: str) -> tuple[int, int, int]:
        """Number of a free body, and where its rows begin in qpos and qvel."""
        body = self.model.body(name)
        joint = self.model.joint(int(body.jntadr[0]))
        return int(body.id), int(joint.qposadr[0]), int(joint.dofadr[0])

    @property
    def geom_names(self) -> list[str]:
        """Name of each geom, by its number."""
        return [self.model.geom(i).name for i in range(self.model.ngeom)]

    @property
    def geom_bodies(self) -> list[int]:
        """Number of the body of each geom, by the geom's number."""
        return self.model.geom_bodyid.tolist()

    def geoms(self) -> list[Geom]:
        """All but planes."""
        found = []
        for i in range(self.model.ngeom):
            if self.model.geom_type[i] == mujoco.mjtGeom.mjGEOM_PLANE:
                continue
            body = int(self.model.geom_bodyid[i])
            joint = int(self.model.body_jntadr[body])
            found.append(
                Geom(
                    number=i,
                    kind=int(self.model.geom_type[i]),
                    size=self.model.geom_size[i].copy(),
                    bounding_radius=float(self.model.geom_rbound[i]),
                    body=body,
                    qpos=int(self.model.jnt_qposadr[joint]) if joint >= 0 else -1,
                    dof=int(self.model.jnt_dofadr[joint]) if joint >= 0 else -1,
                )
            )
        return found

    def overlapping(self, depth: float = 0.001) -> list[tuple[int, int]]:
        """Pairs of geoms that are in each other by more than `depth` [m] now."""
        contact = self.data.contact
        return [(int(a), int(b)) for (a, b), gap in zip(contact.geom, contact.dist, strict=True) if gap < -depth]

    def views(self, shape_geom: Integers) -> Views:
        """What compiled code needs; valid as long as this engine."""
        layout = _data_layout()
        data = self.data
        return Views(
            model=self.model._address,
            data=data._address,
            qpos=data.qpos,
            qvel=data.qvel,
            applied=data.qfrc_applied,
            geom_position=data.geom_xpos,
            geom_rotation=data.geom_xmat,
            shape_geom=shape_geom,
            contact_count=_memory(data._address + layout.contact_count, ctypes.c_int32),
            contacts=_memory(data._address + layout.contacts, ctypes.c_int64),
            warnings=data.warning.number[_BAD],
            contact_layout=np.array([layout.stride, layout.position, layout.geoms], dtype=np.int64),
        )

    def reset(self) -> None:
        """Everything as the model says."""
        mujoco.mj_resetData(self.model, self.data)

    def update(self) -> None:
        """Makes all that follows from positions and velocities follow, after they were set from outside."""
        mujoco.mj_forward(self.model, self.data)

    def save(self) -> Any:
        """All that the future depends on: the whole data, for MuJoCo's state vectors do not tell who sleeps."""
        return copy.copy(self.data)

    def restore(self, saved: Any) -> None:
        """The same future as at `save`, bit for bit."""
        mujoco.mj_copyData(self.data, self.model, saved)


_BAD = slice(int(mujoco.mjtWarning.mjWARN_BADQPOS), int(mujoco.mjtWarning.mjWARN_BADQACC) + 1)
"""Warnings after which MuJoCo resets a state that it cannot go on from."""


class _Layout(NamedTuple):
    """Bytes from the start of mjData to two of its fields, and within mjContact."""

    contact_count: int
    contacts: int
    stride: int
    position: int
    geoms: int


@functools.cache
def _data_layout() -> _Layout:
    """Found by looking, not by counting: a probe's memory is searched for the values that the bindings report.

    MuJoCo's Python bindings give no address for these fields, and the layout may change with any version.
    """
    boxes = "".join(f'<body pos="{i} 0 0"><freejoint/><geom type="box" size="0.1 0.1 0.1"/></body>' for i in range(7))
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody><geom type="plane" size="9 9 1"/>{boxes}</worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    numbers_end = data.energy.ctypes.data - data._address  # behind the plain numbers come the pointers
    counts: set[int] = set()
    for touching in (7, 3, 5):
        data.qpos[2::7] = [0.09 if i < touching else 1.0 for i in range(7)]
        mujoco.mj_forward(model, data)
        numbers = np.frombuffer(ctypes.string_at(data._address, numbers_end), np.int32)
        found = set((4 * np.flatnonzero(numbers == data.ncon)).tolist())
        counts = found & counts if counts else found
    contact = data.contact
    start = contact.dist.ctypes.data
    pointers = []
    offset = numbers_end
    while (value := ctypes.c_int64.from_address(data._address + offset).value) != data.efc_pos.ctypes.data:
        if value == start:
            pointers.append(offset)
        offset += 8
    if len(counts) != 1 or not pointers:
        raise EngineError("this version of MuJoCo keeps its contacts in an unknown way; install mujoco-core 4.0.1")
    return _Layout(
        contact_count=counts.pop(),
        contacts=pointers[-1],  # the arena, too, begins where its first array does, and its pointer stands before
        stride=contact.dist.strides[0],
        position=contact.pos.ctypes.data - start,
        geoms=contact.geom.ctypes.data - start,
    )


def _memory(address: int, kind: Any) -> NDArray[Any]:
    return np.ctypeslib.as_array((kind * 1).from_address(address))
