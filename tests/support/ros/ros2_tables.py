"""Generates the tables of docs/ros2.md from the code:  python -m tests.support.ros.ros2_tables"""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

from autodrive.connect.ros import Config
from autodrive.connect.ros.topics import WORLD_TOPICS, change_topic
from tests.support.ros.ros1_tables import ROOT, node
from tests.support.tables import rewritten

DOCUMENT = Path(__file__).parents[3] / "docs" / "ros2.md"
PACKAGE = Path(__file__).parents[3] / "ros" / "ros2" / "autodrive_ros2" / "autodrive_ros2"

QOS = {
    "sensor": "reliable, 5",
    "state": "reliable, 10",
    "latched": "reliable, transient local, 1",
    "clock": "reliable, 1",
    "tf": "reliable, 100",
    "command": "reliable, 10",
    "league": "reliable, 1",
}

SCRIPT = """
import json
from autodrive_ros2.parameters import defaults
from autodrive_ros2.qos import QOS
from autodrive_ros2.services import SERVICES
kinds = {"RELIABLE": "reliable", "BEST_EFFORT": "best effort", "TRANSIENT_LOCAL": ", transient local", "VOLATILE": ""}
qos = {name: f"{kinds[q.reliability.name]}{kinds[q.durability.name]}, {q.depth}" for name, q in QOS.items()}
print(json.dumps([defaults(), SERVICES, qos]))
"""


def published() -> list[str]:
    """A row for each published topic."""
    rows = ["| topic | type | description | QoS (depth) |", "|---|---|---|---|"]
    known = {name: topic for name, topic in node().topics.items() if topic not in WORLD_TOPICS}
    lights = {name: topic for name, topic in node("devkit").topics.items() if "/tl_1/" in name}
    for topic in (*known.values(), *WORLD_TOPICS, *lights.values(), change_topic(Config(), 1)):
        name = topic.name.removeprefix(ROOT)
        text = f"{topic.text} (also `tl_2` and so on)" if "/tl_1/" in name else topic.text
        rows.append(f"| `{name}` | {topic.type} | {text} | {QOS[topic.qos]} |")
    return rows


def subscribed() -> list[str]:
    """A row for each subscribed topic."""
    rows = ["| topic | type | description |", "|---|---|---|"]
    ones = [*node().subscriptions.values()]
    ones += [one for one in node("devkit").subscriptions.values() if "/tl_1/" in one.name]
    return rows + [f"| `{one.name.removeprefix(ROOT)}` | {one.type} | {one.text} |" for one in ones]


def parameters(defaults: dict[str, tuple[object, str]]) -> list[str]:
    rows = ["| parameter | default | description |", "|---|---|---|"]
    for name, (value, text) in defaults.items():
        shown = json.dumps(value) if not isinstance(value, str) else f'"{value}"'
        rows.append(f"| `{name}` | `{shown}` | {text} |")
    return rows


def services(known: dict[str, tuple[str, str]]) -> list[str]:
    rows = ["| service | type of simulation_interfaces | description |", "|---|---|---|"]
    return rows + [f"| `{name}` | {kind} | {text} |" for name, (kind, text) in known.items()]


def tables(environment: dict[str, str]) -> dict[str, list[str]]:
    """All tables by name; the packages are sourced in the environment."""
    done = subprocess.run(["python", "-c", SCRIPT], env=environment, capture_output=True, text=True, check=True)
    defaults, known, qualities = json.loads(done.stdout)
    assert qualities == QOS
    return {
        "published": published(),
        "subscribed": subscribed(),
        "parameters": parameters(defaults),
        "services": services(known),
    }


if __name__ == "__main__":
    from tests.support.ros.ros2 import sourced

    DOCUMENT.write_text(rewritten(DOCUMENT.read_text(), tables(sourced())))
