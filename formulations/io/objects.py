"""What objects and functions share: how they are printed, and what they refuse.

`Brief` prints an object in a line. `takes` makes a sentence of what goes wrong with an
argument. `library` imports an optional library, or says how to install it.
"""

from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import wraps
from types import ModuleType
from typing import Any, ParamSpec, TypeVar

from lockedjoint.nlp.errors import InputError, LockedJointError, MissingLibraryError, shown

Given = ParamSpec("Given")
Result = TypeVar("Result")

# Largest number of entries of a row that are written out.
_MOST_ENTRIES = 8
# Largest number of characters of a value.
_LONGEST = 70
# An object with more fields than this is shown without those that are at their default.
_FEW_FIELDS = 4
# Kinds of values that are written out.
_PLAIN = (str, int, float)


class Brief:
    """What a dataclass with ``repr=False`` inherits from, to print in one line.

    Of arrays the shape is written, of long rows the number of entries.
    """

    def __repr__(self) -> str:
        """Say in one line what it is."""
        own: Any = fields(self)  # type: ignore[arg-type]
        values = {field.name: getattr(self, field.name) for field in own}
        if len(own) > _FEW_FIELDS:
            defaults = {field.name: field.default for field in own}
            values = {k: v for k, v in values.items() if not _same(v, defaults[k])}
        parts = [f"{name} {_brief(v)}" for name, v in values.items() if not _empty(v)]
        return f"<{type(self).__name__}: {', '.join(parts) or 'as by default'}>"


def _same(value: object, default: object) -> bool:
    """Whether a value is a plain one at its default."""
    return type(value) is type(default) and isinstance(value, _PLAIN) and value == default


def _empty(value: object) -> bool:
    """Whether a value says nothing: None, a function, or an empty row or mapping."""
    left_out = isinstance(value, (Mapping, tuple)) and not value
    return value is None or callable(value) or left_out


def _brief(value: Any) -> str:
    """Return a value in few characters: of an array its shape, of a long row its length."""
    if type(value).__module__ == "numpy" and getattr(value, "ndim", False):
        shape = "×".join(map(str, value.shape))
        return f"of shape {shape}" if value.size > 1 else shown(value.tolist())
    if isinstance(value, ModuleType):
        return value.__name__.rpartition(".")[2]
    if isinstance(value, Mapping):
        return f"({len(value)} entries)"
    if isinstance(value, (tuple, list)):
        if len(value) > _MOST_ENTRIES or not all(isinstance(entry, _PLAIN) for entry in value):
            return f"({len(value)} entries)"
        return shown(f"({', '.join(map(_brief, value))})", _LONGEST)
    return f"{value:.6g}" if isinstance(value, float) else shown(value, _LONGEST)


def library(*modules: str, package: str = "") -> Any:
    """Import modules of a library, and return the library; or raise MissingLibraryError.

    What is returned is the first part of the first name: ``library("scipy.linalg")`` is scipy.
    `package` is what pip installs, if it has another name.
    """
    try:
        imported = [__import__(module) for module in modules]
    except ModuleNotFoundError:
        raise MissingLibraryError(modules[0].partition(".")[0], package) from None
    return imported[0]


def takes(allowed: str) -> Callable[[Callable[Given, Result]], Callable[Given, Result]]:
    """Return a decorator of a function that does not look at what it is called with.

    What NumPy, CasADi or Python say about it becomes an InputError, with theirs as its cause.
    """

    def decorated(function: Callable[Given, Result]) -> Callable[Given, Result]:
        @wraps(function)
        def checked(*args: Given.args, **kwargs: Given.kwargs) -> Result:
            try:
                return function(*args, **kwargs)
            except Exception as error:
                within = error.__traceback__ and error.__traceback__.tb_next
                if isinstance(error, LockedJointError) or within is None:
                    raise  # the latter: called with too many or too few
                name = f"an argument of {function.__qualname__}"
                raise InputError(name, "of another kind or shape", allowed) from error

        return checked

    return decorated
