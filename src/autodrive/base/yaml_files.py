"""Reads YAML files as Specs, with the line of each value for error messages."""

from __future__ import annotations

import functools
import re
from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import ValidationError
from yaml.constructor import ConstructorError

from autodrive.base.errors import SpecError
from autodrive.base.readable import readable as readable_file
from autodrive.base.specs import MAX_ERRORS, Key, Spec, messages, place_text, short, with_line

MAX_BYTES = 2**20
"""Largest size of a file."""
MAX_NODES = 50_000
"""Largest number of keys, values, lists and mappings in a file; an alias counts as often as it is used."""
MAX_DEPTH = 32
"""Largest number of lists and mappings inside each other."""
MAX_CHARACTERS = 10_000
"""Longest key or value."""
T = TypeVar("T", bound=Spec)

_SafeLoader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


class _PlainLoader(_SafeLoader):
    """Loads plain YAML; a date and a time are texts. The numbers are checked by `_number`."""


_PlainLoader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in resolvers if not tag.endswith(":timestamp")]
    for first, resolvers in _SafeLoader.yaml_implicit_resolvers.items()
}


def _number(loader: Any, node: yaml.ScalarNode) -> int | float | str:
    """A number; the constructors of PyYAML raise errors without a place for some texts, such as '0b_'.

    18:30 is a time and stays a text; YAML 1.1 reads it as a number to the base 60.
    """
    if ":" in node.value:
        return node.value
    is_whole = node.tag.endswith(":int")
    if is_whole and re.fullmatch(r"[-+]?0\d+", node.value):  # YAML 1.1 reads 010 as 8, YAML 1.2 as 10
        problem = f"'{short(node.value)}' would be an octal number: write {int(node.value)}"
        raise ConstructorError(None, None, problem, node.start_mark)
    try:
        if len(node.value) <= 100:
            return loader.construct_yaml_int(node) if is_whole else loader.construct_yaml_float(node)
    except (ValueError, OverflowError):
        pass
    raise ConstructorError(None, None, f"'{short(node.value)}' is not a number", node.start_mark)


_PlainLoader.add_constructor("tag:yaml.org,2002:int", _number)
_PlainLoader.add_constructor("tag:yaml.org,2002:float", _number)


class Source:
    """The YAML text that a Spec comes from, for error messages with a place and a line; without a text, no lines."""

    def __init__(self, text: str = "", path: str = "") -> None:
        """Raises `SpecError` if the text is not YAML, has tags, or is beyond the limits, such as `MAX_NODES`."""
        self.text = text
        self.path = path
        if len(text) > MAX_BYTES:
            raise SpecError([f"a file must have at most {MAX_BYTES // 2**20} MiB"], path)
        try:
            _check_limits(text)
            loader = _PlainLoader(text)
            try:
                self._node = loader.get_single_node()
                _make_keys_texts(self._node)
                self.duplicate_keys = _duplicate_keys(self._node)
                """An error for each."""
                self.tree: Any = None if self._node is None else loader.construct_document(self._node)
            finally:
                loader.dispose()
        except (yaml.YAMLError, UnicodeError) as error:
            raise SpecError([_yaml_error(error, text)], path) from None

    @functools.cached_property
    def lines(self) -> dict[Key, int]:
        """Line (from 1) of each key and entry."""
        line_of: dict[Key, int] = {}

        def walk(node: yaml.Node | None, key: Key) -> None:
            inner: dict[str, tuple[yaml.Node, yaml.Node]] = {}
            if isinstance(node, yaml.MappingNode):
                inner = {_text_of(key_node): (key_node, value) for key_node, value in node.value}
            elif isinstance(node, yaml.SequenceNode):
                inner = {str(i): (entry, entry) for i, entry in enumerate(node.value)}
            for part, (start, value) in inner.items():
                line_of[*key, part] = start.start_mark.line + 1
                walk(value, (*key, part))

        walk(self._node, ())
        return line_of

    def at(self, *location: str | int) -> str:
        """Where a value is: 'vehicles.V1.x (line 4)'."""
        return with_line(place_text(*location), location, self.lines)


