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
from math import sqrt
from pathlib import Path
from typing import Any, NamedTuple

import llvmlite.binding as llvm
import numpy as np
from numba.core import config, types
from numpy.typing import NDArray

from autodrive.base.arrays import Floats
from autodrive.base.errors import EngineError
from autodrive.base.installation import mujoco_error, mujoco_fix
from autodrive.base.jit import inlined, resolved
from autodrive.physics.model import BOX, Model, ShapeTable
from autodrive.physics.near import AHEAD, Slots, fill, forget, hold_near, slot_count
from autodrive.physics.state import State

if _error := mujoco_error():
    raise EngineError(f"{_error}. Run:  {mujoco_fix()}")

import mujoco  # after the check of its installation

_log = mujoco.MjLogConfig.get()
_log.logto_console = _log.logto_file = False  # `has_diverged` finds its warnings; it would write MUJOCO_LOG.TXT
_log.set()

VERSION: str = mujoco.mj_versionString()
"""Version of MuJoCo, for example "4.0.1"."""


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


class ContactLayout(NamedTuple):
    """Offsets in bytes: from one contact to the next, and within a contact (mjContact) to its fields."""

    stride: int
    position: int
    geoms: int
    axes: int
    distance: int
    friction: int
    """The coefficients of the two tangential directions are the first of five."""
    cone: int
    """The coefficient of the regularised cone (mu)."""
    row: int
    """Number of the first row of the contact in the constraints: along the normal, then along the two other axes; -1:
    none, because the two solids do not touch (efc_address)."""


class Views(NamedTuple):
    """Memory of the engine that compiled code reads and writes."""

    model: int
    """Address of mjModel."""
    data: int
    """Address of mjData."""
    mass: Floats
    """Mass of each of the engine's bodies [kg], shape (n_body,)."""
    inertia: Floats
    """About the principal axes of each of these bodies [kg m^2], shape (n, 3)."""
    qpos: Floats
    """Poses of the bodies, as `State.qpos`; `qvel`, `warmstart` and `asleep` are as in the State, too."""
    qvel: Floats
    warmstart: Floats
    asleep: NDArray[np.int32]
    applied: Floats
    """Forces and torques on the bodies, as `Scratch.applied`."""
    acceleration: Floats
    """Accelerations of the bodies, as is `smooth_acceleration`, which is without constraints, shape (6 n_body,)."""
    smooth_acceleration: Floats
    contact_count: NDArray[np.int32]
    """Current number of contacts, shape (1,)."""
    contacts: NDArray[np.int64]
    """Current address of the first contact, shape (1,)."""
    references: NDArray[np.int64]
    """Current address of the acceleration that each row of the constraints asks for (efc_aref), shape (1,)."""
    warnings: NDArray[np.int32]
    """Number of diverged states, for each kind of warning."""
    slots: Slots
    """Slots of the fixed shapes near the bodies."""
    timestep: Floats
    """Length of a step of the engine [s], shape (1,)."""
    friction: Floats
    """Friction coefficient of each geom, in the first column, shape (n_geom, 3)."""
    gap: Floats
    """Distance of each geom [m] within which the engine lists a contact that has no force yet, shape (n_geom,)."""
    body_gap: Floats
    """Largest `gap` of each of the engine's bodies [m], shape (n_body,)."""
    contact_layout: ContactLayout


FLOOR = 1
"""Collision class (contype) of the floor."""


class Geom(NamedTuple):
    """A collider of a movable body."""

    number: int
    name: str
    kind: int
    size: Floats
    position: Floats
    """Centre in the frame of the body [m]."""
    orientation: Floats
    """Quaternion wxyz, body from collider."""
    bounding_radius: float
    is_stopped_by_floor: bool
    body: int
    qpos: int
    """Index of its body's pose in qpos."""
    dof: int
    """Index of its body's velocity in qvel."""


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
        forget(views.slots)
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
    if hold_near(model.shapes, state.qpos, views.slots):
        is_loaded = False
    if not is_loaded:
        is_any_asleep = False
        for b in range(state.asleep.shape[0]):
            is_any_asleep = is_any_asleep or state.asleep[b] >= 0.0
            views.asleep[b] = AWAKE
        mj_update_sleep(views.model, views.data)
        if is_any_asleep:
            mj_position(views.model, views.data)  # those bodies are computed as well, once
        for b in range(state.asleep.shape[0]):
            views.asleep[b] = int(state.asleep[b])
        mj_update_sleep(views.model, views.data)
        look_ahead(model, state, views)
        mj_step1(views.model, views.data)
    for b in range(state.asleep.shape[0]):
        if views.asleep[b] >= 0:  # what a body was doing before it fell asleep is forgotten
            for k in range(6 * b, 6 * b + 6):
                views.warmstart[k] = views.acceleration[k] = views.smooth_acceleration[k] = 0.0


