"""Interface to MuJoCo: bodies, step (from compiled code), contacts. Nothing else calls MuJoCo.

The engine has no state of its own: `load` brings it to the State of a world, from which it continues with the same bits
in any process.
"""

# pyright: reportAttributeAccessIssue=false
# (the bindings are compiled and ship no types)

from __future__ import annotations

import ctypes
import functools
import hashlib
from collections.abc import Callable
from copy import copy
from pathlib import Path
from typing import Any, NamedTuple

import llvmlite.binding as llvm
import numpy as np
from numba.core import config, types
from numpy.typing import NDArray

from autodrive.base.arrays import Floats, Integers
from autodrive.base.errors import EngineError
from autodrive.base.installation import mujoco_error, mujoco_fix
from autodrive.base.jit import inlined
from autodrive.physics.model import Model
from autodrive.physics.state import State

if _error := mujoco_error():
    raise EngineError(f"{_error}. Run:  {mujoco_fix()}")

import mujoco  # after the check of its installation

_log = mujoco.MjLogConfig.get()
_log.logto_console = _log.logto_file = False  # `has_diverged` finds its warnings; it would write MUJOCO_LOG.TXT
_log.set()

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
mj_position = _external("mj_fwdPosition", _library.mj_fwdPosition, types.intp, types.intp)
"""(mjModel*, mjData*): the part of `mj_step1` that depends on positions."""
mj_update_sleep = _external("mj_updateSleep", _library.mj_updateSleep, types.intp, types.intp)
"""(mjModel*, mjData*): derives the lists of bodies that are awake from `tree_asleep`."""
mj_set_constants = _external("mj_setConst", _library.mj_setConst, types.intp, types.intp)
"""(mjModel*, mjData*): derives the constants of the model from its masses; the data are undefined afterwards."""
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
    mass: Floats
    """Of each of the engine's bodies [kg]."""
    inertia: Floats
    """About the principal axes of each of these bodies [kg m^2], shape (n, 3)."""
    qpos: Floats
    """As `State.qpos`; likewise the next three."""
    qvel: Floats
    warmstart: Floats
    asleep: NDArray[np.int32]
    applied: Floats
    """As `Scratch.applied`."""
    acceleration: Floats
    """Shape (6 n_body,); likewise the next one."""
    smooth_acceleration: Floats
    contact_count: NDArray[np.int32]
    """Current number of contacts, shape (1,)."""
    contacts: NDArray[np.int64]
    """Current address of the first contact, shape (1,)."""
    warnings: NDArray[np.int32]
    """Number of diverged states, for each kind of warning."""
    contact_layout: Integers
    """Offsets in bytes: from one contact to the next, and within a contact to its position and its two geoms."""


FLOOR = 1
"""Collision class (contype) of the floor."""


class Geom(NamedTuple):
    """A collision shape of the engine."""

    number: int
    kind: int
    size: Floats
    position: Floats
    """In the frame of its body, or in the map if it is fixed."""
    orientation: Floats
    """Quaternion wxyz, likewise."""
    bounding_radius: float
    is_stopped_by_floor: bool
    body: int
    qpos: int
    """Index of its body's pose in qpos, or -1 if it is fixed."""
    dof: int
    """Index of its body's velocity in qvel, or -1 if it is fixed."""


AWAKE = -11
"""State of a body that has just begun to be awake, of `State.asleep` (MuJoCo: -(1 + mjMINAWAKE))."""