def source(path: Path) -> Source:
    """The text of a file. Raises `SpecError` if it cannot be read or is not YAML in UTF-8, as `Source`."""
    data = b""
    try:
        with readable_file(path).open("rb") as file:
            data = file.read(MAX_BYTES + 1)
        if len(data) > MAX_BYTES:
            raise SpecError([f"a file must have at most {MAX_BYTES // 2**20} MiB"], str(path))
        text = data.decode("utf-8")
    except OSError as error:
        raise SpecError([f"cannot be read: {error.strerror or error}"], str(path)) from None
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        problem = f"line {line}: a file must be text in UTF-8; it has the byte 0x{data[error.start]:02x}"
        raise SpecError([problem], str(path)) from None
    return _source(text, str(path))


@functools.lru_cache(maxsize=8)
def _source(text: str, path: str) -> Source:
    """Kept, because a map or vehicle is read several times: by a check and by each World."""
    return Source(text, path)


def parse(text: str, spec: type[T], where: str = "<text>") -> T:
    """The checked Spec of a YAML text. Raises `SpecError` with all errors; `where` is the path shown in the message."""
    return checked_source(Source(text, where), spec)


def readable(source: Source, spec: type[T]) -> tuple[T | None, list[str]]:
    """The Spec of the valid parts of a text, and all errors; None if too little is valid.

    A faulty entry of a collection, such as one vehicle, is left out, or else the whole value of the key.
    """
    if not isinstance(source.tree, dict):
        content = "nothing" if source.tree is None else "a list" if isinstance(source.tree, list) else "a value"
        return None, [f"line 1: expected 'key: value' lines ({spec.__name__}), found {content}"]
    duplicates = source.duplicate_keys
    try:
        return spec.model_validate(source.tree), [*duplicates]
    except ValidationError as error:
        details = error.errors(include_url=False)
    errors = duplicates + messages(details[:MAX_ERRORS], spec, source.at)
    if len(details) > MAX_ERRORS:
        errors.append(f"and {len(details) - MAX_ERRORS} more errors")
    tree, emptied = dict(source.tree), {}
    faulty: dict[Any, set[Any]] = {}
    for key, *rest in (error["loc"] for error in details if error["loc"]):
        inner = source.tree.get(key)
        if rest and isinstance(inner, dict) and isinstance(inner.get(rest[0]), dict):
            faulty.setdefault(key, set()).add(rest[0])
        else:
            tree.pop(key, None)
    for key in faulty.keys() & tree.keys():
        tree[key] = {name: value for name, value in tree[key].items() if name not in faulty[key]}
        if not tree[key]:
            emptied[key] = tree.pop(key)
    try:
        return spec.model_validate(tree).model_copy(update=emptied), errors
    except ValidationError:
        return None, errors


def checked_source(source: Source, spec: type[T]) -> T:
    """The checked Spec of a text. Raises `SpecError` with all errors."""
    checked, errors = readable(source, spec)
    if errors or checked is None:
        raise SpecError(errors, source.path)
    return checked


