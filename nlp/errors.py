"""The exception tree: one clear sentence each, and the data it was made from."""

from __future__ import annotations

import os
import sys
from collections.abc import Collection
from pathlib import Path
from typing import Any, ClassVar

#: The largest whole number that a store keeps: 64 bits, signed.
LARGEST = 2**63 - 1
# Largest number of characters of a value in a message.
_SHOWN_CHARACTERS = 120


class LockedJointError(Exception):
    """The base of every error that this library raises on purpose.

    Attributes
    ----------
    exit_status
        The exit status of a command that ends with this error: 2 for input that is not
        allowed, 1 for a check that failed.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> try:
    ...     lj.measure("nowhere.csv")
    ... except lj.LockedJointError as error:
    ...     print(error.exit_status)
    2
    """

    exit_status: ClassVar[int] = 2


class InputError(LockedJointError, ValueError):
    """An argument, option or file content that is not allowed.

    Parameters
    ----------
    argument
        Name of the argument, option or file at fault.
    value
        What was given.
    allowed
        What is allowed, in words.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> try:
    ...     lj.arm("unit-revolute", joints=5)
    ... except lj.InputError as error:
    ...     print(error)
    joints is 5; allowed: more joints than task dimensions, here at least 7.
    """

    def __init__(self, argument: str, value: object, allowed: str) -> None:
        self.argument = argument
        self.value = value
        self.allowed = allowed
        super().__init__(printable(f"{argument} is {shown(value)}; allowed: {allowed}."))

    def __reduce__(self) -> tuple[type[InputError], tuple[Any, ...]]:
        """Pickle from the three parts, so that it crosses process boundaries."""
        return type(self), (self.argument, self.value, self.allowed)


class MissingLibraryError(InputError):
    """An optional library that is not installed; the message is how to install it.

    Parameters
    ----------
    library
        Its name.
    package
        What pip installs, if that is not the library alone.
    """

    def __init__(self, library: str, package: str = "") -> None:
        # The command installs into the environment that runs.
        command = f"{sys.executable} -m pip install {package or library}"
        super().__init__(library, "missing", command)
        self.package = package

    def __str__(self) -> str:
        """Return the sentence; it ends with the command, to be copied."""
        return f"{self.argument} is missing: {self.allowed}"

    def __reduce__(self) -> tuple[type[InputError], tuple[Any, ...]]:
        """Pickle from the two parts."""
        return type(self), (self.argument, self.package)


class SolverOptionError(InputError):
    """A solver option that does not exist, or a value that the option does not take.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> problem = lj.residual.build(lj.arm("unit-revolute", joints=7))
    >>> try:
    ...     lj.Solver(problem, {"tol": -1})
    ... except lj.SolverOptionError as error:
    ...     print(error.argument)
    Ipopt option tol
    """


class FileError(InputError):
    """A file or folder that cannot be read, written or understood."""


class StoreError(FileError):
    """A store that is damaged, being written, or of a newer version."""

    exit_status: ClassVar[int] = 1


class WorkerError(LockedJointError):
    """A start that fails each time it is run, or workers that cannot be had."""

    exit_status: ClassVar[int] = 1


def of_kind(argument: str, value: Any, kind: type | tuple[type, ...], allowed: str) -> Any:
    """Return a value that is of a kind; InputError otherwise."""
    if not isinstance(value, kind):
        raise InputError(argument, value, allowed)
    return value


def entries_of(argument: str, value: Any, allowed: str) -> list[Any]:
    """Return the entries of a list, an array or another row; InputError if it is none."""
    try:
        return list(value)
    except TypeError:  # also an array of no dimension
        raise InputError(argument, value, allowed) from None


def one_of(argument: str, value: object, words: Collection[str]) -> Any:
    """Return a value that is one of these words; InputError otherwise."""
    if not isinstance(value, str) or value not in words:
        raise InputError(argument, value, "one of " + ", ".join(words))
    return value


def a_function(argument: str, value: object) -> None:
    """Raise InputError unless a value can be called."""
    if not callable(value):
        raise InputError(argument, value, "a function")


def as_path(argument: str, path: object) -> Path:
    """Return a path, or text, as a path; InputError otherwise."""
    return Path(of_kind(argument, path, (str, os.PathLike), "a path"))


def shown(value: object, limit: int = _SHOWN_CHARACTERS) -> str:
    """Return a value as messages have it, shortened to so many characters."""
    try:
        value = str(value) if isinstance(value, Path) else value
        text = value if isinstance(value, str) and value else repr(value)
    except ValueError:  # a whole number that is too long to be written out
        return "a number of thousands of digits"
    except Exception:  # of a value of the user's own kind
        return f"of type {type(value).__name__}, which cannot be shown"
    text = printable(text)
    return text if len(text) <= limit else text[: limit - 1] + "…"


def printable(text: str, kept: str = "") -> str:
    """Return a text in which control characters and marks of direction are escaped.

    Names from files could otherwise command the terminal or forge lines of the output. Some
    characters may be kept, such as line ends.
    """
    if text.isprintable():
        return text
    return "".join(
        one if one.isprintable() or one in kept else one.encode("unicode_escape").decode()
        for one in text
    )
