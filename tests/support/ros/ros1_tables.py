"""Generates the tables of docs/ros1.md from the code:  python -m tests.support.ros.ros1_tables"""

from __future__ import annotations

import ast
import dataclasses
import inspect
from pathlib import Path

from autodrive.connect.ros import Bridge, Config
from autodrive.connect.ros.topics import WORLD_TOPICS, change_topic
from tests.support.ros.recorder import Recorder
from tests.support.tables import rewritten

DOCUMENT = Path(__file__).parents[3] / "docs" / "ros1.md"
ROOT = "autodrive/nigel_1/"


def node(mode: str = "direct") -> Recorder:
    one = Recorder()
    Bridge(Config(mode=mode), one)  # type: ignore[arg-type]
    return one


def published() -> list[str]:
    """A row for each published topic."""
    known = [topic for topic in node().topics.values() if topic not in WORLD_TOPICS]
    lights = [topic for topic in node("devkit").topics.values() if "/tl_" in topic.name]
    lights.append(change_topic(Config(), 1))
    rows = [f"| `{t.name.removeprefix(ROOT)}` | {t.type} | {t.text} |" for t in (*known, *WORLD_TOPICS, *lights)]
    return ["| topic | type | description |", "|---|---|---|", *rows]


def subscribed() -> list[str]:
    """A row for each subscribed topic."""
    lights = [one for one in node("devkit").subscriptions.values() if "/tl_" in one.name]
    ones = (*node().subscriptions.values(), *lights)
    return ["| topic | type | description |", "|---|---|---|"] + [
        f"| `{one.name.removeprefix(ROOT)}` | {one.type} | {one.text} |" for one in ones
    ]


def parameters() -> list[str]:
    """A row for each field of Config, with its docstring."""
    (body,) = ast.parse(inspect.getsource(Config)).body
    assert isinstance(body, ast.ClassDef)
    texts = {
        before.target.id: ast.literal_eval(after.value)
        for before, after in zip(body.body, body.body[1:], strict=False)
        if isinstance(before, ast.AnnAssign) and isinstance(before.target, ast.Name) and isinstance(after, ast.Expr)
    }
    rows = ["| parameter | default | description |", "|---|---|---|"]
    for field in dataclasses.fields(Config):
        shown = str(field.default).lower() if isinstance(field.default, bool) else field.default
        if field.name != "robot_description":  # a global parameter in ROS 1
            default = f"`{shown}`" if shown != "" else ""
            rows.append(f"| `{field.name}` | {default} | {' '.join(texts[field.name].split())} |")
    return rows


def tables() -> dict[str, list[str]]:
    """All tables by name."""
    return {"published": published(), "subscribed": subscribed(), "parameters": parameters()}


if __name__ == "__main__":
    DOCUMENT.write_text(rewritten(DOCUMENT.read_text(), tables()))
