"""Interface to MuJoCo: reset, step (from compiled code), contacts, save, restore. Nothing else calls MuJoCo."""

# pyright: reportAttributeAccessIssue=false
# (the bindings are compiled and ship no types)

from __future__ import annotations

import copy
import ctypes
import functools
import hashlib
import zlib
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

import llvmlite.binding as llvm
import numpy as np
from numba.core import config, types
from numpy.typing import NDArray

from autodrive.arrays import Floats, Integers
from autodrive.errors import EngineError, SnapshotError
from autodrive.installation import mujoco_error, mujoco_fix

if _error := mujoco_error():
    raise EngineError(f"{_error}. Run:  {mujoco_fix()}")

import mujoco  # after the check of its installation

VERSION: str = mujoco.mj_versionString()
"""Of MuJoCo, for example "4.0.1"."""


def _mujoco_library() -> ctypes.CDLL:
    """The C library with the version of the bindings, from their folder."""
    folder = Path(mujoco.__file__).parent
    for name in (f"libmujoco.so.{VERSION}", f"libmujoco.{VERSION}.dylib", "mujoco.dll"):
        if (folder / name).is_file():
            return ctypes.CDLL(str(folder / name))
    raise EngineError(f"the library of MuJoCo {VERSION} is not in {folder}. Run:  {mujoco_fix()}")


_library = _mujoco_library()


def _external(name: str, function: Any, *arguments: Any) -> Callable[..., Any]:
    """A C function that compiled code calls by name, so that Numba can cache the caller."""
    if config.DISABLE_JIT:
        sizes = {types.intp: ctypes.c_ssize_t, types.int32: ctypes.c_int32}
        prototype = ctypes.CFUNCTYPE(None, *(sizes[argument] for argument in arguments))
        return ctypes.cast(function, prototype)
    llvm.add_symbol(name, ctypes.cast(function, ctypes.c_void_p).value)
    return types.ExternalFunction(name, types.void(*arguments))  # pyright: ignore[reportReturnType]


mj_step1 = _external("mj_step1", _library.mj_step1, types.intp, types.intp)
"""(mjModel*, mjData*): computes kinematics, contacts and constraints from positions and velocities."""
mj_step2 = _external("mj_step2", _library.mj_step2, types.intp, types.intp)
"""(mjModel*, mjData*): computes forces, accelerations, and the next positions and velocities."""
mj_contact_force = _external(
    "mj_contactForce", _library.mj_contactForce, types.intp, types.intp, types.int32, types.intp
)
"""(mjModel*, mjData*, contact, double[6]*): force and torque in the contact frame, normal first."""
copy_memory = _external("memmove", ctypes.memmove, types.intp, types.intp, types.intp)
"""(to, from, bytes)."""


class Views(NamedTuple):
    """Memory of the engine that compiled code reads and writes."""

    model: int
    """Address of mjModel."""
    data: int
    """Address of mjData."""
    qpos: Floats
    qvel: Floats
    applied: Floats
    """Applied generalised force (qfrc_applied); for a free body: force in map axes, torque about its origin in body
    axes."""
    geom_position: Floats
    geom_rotation: Floats
    """Row-major, shape (n_geom, 9)."""
    shape_geom: Integers
    """Geom of each shape."""
    contact_count: NDArray[np.int32]
    """Current number of contacts, shape (1,)."""
    contacts: NDArray[np.int64]
    """Current address of the first contact, shape (1,)."""
    warnings: NDArray[np.int32]
    """Number of diverged states, for each kind of warning."""
    contact_layout: Integers
    """Offsets in bytes: from one contact to the next, and within a contact to its position and its two geoms."""


def text(numbers: Iterable[float]) -> str:
    """Numbers for an MJCF attribute, exact to the last bit."""
    return " ".join(f"{number:.17g}" for number in numbers)


class Geom(NamedTuple):
    """A collision shape of the engine."""

    number: int
    kind: int
    size: Floats
    bounding_radius: float
    body: int
    qpos: int
    """Index of its body's pose in qpos, or -1 if it is fixed."""
    dof: int
    """Index of its body's velocity in qvel, or -1 if it is fixed."""


class SavedData(NamedTuple):
    """What `Engine.restore` needs; can be pickled."""

    data: Any
    """A copy of mjData, which is not derived from the state alone."""
    checksum: int
    """Of the positions, velocities and forces in it."""