@inlined
def look_ahead(model: Model, state: State, views: Views) -> None:
    """Lets the engine list, before its next step, what each body can touch during it."""
    shapes = model.shapes
    first = views.gap.shape[0] - shapes.kind.shape[0]  # geoms of movable bodies are the last ones
    for b in range(views.body_gap.shape[0]):
        views.body_gap[b] = 0.0
    for s in range(shapes.n_fixed, shapes.kind.shape[0]):
        dof, size, offset = shapes.dof[s], shapes.bounding_radius[s], shapes.position[s]
        vx, vy, vz = state.qvel[dof], state.qvel[dof + 1], state.qvel[dof + 2]
        wx, wy, wz = state.qvel[dof + 3], state.qvel[dof + 4], state.qvel[dof + 5]
        arm = size + sqrt(offset[0] * offset[0] + offset[1] * offset[1] + offset[2] * offset[2])
        speed = sqrt(vx * vx + vy * vy + vz * vz) + arm * sqrt(wx * wx + wy * wy + wz * wz)
        gap = min(AHEAD, model.dt * speed)
        views.gap[first + s] = gap
        body = 1 + dof // 6
        views.body_gap[body] = max(views.body_gap[body], gap)


@inlined
def has_diverged(views: Views) -> bool:
    """Whether the engine has warned of a diverged state since `Engine.forget_warnings`."""
    return views.warnings[0] + views.warnings[1] + views.warnings[2] > 0


class Engine:
    """Rigid bodies and contacts. Movable bodies are free bodies: 7 numbers in qpos and 6 in qvel each."""

    def __init__(self, mjcf: str, fixed: ShapeTable) -> None:
        """`mjcf`: the floor and the movable bodies; `fixed`: all other shapes.

        Raises `EngineError` for bodies that MuJoCo refuses, such as hundreds of boxes at the same place.
        """
        try:
            self.model = with_slots(mujoco.MjSpec.from_string(mjcf), fixed)
            if VERSION == "4.0.0":  # its solver diverges with sparse Jacobians (google-deepmind/mujoco issue 3767)
                self.model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
            self._start(fixed)
        except (ValueError, mujoco.FatalError) as error:
            raise EngineError(f"MuJoCo cannot simulate these bodies: {' '.join(str(error).split())}") from None
        columns = fixed.kind, fixed.size, fixed.position, fixed.rotation
        shapes = b"".join(column.tobytes() for column in columns)
        self.identity = hashlib.sha256(f"{VERSION} {mjcf}".encode() + shapes).hexdigest()
        """Identity of the model of this engine: engines with the same one can load the data that the other has
        saved."""

    def copy(self) -> Engine:
        """Another engine for the same bodies, at the start; two threads can use the two at once."""
        other = copy(self)
        other.model = copy(self.model)
        other._start(self._fixed)
        return other

    def _start(self, fixed: ShapeTable) -> None:
        self._fixed = fixed
        self.data = mujoco.MjData(self.model)
        self._slots = _empty_slots(self.model, self.data, len(fixed.kind))
        self._fill = resolved(fill, fixed, self.data.qpos, self._slots)
        self._forward()

    def _forward(self) -> None:
        """Brings all that depends on positions and velocities up to date."""
        if len(self._slots.shape):
            self._fill(self._fixed, self.data.qpos, self._slots)
        mujoco.mj_forward(self.model, self.data)

    def body(self, name: str) -> tuple[int, int, int]:
        """Number of a free body, and its indices in qpos and qvel."""
        body = self.model.body(name)
        joint = self.model.joint(int(body.jntadr[0]))
        return int(body.id), int(joint.qposadr[0]), int(joint.dofadr[0])

    def geoms(self) -> list[Geom]:
        """The colliders of all movable bodies."""
        geoms = []
        for i in range(1 + len(self._slots.shape), self.model.ngeom):
            body = int(self.model.geom_bodyid[i])
            joint = int(self.model.body_jntadr[body])
            geoms.append(
                Geom(
                    number=i,
                    name=self.model.geom(i).name,
                    kind=int(self.model.geom_type[i]),
                    size=self.model.geom_size[i].copy(),
                    position=self.model.geom_pos[i].copy(),
                    orientation=self.model.geom_quat[i].copy(),
                    bounding_radius=float(self.model.geom_rbound[i]),
                    is_stopped_by_floor=bool(self.model.geom_conaffinity[i] & FLOOR),
                    body=body,
                    qpos=int(self.model.jnt_qposadr[joint]),
                    dof=int(self.model.jnt_dofadr[joint]),
                )
            )
        return geoms

    def overlapping(self, qpos: Floats | None = None, depth: float = 0.001) -> list[tuple[int, int]]:
        """Pairs of solids that overlap by more than `depth` [m]: now, or if the bodies were placed at `qpos`.

        Solid 0 is the floor, solid 1 + s the shape s of the Model.
        """
        if qpos is not None:
            self.data.tree_asleep[:] = AWAKE
            _library.mj_updateSleep(*(ctypes.c_void_p(owner._address) for owner in (self.model, self.data)))
            self.data.qpos[:] = qpos
            self._forward()
        if self.data.ncon == 0:
            return []
        contact = self.data.contact
        solids = self._slots.solid[contact.geom[contact.dist < -depth]].tolist()
        return [(a, b) for a, b in solids]

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
            slots=self._slots,
            contact_count=_memory(data._address + layout.contact_count, ctypes.c_int32),
            contacts=_memory(data._address + layout.contacts, ctypes.c_int64),
            references=_memory(data._address + layout.references, ctypes.c_int64),
            warnings=data.warning.number[_BAD],
            timestep=_timestep(self.model),
            friction=self.model.geom_friction,
            gap=self.model.geom_gap,
            body_gap=self.model.body_margin,
            contact_layout=layout.contact,
        )

    def forget_warnings(self) -> None:
        """Forget that the state has diverged."""
        self.data.warning.number[_BAD] = 0


