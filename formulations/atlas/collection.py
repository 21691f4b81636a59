"""The atlas on disk: one JSON file for each entry, read, checked and improved.

A file is read in two steps. `read_page` refuses what is not an entry as `write_page` writes it:
kinds, shapes and ranges of its values. `problem_of` then says what is wrong with what the file
claims, from its numbers alone: files can come from strangers.

An *entry* is a question (`Entry`), a *page* what is on record for it (`EntryPage`). A page's
Jacobian has shape (m, n), one column per joint.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import fields, replace
from datetime import date
from importlib.resources import files
from math import inf
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np

from lockedjoint.formulations import isotropy, max_min
from lockedjoint.formulations.atlas.entry import (
    RESOLUTION,
    Entry,
    EntryPage,
    Found,
    entries,
    entry,
)
from lockedjoint.formulations.atlas.local_maximum import LocalMaximum, prove_local_maximum
from lockedjoint.formulations.atlas.local_optimality import local_optimality
from lockedjoint.formulations.atlas.proved_value import proved_value, proves
from lockedjoint.formulations.existence.certificate import CertificateError
from lockedjoint.formulations.io.files import load_json, read_bytes, real_in, write_text
from lockedjoint.formulations.measures.canonical import canonical_form
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import LARGEST, FileError, InputError, as_path, of_kind
from lockedjoint.nlp.executors import in_groups

# The keys of an entry's file.
_KEYS = ("entry", *(one.name for one in fields(Entry)), "value", "family", "locally_optimal")
_KEYS += ("found", "history", "jacobian")
# An exported entry states these as well; they follow from the file and are not read.
_FACTS = ("$schema", "bound", "gap_percent", "mark", "exact", "reported")
# Up to this number of entries are verified in this process, in the time that worker processes
# take to start.
_FEW = 10
# Entries of a Jacobian are rounded to multiples of 2⁻⁶⁰, about 1e-18. An entry of size 1 keeps
# all its 53 bits; one that is 0 but for rounding gets few digits, or none, in the file.
_ENTRY_STEP = 2.0**-60
# Number of rows of a spatial Jacobian; fewer rows have no linear and rotational parts.
_SPATIAL_ROWS = 6
# Models of which several can fit a Jacobian, the widest first. All other models (mixed joints,
# rotors) are narrower.
_WIDEST_MODELS = (
    "free-mean",
    "free",
    "lever-revolute",
    "lever-revolute-each",
    "unit-revolute",
)
# Kinds of value that each field of `Found` has in a file; a float can be written as an integer.
_FOUND_TYPES: dict[str, tuple[type, ...]] = {
    name: (int, float) if kind is float else (kind,)
    for name, kind in get_type_hints(Found).items()
}


# What can be wrong with the values of a file that is no entry: every kind of error that reading
# them can raise.
_ILL_FORMED = (KeyError, TypeError, ValueError, OverflowError, AttributeError, InputError)


def folder() -> Path:
    """Return the folder of the entries that came with the package."""
    return Path(str(files("lockedjoint.formulations.atlas") / "entries"))


def checked_folder(where: Path | None) -> Path | None:
    """Return a folder that a user names, or None for none; FileError if it holds no entry."""
    if where is None:
        return None
    try:
        held = {path.name for path in where.iterdir()}
    except (OSError, ValueError):
        held = set()
    if not any(f"{name}.json" in held for name in entries()):
        raise FileError("--entries", str(where), "a folder with entries of the atlas")
    return where


def read_page(path: Path) -> EntryPage:
    """Read an entry's file, or raise FileError; `problem_of` checks what it says."""
    content = load_json(read_bytes(path), path)
    try:
        return _page(content, path.stem)
    except _ILL_FORMED:
        raise FileError("file", str(path), "an entry of the atlas, as it is written") from None