class Engine:
    """Rigid bodies and contacts. Movable bodies are free bodies: 7 numbers in qpos and 6 in qvel each."""

    def __init__(self, mjcf: str) -> None:
        """Raises `EngineError` for bodies that MuJoCo refuses, such as hundreds of boxes at the same place."""
        try:
            self.model = mujoco.MjModel.from_xml_string(mjcf)
            if VERSION == "4.0.0":  # its solver diverges with sparse Jacobians (google-deepmind/mujoco issue 3767)
                self.model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
            self.data = mujoco.MjData(self.model)
            mujoco.mj_forward(self.model, self.data)
        except (ValueError, mujoco.FatalError) as error:
            raise EngineError(f"MuJoCo cannot simulate these bodies: {' '.join(str(error).split())}") from None
        self.identity = hashlib.sha256(f"{VERSION} {mjcf}".encode()).hexdigest()
        """The same for engines whose saved data fit each other."""

    def body(self, name: str) -> tuple[int, int, int]:
        """Number of a free body, and its indices in qpos and qvel."""
        body = self.model.body(name)
        joint = self.model.joint(int(body.jntadr[0]))
        return int(body.id), int(joint.qposadr[0]), int(joint.dofadr[0])

    @property
    def geom_names(self) -> list[str]:
        """Name of each geom, by number."""
        return [self.model.geom(i).name for i in range(self.model.ngeom)]

    @property
    def geom_bodies(self) -> list[int]:
        """Number of the body of each geom, by number of the geom."""
        return self.model.geom_bodyid.tolist()

    def geoms(self) -> list[Geom]:
        """All geoms except planes."""
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
        """Pairs of geoms that overlap by more than `depth` [m]."""
        contact = self.data.contact
        return [(int(a), int(b)) for (a, b), gap in zip(contact.geom, contact.dist, strict=True) if gap < -depth]

    def views(self, shape_geom: Integers) -> Views:
        """Views for compiled code; valid as long as this engine exists."""
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
        """Sets the initial state of the model."""
        mujoco.mj_resetData(self.model, self.data)

    def update(self) -> None:
        """Recomputes all derived quantities after positions or velocities were set directly."""
        mujoco.mj_forward(self.model, self.data)

    def save(self) -> SavedData:
        """The complete data, because the state vectors of MuJoCo do not contain which bodies sleep."""
        return SavedData(copy.copy(self.data), _checksum(self.data))

    def restore(self, saved: SavedData) -> None:
        """Restores saved data; the simulation continues with the same bits as after `save`.

        Raises `SnapshotError` for anything but unchanged data of such an engine; then nothing has changed.
        """
        try:
            if _checksum(saved.data) != saved.checksum:
                raise SnapshotError("the engine's data of the snapshot have been changed since save()")
            mujoco.mj_copyData(self.data, self.model, saved.data)
        except (AttributeError, TypeError, mujoco.FatalError):
            raise SnapshotError(
                "the snapshot has no data of this world's engine; give restore() what save() returned"
            ) from None


def _checksum(data: Any) -> int:
    parts = data.qpos, data.qvel, data.qacc_warmstart, data.qfrc_applied
    return zlib.crc32(b"".join([part.tobytes() for part in parts]))


_BAD = slice(int(mujoco.mjtWarning.mjWARN_BADQPOS), int(mujoco.mjtWarning.mjWARN_BADQACC) + 1)
"""Warnings after which MuJoCo resets a diverged state."""


class _Layout(NamedTuple):
    """Offsets in bytes of two fields of mjData, and within mjContact."""

    contact_count: int
    contacts: int
    stride: int
    position: int
    geoms: int


@functools.cache
def _data_layout() -> _Layout:
    """Searches the memory of a small model for the values that the bindings report.

    The Python bindings give no address of these fields, and the layout can change with any version of MuJoCo.
    """
    boxes = "".join(f'<body pos="{i} 0 0"><freejoint/><geom type="box" size="0.1 0.1 0.1"/></body>' for i in range(7))
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody><geom type="plane" size="9 9 1"/>{boxes}</worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    numbers_end = data.energy.ctypes.data - data._address  # the pointers follow the plain numbers
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
        raise EngineError(f"MuJoCo {VERSION} stores its contacts in an unknown layout. Run:  {mujoco_fix()}")
    return _Layout(
        contact_count=counts.pop(),
        contacts=pointers[-1],  # the arena starts at the same address, and its pointer comes first
        stride=contact.dist.strides[0],
        position=contact.pos.ctypes.data - start,
        geoms=contact.geom.ctypes.data - start,
    )


def _memory(address: int, kind: Any) -> NDArray[Any]:
    return np.ctypeslib.as_array((kind * 1).from_address(address))
