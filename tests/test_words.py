"""Variables are named after what they hold, a class name has one meaning, and a docstring is understood alone."""

from __future__ import annotations

import ast
import re
from collections import Counter, defaultdict
from collections.abc import Iterator

import pytest

from tests.support.layers import PACKAGE, name_of

VAGUE = re.compile(r"_*(?:ones?|found|of|its|theirs?|given|it|items?|things?|what|which|those)_*")
"""Names of variables, arguments and attributes that do not say what they hold."""

LEANING = re.compile(
    r"(?:After|Again|Also|And|As|At|Before|Between|Both|But|By|Ditto|Else|For|From|Here|If|In|Instead|It|Its|Like"
    r"|Likewise|None|Not|Of|On|Only|Or|Otherwise|See|Similarly|So|Such|Than|That|The same|Their|Theirs|There|These|They"
    r"|This|Those|To|Too|Until|Whose|With|Without)\b|.*\b[Ll]ikewise\b",
    re.DOTALL,
)
"""A docstring that begins so has no subject: it can be understood only together with its neighbours."""

KEPT_VARIABLES = {("cli/new.py", "what"): "the argument WHAT of `autodrive new`"}
"""File and name -> why it is kept."""

KEPT_CLASSES = {
    "Drive": "the message, and the public drive of an identification",
    "NigelVecEnv": "the classes for two libraries, which users import from the module of theirs",
    "SensorView": "the message, and the public view of a sensor of the user",
    "Step": "the message, and the public step of an own task",
}
"""Class name with several meanings -> why: names of messages are names of the protocol."""

CLASSES_NOT_YET = frozenset(
    ("Change", "Channel", "Conditions", "Contacts", "Drawn", "Moment", "Outcome", "Plan", "Race", "World")
)
"""Class names with several meanings of which `world` or `experiments/envs` has one that gets another name."""

NOT_YET: dict[str, tuple[int, int]] = {
    "experiments/envs/adapters/pufferlib.py": (0, 1),
    "experiments/envs/adapters/rllib.py": (0, 1),
    "experiments/envs/adapters/rsl_rl.py": (0, 1),
    "experiments/envs/adapters/stable_baselines3.py": (1, 3),
    "experiments/envs/conditions.py": (9, 5),
    "experiments/envs/crossing.py": (1, 10),
    "experiments/envs/crossing_env.py": (0, 1),
    "experiments/envs/driving_env.py": (0, 1),
    "experiments/envs/driving_vector_env.py": (5, 4),
    "experiments/envs/duel.py": (0, 5),
    "experiments/envs/duel_env.py": (2, 3),
    "experiments/envs/episodes.py": (3, 3),
    "experiments/envs/lane_keeping.py": (2, 7),
    "experiments/envs/navigation.py": (0, 3),
    "experiments/envs/own_rules.py": (5, 2),
    "experiments/envs/parallel_env.py": (0, 1),
    "experiments/envs/parking.py": (0, 3),
    "experiments/envs/path.py": (1, 0),
    "experiments/envs/race_env.py": (0, 2),
    "experiments/envs/race_tracks.py": (6, 9),
    "experiments/envs/rendered_world.py": (1, 3),
    "experiments/envs/roboracer_env.py": (1, 2),
    "experiments/envs/settings.py": (6, 12),
    "experiments/envs/several_cars.py": (2, 2),
    "experiments/envs/shown.py": (0, 3),
    "experiments/envs/single_env.py": (0, 1),
    "experiments/envs/task.py": (1, 6),
    "experiments/envs/time_trial.py": (2, 6),
    "world/batch/batch_world.py": (19, 4),
    "world/batch_camera.py": (1, 0),
    "world/columns.py": (1, 3),
    "world/compile.py": (9, 4),
    "world/conditions.py": (1, 2),
    "world/contacts.py": (4, 0),
    "world/controls.py": (2, 1),
    "world/editing/closing.py": (11, 0),
    "world/editing/editor.py": (4, 1),
    "world/editing/map_advice.py": (1, 0),
    "world/editing/map_edits.py": (8, 1),
    "world/editing/map_scene.py": (8, 0),
    "world/editing/track_edits.py": (3, 1),
    "world/factory.py": (0, 1),
    "world/placement.py": (7, 1),
    "world/poses.py": (0, 4),
    "world/racing/contacts.py": (0, 1),
    "world/racing/picture.py": (0, 3),
    "world/racing/race.py": (0, 3),
    "world/racing/results.py": (3, 4),
    "world/readings.py": (0, 7),
    "world/requests.py": (0, 1),
    "world/rules/collisions.py": (0, 1),
    "world/rules/daylight.py": (0, 2),
    "world/rules/lights.py": (0, 4),
    "world/rules/radio.py": (0, 2),
    "world/rules/rules.py": (0, 1),
    "world/rules/stop_lines.py": (0, 3),
    "world/rules/traffic/drive.py": (2, 14),
    "world/rules/traffic/rule.py": (0, 1),
    "world/rules/traffic/start.py": (5, 3),
    "world/rules/traffic/traffic.py": (6, 0),
    "world/scene_files.py": (1, 2),
    "world/simulation/checks.py": (1, 0),
    "world/simulation/simulation.py": (1, 3),
    "world/snapshot.py": (0, 1),
    "world/weather_numbers.py": (0, 1),
    "world/world.py": (0, 6),
}
"""File -> vague variables and leaning docstrings that it still has. These numbers only fall."""


