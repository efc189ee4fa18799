"""The formulas of wheel and actuators, compiled by Numba from their plain Python source."""

from __future__ import annotations

import types
from typing import Any

from autodrive.base.jit import inlined
from autodrive.physics import wheel
from autodrive.physics.actuators import curve, drivetrain, steering


def _compiled(source: types.ModuleType) -> dict[str, Any]:
    """Every public function of a plain module, compiled; each calls the compiled versions of the others."""
    compiled: dict[str, Any] = {}
    for name, function in vars(source).items():
        if isinstance(function, types.FunctionType) and function.__module__ == source.__name__:
            namespace = {**vars(source), **compiled}
            compiled[name] = inlined(types.FunctionType(function.__code__, namespace, name))
    return compiled


_functions = {**_compiled(wheel), **_compiled(drivetrain), **_compiled(steering), **_compiled(curve)}

ackermann_angle = _functions["ackermann_angle"]
bounded_slip = _functions["bounded_slip"]
braked_spin = _functions["braked_spin"]
coasting_spin = _functions["coasting_spin"]
cornering_stiffness = _functions["cornering_stiffness"]
drive_level = _functions["drive_level"]
drive_target = _functions["drive_target"]
drive_torque_limit = _functions["drive_torque_limit"]
interpolated = _functions["interpolated"]
lagged_slip = _functions["lagged_slip"]
magic_stiffness = _functions["magic_stiffness"]
motor_torque = _functions["motor_torque"]
not_zero = _functions["not_zero"]
peak_friction = _functions["peak_friction"]
relaxed = _functions["relaxed"]
secant_stiffness = _functions["secant_stiffness"]
shaft_spin = _functions["shaft_spin"]
slip_angle = _functions["slip_angle"]
slip_ratio_denominator = _functions["slip_ratio_denominator"]
steered = _functions["steered"]
suspension_force = _functions["suspension_force"]
transferred_torque = _functions["transferred_torque"]
tyre_force = _functions["tyre_force"]