@inlined
def load(model: Model, state: State, views: Views) -> None:
    """Brings the engine to the vehicles' masses and the bodies' state. What follows depends on these alone."""
    is_loaded = True
    for i in range(model.vehicles.shape[0]):
        v = model.vehicles[i]
        body = v["body"]
        if views.mass[body] != v["mass"] or views.inertia[body, 0] != v["inertia"][0]:
            is_loaded = False
            views.mass[body] = v["mass"]
            for axis in range(3):
                views.inertia[body, axis] = v["inertia"][axis]
    if not is_loaded:
        mj_set_constants(views.model, views.data)
    for k in range(state.qpos.shape[0]):
        if state.qpos[k] != views.qpos[k]:
            is_loaded = False
            views.qpos[k] = state.qpos[k]
    for k in range(state.qvel.shape[0]):
        if state.qvel[k] != views.qvel[k]:
            is_loaded = False
            views.qvel[k] = state.qvel[k]
        views.warmstart[k] = state.qacc[k]
    for b in range(state.asleep.shape[0]):
        if state.asleep[b] != views.asleep[b]:
            is_loaded = False
    if not is_loaded:
        # the bodies that sleep are computed as well, once
        for b in range(state.asleep.shape[0]):
            views.asleep[b] = AWAKE
        mj_update_sleep(views.model, views.data)
        mj_position(views.model, views.data)
        for b in range(state.asleep.shape[0]):
            views.asleep[b] = int(state.asleep[b])
        mj_update_sleep(views.model, views.data)
        mj_step1(views.model, views.data)
    for b in range(state.asleep.shape[0]):
        if views.asleep[b] >= 0:  # what a body was doing before it fell asleep is forgotten
            for k in range(6 * b, 6 * b + 6):
                views.warmstart[k] = views.acceleration[k] = views.smooth_acceleration[k] = 0.0


@inlined
def has_diverged(views: Views) -> bool:
    """Whether the engine has warned of a diverged state since `Engine.forget_warnings`."""
    return views.warnings[0] + views.warnings[1] + views.warnings[2] > 0


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

    def copy(self) -> Engine:
        """Another engine for the same bodies, at the start; two threads can use the two at once."""
        other = copy(self)
        other.model = copy(self.model)
        other.data = mujoco.MjData(other.model)
        mujoco.mj_forward(other.model, other.data)
        return other

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
                    position=self.model.geom_pos[i].copy(),
                    orientation=self.model.geom_quat[i].copy(),
                    bounding_radius=float(self.model.geom_rbound[i]),
                    is_stopped_by_floor=bool(self.model.geom_conaffinity[i] & FLOOR),
                    body=body,
                    qpos=int(self.model.jnt_qposadr[joint]) if joint >= 0 else -1,
                    dof=int(self.model.jnt_dofadr[joint]) if joint >= 0 else -1,
                )
            )
        return found

    def overlapping(self, qpos: Floats | None = None, depth: float = 0.001) -> list[tuple[int, int]]:
        """Pairs of geoms that overlap by more than `depth` [m]: now, or if the bodies were placed at `qpos`."""
        if qpos is not None:
            self.data.tree_asleep[:] = AWAKE
            _library.mj_updateSleep(*(ctypes.c_void_p(one._address) for one in (self.model, self.data)))
            self.data.qpos[:] = qpos
            mujoco.mj_forward(self.model, self.data)
        contact = self.data.contact
        return [(int(a), int(b)) for (a, b), gap in zip(contact.geom, contact.dist, strict=True) if gap < -depth]

    @property
    def body_count(self) -> int:
        """Number of movable bodies."""
        return int(self.model.ntree)

    @property
    def start(self) -> Floats:
        """`State.qpos` at the start."""
        return self.model.qpos0.copy()

    def views(self) -> Views:
        """Views for compiled code; valid as long as this engine exists."""
        layout = _data_layout()
        data = self.data
        return Views(
            model=self.model._address,
            data=data._address,
            mass=self.model.body_mass,
            inertia=self.model.body_inertia,
            qpos=data.qpos,
            qvel=data.qvel,
            warmstart=data.qacc_warmstart,
            asleep=data.tree_asleep,
            applied=data.qfrc_applied,
            acceleration=data.qacc,
            smooth_acceleration=data.qacc_smooth,
            contact_count=_memory(data._address + layout.contact_count, ctypes.c_int32),
            contacts=_memory(data._address + layout.contacts, ctypes.c_int64),
            warnings=data.warning.number[_BAD],
            contact_layout=np.array([layout.stride, layout.position, layout.geoms], dtype=np.int64),
        )

    def forget_warnings(self) -> None:
        """Forget that the state has diverged."""
        self.data.warning.number[_BAD] = 0


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