def with_slots(spec: mujoco.MjSpec, fixed: ShapeTable) -> mujoco.MjModel:
    """The model, with as many slots after the floor as its bodies need."""
    for _ in range(slot_count(fixed, _reach(spec.compile()))):
        slot = spec.worldbody.add_geom(spec.find_default("static"), type=BOX, size=[1.0, 1.0, 1.0])
        slot.friction = spec.worldbody.first_geom().friction
    return spec.compile()


def _reach(model: mujoco.MjModel) -> Floats:
    """Distance of the farthest point of each body from its origin [m], as `Slots.reach`."""
    reach = np.zeros(model.nbody)
    np.maximum.at(reach, model.geom_bodyid, np.linalg.norm(model.geom_pos, axis=1) + model.geom_rbound)
    return reach[1:]


def _empty_slots(model: mujoco.MjModel, data: mujoco.MjData, n_fixed: int) -> Slots:
    count = int(model.body_geomnum[0]) - 1
    solid = np.arange(model.ngeom, dtype=np.int64)
    solid[1 + count :] += n_fixed - count
    slots = Slots(
        shape=np.zeros(count, np.int64),
        solid=solid,
        reach=_reach(model),
        filled_at=np.zeros((model.nbody - 1, 3)),
        nearby=np.zeros(n_fixed, np.int64),
        kind=model.geom_type,
        size=model.geom_size,
        bounding_radius=model.geom_rbound,
        box=model.geom_aabb,
        position=data.geom_xpos,
        rotation=data.geom_xmat,
        tree_children=model.bvh_child,
        tree_geom=model.bvh_nodeid,
        tree_box=model.bvh_aabb,
    )
    forget(slots)
    return slots


_BAD = slice(int(mujoco.mjtWarning.mjWARN_BADQPOS), int(mujoco.mjtWarning.mjWARN_BADQACC) + 1)
"""Warnings after which MuJoCo resets a diverged state."""


class _Layout(NamedTuple):
    """Offsets in bytes of three fields of mjData, and within mjContact."""

    contact_count: int
    contacts: int
    references: int
    contact: ContactLayout


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
        offsets = set((4 * np.flatnonzero(numbers == data.ncon)).tolist())
        counts = offsets & counts if counts else offsets
    contact = data.contact
    start = contact.dist.ctypes.data
    pointers: dict[int, int] = {}  # to its last offset: the arena starts at the same address as the contacts
    offset = numbers_end
    while (value := ctypes.c_int64.from_address(data._address + offset).value) != data.efc_aref.ctypes.data:
        pointers[value] = offset
        offset += 8
    if len(counts) != 1 or start not in pointers:
        raise EngineError(f"MuJoCo {VERSION} stores its contacts in an unknown layout. Run:  {mujoco_fix()}")
    return _Layout(
        contact_count=counts.pop(),
        contacts=pointers[start],
        references=offset,
        contact=ContactLayout(
            stride=contact.dist.strides[0],
            position=contact.pos.ctypes.data - start,
            geoms=contact.geom.ctypes.data - start,
            axes=contact.frame.ctypes.data - start,
            distance=0,
            friction=contact.friction.ctypes.data - start,
            cone=contact.mu.ctypes.data - start,
            row=contact.efc_address.ctypes.data - start,
        ),
    )


def _memory(address: int, kind: Any) -> NDArray[Any]:
    return np.ctypeslib.as_array((kind * 1).from_address(address))


def _timestep(model: mujoco.MjModel) -> Floats:
    """View of the length of a step, which is at the start of the options; their gravity has an address."""
    address, length = model.opt.gravity.ctypes.data, model.opt.timestep
    model.opt.timestep = mark = 0.123456789
    for _ in range(16):
        address -= 8
        if ctypes.c_double.from_address(address).value == mark:
            model.opt.timestep = length
            return _memory(address, ctypes.c_double)
    raise EngineError(f"MuJoCo {VERSION} stores its options in an unknown layout. Run:  {mujoco_fix()}")
