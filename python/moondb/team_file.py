"""Reads the team's name and id from a team file, as the programs in C++ read it. Needs PyYAML (Debian: python3-yaml)."""
import os
import pathlib
import re
from typing import Any, List, NoReturn, Tuple, Union

PathLike = Union[str, "os.PathLike[str]"]

RULES = {"team": re.compile(r"[a-z0-9_-]{1,32}\Z"), "team_id": re.compile(r"[0-9a-f]{32}\Z")}
NOTHING = ("", "~", "null", "Null", "NULL")
BYTES_MAX = 1_000_000


class TeamFileError(ValueError):
    """The team file cannot be used; the text begins with the file, the line and the column."""


def team_of(team_file: PathLike) -> Tuple[str, str]:
    """Returns the team's name and id. Raises TeamFileError for a file that is no YAML, or that lacks one of them. Run
    `moonctl config check` to check the other fields."""
    try:
        import yaml  # pylint: disable=import-outside-toplevel
    except ImportError as error:
        raise ImportError("reading a team file needs PyYAML (Debian: python3-yaml)") from error
    name = os.fspath(team_file)
    data = pathlib.Path(team_file).read_bytes()
    if len(data) > BYTES_MAX:
        _fail(name, None, "the file is larger than 1 MB")
    try:
        root = yaml.compose(_prepared(data), Loader=yaml.BaseLoader)
    except yaml.MarkedYAMLError as error:
        _fail(name, error.problem_mark, f"not YAML: {error.problem}")
    except yaml.YAMLError as error:
        _fail(name, None, f"not YAML: {error}")
    if not isinstance(root, yaml.MappingNode):
        _fail(name, None, "the file is empty" if root is None else "expected fields such as \"team: NAME\"")
    for node in _mappings(root, yaml):
        _refuse_duplicates(name, node)
    fields = {key.value: value for key, value in root.value}
    for field, rule in RULES.items():
        value = fields.get(field)
        is_missing = value is None or (getattr(value, "style", None) is None and value.value in NOTHING)
        if is_missing or not isinstance(value, yaml.ScalarNode):
            _fail(name, value.start_mark if value is not None else None, f"{field}: missing")
        if not rule.match(value.value):
            _fail(name, value.start_mark, f"{field}: invalid: \"{value.value}\"")
    return fields["team"].value, fields["team_id"].value


def _fail(name: str, mark: Any, text: str) -> NoReturn:
    line, column = (mark.line + 1, mark.column + 1) if mark is not None else (1, 1)
    raise TeamFileError(f"{name}:{line}:{column}: {text}") from None


def _prepared(data: bytes) -> str:
    """Returns the text with the characters replaced that yaml-cpp takes and PyYAML does not: tabs between words, control
    characters, and bytes that are no UTF-8. None of them can be in a name or an id."""
    is_utf16 = data[:2] in (b"\xff\xfe", b"\xfe\xff")
    text = data.decode("utf-16" if is_utf16 else "utf-8", "replace")
    if "\r" in text.replace("\r\n", ""):
        text = re.sub("\r(?!\n)", "?", text)  # A line does not end here.
    text = re.sub("[^\t\n\r\x20-\x7e\x85\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]", "?", text)
    if text.lstrip("\ufeff \t\r\n").startswith("{"):
        return text.replace("\t", " ")
    lines: List[str] = []
    for line in text.split("\n"):
        indent = re.match(r"[ \t]*", line).end()  # type: ignore[union-attr]
        is_blank = line[indent:].strip("\r") == "" or line[indent] == "#"
        lines.append(line.replace("\t", " ") if is_blank else line[:indent] + line[indent:].replace("\t", " "))
    return "\n".join(lines)


def _mappings(node: Any, yaml: Any) -> List[Any]:
    """Returns all mappings in the document, each once, although aliases may repeat them."""
    found, seen, waiting = [], set(), [node]
    while waiting:
        node = waiting.pop()
        if id(node) in seen:
            continue
        seen.add(id(node))
        if isinstance(node, yaml.MappingNode):
            found.append(node)
            waiting += [value for _, value in node.value]
        elif isinstance(node, yaml.SequenceNode):
            waiting += node.value
    return found


def _refuse_duplicates(name: str, mapping: Any) -> None:
    seen = set()
    for key, _ in mapping.value:
        if isinstance(key.value, str) and key.value in seen:
            _fail(name, key.start_mark, f"{key.value}: given twice")
        seen.add(str(key.value))
