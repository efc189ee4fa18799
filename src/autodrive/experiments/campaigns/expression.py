"""Pass criteria: expressions such as `lateral_error_rms < 0.05 and collisions == 0`. They are never executed."""

from __future__ import annotations

import ast
import math
import operator
import sys
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from autodrive.base.suggest import suggest

_ARITHMETIC: dict[type[ast.operator], Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}
_FUNCTIONS: dict[str, Callable[[list[float]], float]] = {
    "abs": lambda arguments: abs(arguments[0]),
    "min": min,
    "max": max,
}
_MARGINS: dict[type[ast.cmpop], Callable[[float, float], float]] = {
    ast.Lt: lambda a, b: b - a,
    ast.LtE: lambda a, b: b - a,
    ast.Gt: lambda a, b: a - b,
    ast.GtE: lambda a, b: a - b,
    ast.Eq: lambda a, b: -abs(a - b) if a != b else math.inf,
    ast.NotEq: lambda a, b: abs(a - b) if a != b else -math.inf,
}
_COMPARISONS: dict[type[ast.cmpop], Callable[[float, float], bool]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: lambda a, b: a != b and not (math.isnan(a) or math.isnan(b)),
}
MAX_LENGTH = 2000
"""Longest text of an expression."""


class Expression:
    """A condition on numbers by name: comparisons, `and`, `or`, `not`, `+ - * /`, `abs`, `min`, `max`.

    A comparison with a number that is missing (nan) is false.
    """

    def __init__(self, text: str, names: list[str]) -> None:
        """Raises `ValueError` for a text that is no such condition; `names`: known numbers."""
        if len(text) > MAX_LENGTH:
            raise ValueError(f"must have at most {MAX_LENGTH} characters")
        try:
            self._tree = ast.parse(text.strip(), mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            raise ValueError(f"'{text}' is not a condition such as 'collisions == 0 and distance > 3'") from None
        problems = list(_problems(self._tree, names, is_condition=True))
        if problems:
            raise ValueError("; ".join(problems))

    def holds(self, values: Mapping[str, float]) -> bool:
        """Whether the condition is true."""
        return _judged(self._tree, values)[0]

    def margin(self, values: Mapping[str, float]) -> float:
        """How far the condition is from changing: positive if it holds, negative if not, in the units of the numbers.

        The margin of `a < b` is b - a, that of `and` the least and that of `or` the greatest of its parts; an equality
        that holds has no limit (inf), and a number that is missing gives -inf.
        """
        return _judged(self._tree, values)[1]


def _problems(node: ast.expr, names: list[str], *, is_condition: bool) -> Iterator[str]:
    """What is not allowed in a part of an expression."""
    parts: list[ast.expr] = []
    match node:
        case ast.BoolOp(values=values) if is_condition:
            for value in values:
                yield from _problems(value, names, is_condition=True)
        case ast.UnaryOp(op=ast.Not(), operand=operand) if is_condition:
            yield from _problems(operand, names, is_condition=True)
        case ast.Compare(left=left, ops=ops, comparators=comparators) if is_condition:
            if any(type(op) not in _COMPARISONS for op in ops):
                yield f"'{ast.unparse(node)}': compare with <, <=, >, >=, == or !="
            parts = [left, *comparators]
        case _ if is_condition:
            yield f"'{ast.unparse(node)}' is not a condition; compare it with a number"
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _ARITHMETIC:
            parts = [left, right]
        case ast.UnaryOp(op=ast.USub() | ast.UAdd(), operand=operand):
            parts = [operand]
        case ast.Call(func=ast.Name(id=name), args=[_, *others] as parts, keywords=[]) if name in _FUNCTIONS:
            if name == "abs" and others:
                yield "abs has one number"
        case ast.Name(id=name):
            if name not in names:
                yield f"'{name}' is not a metric of this campaign. {suggest(name, names)}"
        case ast.Constant(value=int() | float() as value):
            if abs(value) > sys.float_info.max:
                yield f"'{ast.unparse(node)[:20]}...' is too large: numbers are at most {sys.float_info.max:.1e}"
        case _:
            yield f"'{ast.unparse(node)}' is not allowed; use metrics, numbers, + - * /, abs, min and max"
    for part in parts:
        yield from _problems(part, names, is_condition=False)


def _judged(node: Any, values: Mapping[str, float]) -> tuple[bool, float]:
    """Whether a condition is true, and its margin."""
    match node:
        case ast.BoolOp(op=op, values=parts):
            holds, margins = zip(*(_judged(part, values) for part in parts), strict=True)
            return (all(holds), min(margins)) if isinstance(op, ast.And) else (any(holds), max(margins))
        case ast.UnaryOp(operand=operand):
            holds, margin = _judged(operand, values)
            return not holds, -margin
        case _:
            numbers = [_number(part, values) for part in (node.left, *node.comparators)]
            compared = [*zip(node.ops, numbers[:-1], numbers[1:], strict=True)]
            margins = [_MARGINS[type(op)](a, b) for op, a, b in compared]
            margin = -math.inf if any(map(math.isnan, margins)) else min(margins)
            return all(_COMPARISONS[type(op)](a, b) for op, a, b in compared), margin


def _number(node: Any, values: Mapping[str, float]) -> float:
    match node:
        case ast.BinOp(left=left, op=op, right=right):
            try:
                return _ARITHMETIC[type(op)](_number(left, values), _number(right, values))
            except (ZeroDivisionError, OverflowError):
                return math.nan
        case ast.UnaryOp(op=op, operand=operand):
            return -_number(operand, values) if isinstance(op, ast.USub) else _number(operand, values)
        case ast.Call(func=ast.Name(id=name), args=arguments):
            numbers = [_number(argument, values) for argument in arguments]
            return math.nan if any(map(math.isnan, numbers)) else _FUNCTIONS[name](numbers)
        case ast.Name(id=name):
            return values[name]
        case _:
            return float(node.value)  # `_problems` refuses what is too large
