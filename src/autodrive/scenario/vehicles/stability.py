"""Longest substep with which the springs and dampers of a vehicle are stable."""

from __future__ import annotations

import numpy as np

from autodrive.base.exact_fraction import whole_parts
from autodrive.scenario.vehicles.parameters import hold_spring
from autodrive.scenario.vehicles.spec import VehicleSpec

TOLERANCE = 1e-9
"""Tolerance of the spectral radius: without dampers it is 1."""


def is_stable(spec: VehicleSpec, substep: float) -> bool:
    """Whether a vehicle that stands on its wheels comes to rest with substeps of that length [s].

    The linear system of the chassis on its wheels, whose six velocities v and displacements q from rest a substep dt
    changes as the engine does (semi-implicit Euler): v' = v - dt M^-1 (K q + C v), q' = q + dt v'. It is stable if no
    eigenvalue of this map is outside the unit circle (Strogatz, Nonlinear Dynamics and Chaos, section 10.1).

    For springs alone the limit is closed: with the greatest eigenvalue a of M^-1 K, dt = 2 / sqrt(a). For one mode with
    a damper, whose M^-1 C has the eigenvalue b, it is a dt^2 + 2 b dt < 4 (Jury's criterion).
    """
    body, suspension = spec.body, spec.wheels.suspension
    damping = suspension.damping + suspension.stiffness * suspension.look_ahead
    hold_stiffness, hold_damping = hold_spring(spec, substep)
    stiffnesses, dampings = np.zeros((6, 6)), np.zeros((6, 6))
    for hub in spec.hubs:
        x, y, z = (a - b for a, b in zip(hub, body.center_of_mass, strict=True))
        z -= spec.wheels.radius
        # velocity of the contact point along x, y and z for the velocities and angular velocities of the chassis
        along = np.array([[1.0, 0.0, 0.0, 0.0, z, -y], [0.0, 1.0, 0.0, -z, 0.0, x], [0.0, 0.0, 1.0, y, -x, 0.0]])
        k = np.array([hold_stiffness, hold_stiffness, suspension.stiffness])
        c = np.array([hold_damping, hold_damping, damping])
        stiffnesses += along.T @ (k[:, None] * along)
        dampings += along.T @ (c[:, None] * along)
    change = -substep / np.array([body.mass] * 3 + [*body.inertia])[:, None] * np.hstack([stiffnesses, dampings])
    velocities = change + np.hstack([np.zeros((6, 6)), np.eye(6)])
    displacements = substep * velocities + np.hstack([np.eye(6), np.zeros((6, 6))])
    return bool(np.abs(np.linalg.eigvals(np.vstack([displacements, velocities]))).max() <= 1.0 + TOLERANCE)


def longest_substep(spec: VehicleSpec, tick: float, *, longest: float, shortest: float) -> float | None:
    """The longest stable substep [s] in these limits of which a tick is a whole number; None: there is none."""
    parts = whole_parts(tick, longest=longest, shortest=shortest)
    return next((part for part in parts if is_stable(spec, part)), None)


def greatest_damping(spec: VehicleSpec, substep: float) -> float | None:
    """The greatest stable damping of a wheel [N s/m] with substeps of that length [s]; None: the springs are too stiff.

    Two digits, rounded down.
    """

    def is_stable_with(damping: float) -> bool:
        suspension = spec.wheels.suspension.model_copy(update={"damping": damping})
        wheels = spec.wheels.model_copy(update={"suspension": suspension})
        return is_stable(spec.model_copy(update={"wheels": wheels}), substep)

    digits = [float(f"{k / 10:g}e{power}") for power in range(-2, 8) for k in range(10, 100)]
    return next((damping for damping in reversed(digits) if is_stable_with(damping)), None)