def _page(content: Mapping[str, Any], name: str) -> EntryPage:
    """Return the page of a file's content; one of `_ILL_FORMED` if it is none.

    `name` is that of the file, without ``.json``.
    """
    _only([key for key in content if key not in _FACTS], _KEYS)
    asked = entry(content["entry"])
    stated = {key: content[key] for key in vars(asked)}
    kinds_of = [type(value) for value in stated.values()]
    # A file with another name would be shown in the place of another entry.
    same = stated == vars(asked) and kinds_of == [type(one) for one in vars(asked).values()]
    if not same or name != asked.name:
        raise ValueError
    jacobian = np.array(_numbers(content["jacobian"]), dtype=np.float64)
    isolated = content["locally_optimal"]
    family = content["family"]
    kinds = type(isolated) is bool and type(family) in (int, type(None))
    fits = jacobian.shape == (asked.task_dimension, asked.joints)
    if not (kinds and fits and np.isfinite(jacobian).all()):
        raise ValueError
    of_kind("history", content["history"], list, "a list")
    history = tuple(map(_earlier, content["history"]))
    value, found = _value(content["value"]), _found(content["found"])
    return EntryPage(
        entry=asked,
        jacobian=jacobian,
        value=value,
        family=family,
        locally_optimal=isolated,
        found=found,
        history=history,
    )


def _only(given: Iterable[str], names: Iterable[str]) -> None:
    """Raise ValueError unless an object has these keys and no others."""
    if set(given) != set(names):
        raise ValueError


def _numbers(rows: object) -> object:
    """Return rows of numbers; TypeError if an entry is something else, such as a text."""
    if isinstance(rows, list):
        return [_numbers(row) for row in rows]
    if type(rows) not in (int, float):
        raise TypeError
    return rows


