"""XML of robots' files: URDF and MJCF, read by Python's own parser, expat.

No other file is opened and no entity is resolved. Prefixes of simulators' tags need no
declaration. Comments are left out.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn, TypeVar
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from formulations.io.files import read_bytes, real_in
from nlp.errors import FileError, InputError, MissingLibraryError

# In bytes; 150 000 links take 30 MB, and robots that exist less than 1 MB.
LARGEST_FILE = 50_000_000
# Elements within elements, and characters of an attribute; more are refused.
_DEEPEST, _LONGEST = 256, 1_000_000
_XACRO = "plain URDF (run xacro on the file first)"
_Read = TypeVar("_Read")


def from_file(path: Path, parse: Callable[[bytes], _Read]) -> _Read:
    """Return what is parsed from a file's content; FileError, which names the file, if none."""
    content = read_bytes(path, most=LARGEST_FILE)
    try:
        return parse(content)
    except (MissingLibraryError, FileError):
        raise
    except InputError as error:
        where = f"{path}: {error.argument}"
        raise FileError(where, error.value, error.allowed) from None


def xml_root(content: bytes) -> Element:
    """Return the root of the XML; InputError if it is none, or declares entities."""
    if content.startswith(b"\x1f\x8b"):
        raise InputError("content", "compressed with gzip", "plain XML (unpack the file first)")
    builder, parser = TreeBuilder(), expat.ParserCreate()
    depth = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > _DEEPEST:
            raise InputError("content", "nested too deeply", f"at most {_DEEPEST} levels")
        if any(len(text) > _LONGEST for text in attributes.values()):
            allowed = f"attributes of at most {_LONGEST} characters"
            raise InputError("content", "with a text that is too long", allowed)
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    def entity(*_: object) -> NoReturn:
        raise InputError("content", "XML with <!ENTITY>", "XML without entities")

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.EntityDeclHandler = entity
    try:
        parser.Parse(content, True)
    except (expat.ExpatError, ValueError, LookupError) as error:  # the latter: of encodings
        if isinstance(error, InputError):
            raise
        raise InputError("content", "not XML", f"well-formed XML ({error})") from None
    return builder.close()


def is_urdf(content: bytes) -> bool:
    """Whether the text of a file is URDF by its root element."""
    try:
        return xml_root(content).tag == "robot"
    except InputError:
        return False


def attribute(element: Element | None, name: str, what: str) -> str:
    """Return an attribute that must be there; InputError, which says of what, if it is not."""
    value = None if element is None else element.get(name)
    if not value:
        raise InputError(what, f"without the attribute '{name}'", f"{what} with a {name}")
    return value


def numbers(
    element: Element | None, name: str, default: str, where: str, largest: float = math.inf
) -> list[float]:
    """Return the numbers of an attribute, as many as the default has.

    Raises
    ------
    InputError
        If there are more or fewer, or one is NaN or larger.
    """
    text = default if element is None else element.get(name, default)
    count = len(default.split())
    try:
        values = [real_in(part) for part in text.split()]
    except ValueError:
        values = []
    if len(values) != count or not all(abs(value) <= largest for value in values):
        size = f", of size at most {largest:g}" if largest < math.inf else ""
        allowed = f"{'one number' if count == 1 else 'three numbers'}{size}"
        xacro = "${" in text or "$(" in text
        raise InputError(f"{name} of {where}", text, _XACRO if xacro else allowed)
    return values


def refuse_xacro(root: Element) -> None:
    """Raise InputError if tags are those of xacro, which is not expanded here."""
    if any("xacro" in element.tag for element in root.iter()):
        raise InputError("content", "xacro", _XACRO)
