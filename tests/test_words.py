"""Variables are named after what they hold, a class name has one meaning, and a docstring is understood alone."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
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
    faults: list[str] = []
    kept: set[tuple[str, str]] = set()
    for file, tree in trees().items():
        names = vague_names(tree)
        kept |= {(file, name) for name in names} & KEPT_VARIABLES.keys()
        faults += [f"{file}: {name}" for name in dict.fromkeys(names) if (file, name) not in KEPT_VARIABLES]
        faults += [f"{file}: {text}" for text in leaning_docstrings(tree)]
    assert faults == []
    assert kept == KEPT_VARIABLES.keys()


def test_a_class_name_has_one_meaning() -> None:
    places: defaultdict[str, list[str]] = defaultdict(list)
    for file, tree in trees().items():
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                places[node.name.lstrip("_")].append(file)
    several = {name: files for name, files in places.items() if len(files) > 1}
    assert several.keys() == KEPT_CLASSES.keys(), several