def _earlier(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return an item of the history: ``value``, and ``found`` with the fields of `Found`."""
    _only(given, ("value", "found"))
    return {"value": _value(given["value"]), "found": vars(_found(given["found"]))}


def _value(given: object) -> str:
    """Return the text of a positive finite number, or raise ValueError."""
    if not isinstance(given, str) or not 0 < real_in(given) < inf:
        raise ValueError
    return given


def _found(given: Mapping[str, Any]) -> Found:
    """Return how a Jacobian was found; ValueError, TypeError or KeyError if ill-formed."""
    values = {one.name: given[one.name] for one in fields(Found)}
    _only(given, values)
    if date.fromisoformat(given["date"]).isoformat() != given["date"]:
        raise ValueError
    for name, value in values.items():
        if type(value) not in _FOUND_TYPES[name]:
            raise TypeError
        if not isinstance(value, str) and not 0 <= value <= LARGEST:
            raise ValueError
    return Found(**values)


def read_atlas(where: Path | str | None = None) -> list[EntryPage]:
    """Read the atlas: the best known Jacobian of every entry that a folder holds.

    Parameters
    ----------
    where
        The folder; by default that of the entries that came with the package.

    Raises
    ------
    FileError
        If it is no folder of entries, or a file is not an entry's.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> pages = lj.read_atlas()
    >>> len(pages) > 300
    True
    """
    held = checked_folder(None if where is None else as_path("folder", where))
    pages = (page_of(asked, held) for asked in entries().values())
    return [page for page in pages if page is not None]


def atlas(name: str, where: Path | str | None = None) -> EntryPage:
    """Return the best known Jacobian of an entry, with its value, bound and history.

    Parameters
    ----------
    name
        The entry's name, such as ``unit-revolute_6x9_k2``.
    where
        A folder of entries; by default that of the entries that came with the package.

    Raises
    ------
    InputError
        If the atlas asks for no such entry, or has no Jacobian of it.
    FileError
        If `where` is no folder of entries, or the file is not an entry's.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> page = lj.atlas("unit-revolute_6x7_k1")
    >>> page.value[:8], page.mark
    ('0.571482', 'conjectured')
    """
    of_kind("entry", name, str, "the name of an entry")
    held = checked_folder(None if where is None else as_path("folder", where))
    page = page_of(entry(name), held)
    if page is None:
        raise InputError("entry", name, "an entry with a Jacobian on record")
    return page


def page_of(asked: Entry, where: Path | None = None) -> EntryPage | None:
    """Return what a folder, by default the package's, has on an entry; None if nothing."""
    path = (where or folder()) / f"{asked.name}.json"
    return read_page(path) if path.is_file() else None


def wrong_entries(
    pages: Sequence[EntryPage],
    executor: Executor | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> dict[str, str]:
    """Return what is wrong with entries, by name, of those with which something is.

    Many entries are verified on the executor, few in this process. `progress` is told how far
    it is.
    """
    where = executor if len(pages) > _FEW else None
    calls = [(page,) for page in pages]
    found = dict(in_groups(_named_problem, calls, where, progress, "entries"))
    names = (page.entry.name for page in pages)
    return {name: found[name] for name in names if found[name]}


def _named_problem(page: EntryPage) -> tuple[str, str]:
    """Return the name of a page's entry, and what is wrong with the page."""
    return page.entry.name, problem_of(page)


def problem_of(page: EntryPage) -> str:
    """Return what is wrong with an entry, from its numbers alone; empty if nothing."""
    asked = page.entry
    if not asked.holds(page.jacobian):
        return "J is not one of the Jacobians that the entry asks for"
    try:
        proved = proved_value(asked, page.jacobian)
        if not proves(asked, page.jacobian, page.value):
            return f"the value {page.value} is not proved, only {proved}"
    except InputError as error:
        return str(error).rstrip(".")
    if float(proved) - float(page.value) >= RESOLUTION:
        return f"the value {page.value} is less than is proved, {proved}"
    bound = asked.bound
    if bound.certified and float(proved) > bound.value + RESOLUTION:
        return f"the value {proved} is above the bound {bound.value}"
    if page.family != _family(asked, page.jacobian):
        return f"the family does not have dimension {page.family}"
    return _problem_of_optimum(page)


def _problem_of_optimum(page: EntryPage) -> str:
    """Return what is wrong with the exact value or the mark `locally_optimal` of a page."""
    exact = page.exact
    if exact is not None and not exact.has_root():
        return f"the exact value is not proved: the polynomial has no root at {exact.near}"
    if not page.locally_optimal:
        return ""
    if exact is not None and maximum_is_on_record(page):
        sigma = exact.sigma
    else:
        sets = None if exact is None else exact.active_sets
        maximum = proved_maximum(page.entry, page.jacobian, sets)
        sigma = inf if maximum is None else maximum.sigma
    if sigma > float(page.value) + RESOLUTION:
        return "it is not proved to be locally optimal"
    return ""


def maximum_is_on_record(page: EntryPage) -> bool:
    """Whether results/atlas/exact.py, and nothing here, proves a page to be a local maximum.

    The multipliers of these entries are not unique. The proof is of the Jacobian that came with
    the package, so no other one is accepted.
    """
    if page.exact is None or page.exact.proof != "sharp maximum":
        return False
    ours = page_of(page.entry)
    return ours is not None and np.array_equal(ours.jacobian, page.jacobian)


def improved(
    asked: Entry, jacobian: FloatArray, found: Found, known: EntryPage | None
) -> EntryPage:
    """Return the page of a Jacobian, shape (m, n), in canonical frame, order and signs.

    Where it is no improvement of the page `known` by `RESOLUTION` the Jacobian there stays, and
    only how it was found is written anew. InputError if it is not one that the entry asks for.
    """
    if not asked.holds(jacobian):
        allowed = f"a Jacobian of the entry {asked.name}"
        raise InputError("jacobian", f"of shape {jacobian.shape}", allowed)
    form = canonical_form(jacobian)
    if not asked.holds(form):
        # Models of mixed kinds have the joints in an order of their own.
        form = jacobian
    form = np.asarray(np.round(form / _ENTRY_STEP) * _ENTRY_STEP)
    proved = proved_value(asked, form)
    history: tuple[Mapping[str, Any], ...] = ()
    if known is not None:
        if float(proved) - float(known.value) < RESOLUTION:
            return replace(known, found=found)
        history = (*known.history, {"value": known.value, "found": vars(known.found)})
    page = EntryPage(
        entry=asked,
        jacobian=form,
        value=proved,
        family=_family(asked, form),
        # The mark is claimed, and taken away if it is not proved.
        locally_optimal=True,
        found=found,
        history=history,
    )
    return replace(page, locally_optimal=not _problem_of_optimum(page))


def _family(asked: Entry, jacobian: FloatArray) -> int | None:
    """Return the dimension of the family of optima; None if the score is not a worst case σ."""
    worst_case = asked.formulation in (max_min.NAME, isotropy.NAME)
    return local_optimality(asked, jacobian).family if worst_case else None


def proved_maximum(
    asked: Entry, jacobian: FloatArray, sets: Sequence[tuple[int, ...]] | None = None
) -> LocalMaximum | None:
    """Return the strict local maximum next to a Jacobian, None if none is proved.

    `sets` are the sets of joints that the proof tries first; see `prove_local_maximum`.
    """
    try:
        return prove_local_maximum(asked, jacobian, sets)
    except CertificateError:
        return None


def write_page(page: EntryPage, where: Path) -> Path:
    """Write an entry's file into a folder and return its path."""
    path = where / f"{page.entry.name}.json"
    write_text(path, page.to_json())
    return path


def entry_of(jacobian: FloatArray, failures: int = 1, name: str | None = None) -> Entry:
    """Return the entry that a Jacobian, shape (m, n), is one of, or refuse it.

    It is the entry of the name, or else that of max-min with the narrowest model that J fits.
    """
    m, n = jacobian.shape
    sized = [
        one
        for one in ([entry(name)] if name else entries().values())
        if (one.task_dimension, one.joints) == (m, n)
        and (name or (one.failures, one.formulation) == (failures, max_min.NAME))
    ]
    fitting = [one for one in sized if one.holds(jacobian)]
    if not fitting:
        given = f"{m}×{n}" if name else f"{m}×{n}, {failures} locked"
        if not sized:
            size = f"the size of {name}" if name else "a size that the atlas has; see `atlas`"
            raise InputError("jacobian", given, size)
        models = ", ".join(one.model for one in sized)
        given += f", with {_columns(jacobian)}"
        raise InputError("jacobian", given, f"columns of one of the models {models}")
    return max(fitting, key=_narrowness)


def _narrowness(one: Entry) -> int:
    """Return the place of an entry's model in the order from wide, 0, to narrow."""
    if one.model in _WIDEST_MODELS:
        return _WIDEST_MODELS.index(one.model)
    return len(_WIDEST_MODELS)


def _columns(jacobian: FloatArray) -> str:
    """Say how far columns are from those of the models."""
    if len(jacobian) < _SPATIAL_ROWS:
        norms = np.linalg.norm(jacobian, axis=0)
        size = float(np.sum(norms**2))
        return f"‖J‖_F² = {size:.9g} and columns of norm {norms.min():.9g} to {norms.max():.9g}"
    linear, angular = jacobian[:3], jacobian[3:]
    levers, axes = (np.linalg.norm(part, axis=0) for part in (linear, angular))
    across = float(np.max(np.abs(np.sum(linear * angular, axis=0))))
    off = float(np.max(np.abs(axes - 1)))
    square = float(np.mean(levers**2))
    return (
        f"|ω| off 1 by {off:.1e}, v·ω off 0 by {across:.1e}, |v| {levers.min():.9g} to "
        f"{levers.max():.9g} of mean square {square:.9g}"
    )