def _check_limits(text: str) -> None:
    """Raises `ConstructorError` for a text with tags, too many or too deep nodes, or an alias inside its own anchor.

    Reads the events of the parser, which needs neither recursion nor memory for the size of what aliases make.
    """
    total = 0
    collections: list[tuple[str | None, list[int]]] = []
    """Anchor, nodes and depth of each open list or mapping."""
    anchors: dict[str, tuple[int, int]] = {}
    """Nodes and depth of each anchor that is complete."""
    for event in yaml.parse(text, Loader=_SafeLoader):
        problem = ""
        if isinstance(event, yaml.CollectionEndEvent):
            anchor, (nodes, depth) = collections.pop()
            size = (nodes + 1, depth + 1)
        elif isinstance(event, yaml.AliasEvent):
            anchor, size = None, anchors.get(event.anchor, (1, 1))
            if any(event.anchor == anchor for anchor, _ in collections):
                problem = f"the alias '*{event.anchor}' is inside its own anchor"
            total += size[0]
        elif isinstance(event, yaml.ScalarEvent | yaml.CollectionStartEvent):
            anchor, size = event.anchor, (1, 1)
            if event.tag is not None:
                problem = f"tags such as '{short(event.tag)}' are not supported; remove the tag"
            elif isinstance(event, yaml.ScalarEvent) and len(event.value) > MAX_CHARACTERS:
                problem = f"a key or value must have at most {MAX_CHARACTERS} characters"
            total += 1
        else:  # start and end of the stream and of documents
            continue
        if total > MAX_NODES:
            problem = f"a file must have at most {MAX_NODES} keys and values; each use of an alias counts"
        elif len(collections) + size[1] > MAX_DEPTH:
            problem = f"lists and mappings must be at most {MAX_DEPTH} deep inside each other"
        if problem:
            raise ConstructorError(None, None, problem, event.start_mark)
        if isinstance(event, yaml.CollectionStartEvent):
            anchors.pop(anchor or "", None)
            collections.append((anchor, [0, 0]))
            continue
        if anchor:
            anchors[anchor] = size
        if collections:
            enclosing = collections[-1][1]
            enclosing[0], enclosing[1] = enclosing[0] + size[0], max(enclosing[1], size[1])


_HINTS = (
    ("tab character", "; indent with spaces, not with a tab"),
    ("mapping values are not allowed", "; write 'key: value', with a space after the colon"),
    ("did not find expected key", "; indent all keys of a mapping by the same number of spaces"),
)
"""Part of a problem of PyYAML, and what would be right."""


def _yaml_error(error: Exception, text: str) -> str:
    """An error of PyYAML as 'invalid YAML (line n): what is wrong'."""
    mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
    if isinstance(error, yaml.MarkedYAMLError) and mark:
        problem = " ".join(part for part in (error.context, error.problem) if part)
        line = "".join(text.splitlines()[mark.line : mark.line + 1])
        hints = _HINTS[:1] if line.lstrip(" ").startswith("\t") else [hint for hint in _HINTS if hint[0] in problem]
        return f"invalid YAML (line {mark.line + 1}): {problem}{''.join(hint for _, hint in hints)}"
    position = getattr(error, "position", 0)
    line = text.encode("utf-8", "replace").count(b"\n", 0, position) + 1
    return f"invalid YAML (line {line}): {getattr(error, 'reason', None) or error}"


def _text_of(key: Any) -> str:
    """The key as it is in a location of pydantic."""
    return key.value if isinstance(key, yaml.ScalarNode) else ""


def _make_keys_texts(node: yaml.Node | None) -> None:
    """Change a node so that each key is the text that is written, as the names no, 1 and 010 are."""
    if isinstance(node, yaml.MappingNode):
        for key, value in node.value:
            if isinstance(key, yaml.ScalarNode) and not key.tag.endswith(":merge"):
                key.tag = "tag:yaml.org,2002:str"
            _make_keys_texts(value)
    elif isinstance(node, yaml.SequenceNode):
        for value in node.value:
            _make_keys_texts(value)


def _duplicate_keys(node: yaml.Node | None) -> list[str]:
    """An error for each duplicate key of a mapping (YAML silently keeps the last one)."""
    errors: list[str] = []
    if isinstance(node, yaml.MappingNode):
        seen: dict[str, int] = {}
        for key, value in node.value:
            line = key.start_mark.line + 1
            if isinstance(key, yaml.ScalarNode):
                if key.value in seen:
                    place = f"{short(key.value)} (line {line})"
                    errors.append(f"{place}: duplicate key, first defined in line {seen[key.value]}")
                seen.setdefault(key.value, line)
            errors += _duplicate_keys(value)
    elif isinstance(node, yaml.SequenceNode):
        for value in node.value:
            errors += _duplicate_keys(value)
    return errors