def trees() -> dict[str, ast.Module]:
    """The syntax tree of each module of the package, by its path in the package."""
    return {name_of(path): ast.parse(path.read_text(encoding="utf-8")) for path in sorted(PACKAGE.rglob("*.py"))}


def bound_names(tree: ast.AST) -> Iterator[str]:
    """The name at each place where a variable, an argument or an attribute gets a value."""
    for node in ast.walk(tree):
        match node:
            case ast.Name(id=name, ctx=ast.Store()) | ast.arg(arg=name) | ast.Attribute(attr=name, ctx=ast.Store()):
                yield name
            case ast.ExceptHandler(name=str(name)) | ast.MatchAs(name=str(name)) | ast.MatchStar(name=str(name)):
                yield name


def vague_names(tree: ast.AST) -> list[str]:
    """The vague ones of the bound names, with or without underscores."""
    return [name for name in bound_names(tree) if VAGUE.fullmatch(name)]


def docstrings(tree: ast.AST) -> Iterator[str]:
    """The texts that describe a module, a class, a function, or the variable in the line before."""
    for node in ast.walk(tree):
        for statement in getattr(node, "body", []) if not isinstance(node, ast.Lambda | ast.IfExp) else []:
            match statement:
                case ast.Expr(value=ast.Constant(value=str(text))):
                    yield text


def leaning_docstrings(tree: ast.AST) -> list[str]:
    """The first line of each docstring that leans on its neighbours."""
    return [text.partition("\n")[0] for text in docstrings(tree) if LEANING.match(text)]


@pytest.mark.parametrize(
    ("code", "count"),
    [
        ("one = 1", 1),
        ("for one, _ in pairs: pass", 1),
        ("[one.name for one in sensors]", 1),
        ("def f(of, *, given): pass", 2),
        ("with a as found: pass", 1),
        ("if (found := search()): pass", 1),
        ("self._found = 1", 1),
        ("try: pass\nexcept E as its: pass", 1),
        ("match x:\n    case {'a': one}: pass", 1),
        ("sensor = found(one.of, given=its)", 0),
    ],
)
def test_vague_names_are_counted_where_they_get_a_value(code: str, count: int) -> None:
    assert len(vague_names(ast.parse(code))) == count


@pytest.mark.parametrize(
    "text", ["Likewise.", "Of the radio.", "Its name.", "As `f`.", "The same.", "Speed, likewise."]
)
def test_a_docstring_without_subject_leans_on_its_neighbours(text: str) -> None:
    assert leaning_docstrings(ast.parse(f'class A:\n    b: int\n    """{text}"""\n    c = 1\n')) == [text]
    assert leaning_docstrings(ast.parse(f'def f():\n    """{text}"""\n')) == [text]


@pytest.mark.parametrize("text", ["Ofen.", "Speed of the car [m/s].", "Assets by name.", "The samples. As before."])
def test_a_docstring_with_a_subject_stands_alone(text: str) -> None:
    assert leaning_docstrings(ast.parse(f'"""{text}"""')) == []


def test_variables_are_named_after_what_they_hold_and_docstrings_stand_alone() -> None:
    counts: dict[str, tuple[int, int]] = {}
    faults: list[str] = []
    kept: set[tuple[str, str]] = set()
    for file, tree in trees().items():
        names = [name for name in vague_names(tree) if (file, name) not in KEPT_VARIABLES]
        kept |= {(file, name) for name in vague_names(tree)} & KEPT_VARIABLES.keys()
        texts = leaning_docstrings(tree)
        if names or texts:
            counts[file] = len(names), len(texts)
        if counts.get(file, (0, 0)) > NOT_YET.get(file, (0, 0)):
            faults += [f"{file}: {text}" for text in (*dict(Counter(names)), *texts)]
    assert kept == KEPT_VARIABLES.keys()
    assert counts == NOT_YET, "\n".join(faults)


def test_a_class_name_has_one_meaning() -> None:
    places: defaultdict[str, list[str]] = defaultdict(list)
    for file, tree in trees().items():
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                places[node.name.lstrip("_")].append(file)
    several = {name: files for name, files in places.items() if len(files) > 1}
    assert several.keys() == KEPT_CLASSES.keys() | CLASSES_NOT_YET, several
