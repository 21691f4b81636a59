"""Random calls, command lines, damaged stores and false certificates, and how each ends.

Each generator yields what a trial came to: ``done``, ``refused`` in a sentence, ``raw`` (an
error of Python or of another library), or ``wrong`` (accepted although it is not right).

Each takes a seed, and the number of trials; ``fuzz.py`` counts how they end. A trial draws with
chances and sizes that are constants here: all of them may be changed, which changes the trials
and nothing else. A new function of the library is a line in `calls`; a new command is a line in
`_LINES`; junk that once broke something is a value in `_JUNK` or `_WORDS`.
"""

import io
import json
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import chdir, redirect_stderr, redirect_stdout
from dataclasses import replace
from fractions import Fraction
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

import lockedjoint as lj
from lockedjoint.__main__ import main
from lockedjoint.commands.app import app
from lockedjoint.formulations import measures, relaxation
from lockedjoint.formulations.bounds.lever_certificate import LeverCertificate, verify_levers
from lockedjoint.formulations.bounds.relaxation_proof import RelaxationProof
from lockedjoint.formulations.bounds.relaxation_rounding import prove
from lockedjoint.formulations.bounds.two_point_proof import prove_two_point
from lockedjoint.formulations.campaign.campaign import declaration, run
from lockedjoint.formulations.campaign.records import TIMES, open_store
from lockedjoint.formulations.existence.certificate import CertificateError
from lockedjoint.formulations.existence.reading import Part
from lockedjoint.kinematics.read_urdf import urdf_tree, xml_root
from lockedjoint.recovery.check_proof import check
from lockedjoint.recovery.failures import Damage
from lockedjoint.recovery.goal import ToolGoal
from lockedjoint.recovery.unreachable import prove_unreachable

#: How a trial may end.
CLASSES = ("done", "refused", "raw", "wrong")
# Exit status of a command line that is not allowed.
_REFUSED = 2
# Exit statuses of a command line that was run: None and 0 if all is well, 1 if what was asked
# for could not be done, or is not so.
_RUN = (None, 0, 1)
# The largest number of arguments of a call that become junk, and the share of junk that is
# given as `InDegrees`.
_MOST_CHANGED = 3
_DEGREES_SHARE = 0.1
# The largest number of options of a command line that are set to junk.
_MOST_OPTIONS = 2
# The largest number of bits of a store that are flipped, and the number of bytes that are
# copied over others. More damage is easier to notice.
_MOST_BITS = 4
_COPIED_BYTES = 64
# The largest number of boxes of the proof that is changed; it needs fewer.
_MOST_BOXES = 2000
# Less than so many splits are put into a proof, and the share of proofs that are cut short.
_MOST_SPLITS = 30
_CUT_SHARE = 0.2
# Factors for a number of a false certificate of a bound, and the share by which this claims
# too much.
_FACTORS = (0.0, -1.0, 0.5, 0.999, 0.999999, 1.000001, 1.001, 1.5, 3.0)
_TOO_SHARP = 1e-9
# The certificate of isotropic lever arms.
_LEVERS = Path(__file__).parents[1] / "bounds/certificates/isotropic_levers.json"
# Limits of lever arms that are claimed too much, in thousandths: above those of an arm that
# exists.
_FALSE_LIMITS = (111, 334)
# Shifts of a number of a frame.
_SHIFTS = (-0.5, -1e-3, -1e-7, 1e-7, 1e-3, 0.5)
# Radii of balls that are too small.
_SMALL_RADII = (0.1, 0.2)
# The largest number of centres that are too few.
_FEW_CENTRES = 6
# Arms of false certificates of the relaxation: its value is a maximum, so nothing proves more.
_RELAXED = ("unit-revolute:7", "unit-revolute:5,prismatic:2", "rotor:8")
# Values that are no right argument, or rarely one. None of them asks for much work.
_JUNK: tuple[Any, ...] = (
    None,
    True,
    -1,
    0,
    2,
    10**30,
    0.5,
    -0.5,
    1e300,
    float("nan"),
    float("inf"),
    "",
    "a\nb",
    "\x00",
    "½",
    "j0=1",
    b"x",
    [],
    [1, [2]],
    [[1, 2], [3]],
    {},
    {"a": 1},
    {1},
    object,
    len,
    (1, 2, 3),
    (0, 0, 0, 1),
    np.ones(2),
    np.eye(2, 3),
    np.array("x"),
)
# Words that are no right value of an option, or rarely one.
_WORDS: tuple[str, ...] = (
    "",
    " ",
    "-",
    "--",
    "nan",
    "1e999",
    "0x10",
    "1_0",
    "½",
    "-1",
    "0",
    "2",
    "0.5",
    "a=b",
)
_WORDS += ("j0=0.1", "j0", "0,0,0,0,0,0,0,0", "0.3,0.4,0.5", "all", "tip:0,0,0", "deg", "a\nb")
# Command lines that are right, behind which options and words are put. They are quick.
_LINES = (
    "measure arm.urdf",
    "measure j.csv",
    "bound worst-case 7 --model unit-revolute",
    "realise j.csv",
    "codegen arm.urdf",
    "recover arm.urdf --locked joint0=0 --at 9,9,9",
    "workspace arm.urdf --effort voxel=0.5 --effort slice_degrees=45 --limits joint0=0:0.1",
    "atlas show free-mean_2x3_k1",
)


def _robot() -> lj.Robot:
    """Return a robot of eight revolute joints without a file: joint0, …, joint7."""
    text = lj.urdf(lj.realise(lj.optimal_jacobian(8)))
    return lj.Robot(urdf_tree(xml_root(text.encode())))


def calls(seed: int, count: int) -> Iterator[str]:
    """Call public functions and classes with junk in place of one to three arguments."""
    robot, rng = _robot(), np.random.default_rng(seed)
    middle, seven = np.zeros(8), lj.arm("unit-revolute", 7)
    bases: tuple[tuple[Callable[..., Any], dict[str, Any]], ...] = (
        (lj.measure, {"source": robot, "q": middle}),
        (lj.bound, {"formulation": "max-min", "arm": seven}),
        (lj.realise, {"jacobian": np.eye(2, 3)}),
        (lj.urdf, {"manipulator": lj.realise(lj.optimal_jacobian(8)), "name": "a"}),
        (lj.optimal_jacobian, {"joints": 8}),
        (lj.Pose, {"position": (0, 0, 0), "quaternion": None, "tolerance": 0.1, "angle": 0}),
        (lj.Locked, {"joint": "joint0", "at": 0.0}),
        (lj.ReducedRange, {"joint": "joint0", "lower": 0.0, "upper": 1.0}),
        (lj.ToolGoal, {"pose": lj.Pose((0, 0, 0)), "directions": None}),
        (lj.FailureModel, {"probabilities": (0.1,) * 7, "failures": 1}),
        (lj.arm, {"model": "unit-revolute", "joints": 7, "task_dimension": 6}),
        (lj.LeverRevolute, {}),
        (lj.Search, {"formulation": "max-min", "starts": 1, "seed": 0}),
        (robot.configuration, {"q": middle}),
        (robot.in_radians, {"stated": {"joint0": 1}}),
        (robot.changed, {"tip": None, "base": None, "task": "all", "length": 1.0}),
        (robot.changed, {"locked": {}, "limits": {}, "clearance": None, "point": (0, 0, 0)}),
        (lj.group_equivalent, {"jacobians": [np.eye(2, 3)]}),
    )
    for _ in range(count):
        function, base = bases[int(rng.integers(len(bases)))]
        given = dict(base)
        names = list(base) or ["budget"]
        most = int(rng.integers(1, _MOST_CHANGED + 1))
        for name in rng.choice(names, min(len(names), most), replace=False):
            value = _JUNK[int(rng.integers(len(_JUNK)))]
            given[str(name)] = lj.InDegrees(value) if rng.random() < _DEGREES_SHARE else value
        yield _outcome(partial(function, **given))


def _outcome(call: Callable[[], Any]) -> str:
    """Return how a call ends; a message that is not one printable line is wrong."""
    try:
        call()
    except lj.LockedJointError as error:
        return "refused" if str(error).isprintable() else "wrong"
    except Exception:  # that is what is looked for
        return "raw"
    return "done"


def lines(seed: int, count: int, folder: Path) -> Iterator[str]:
    """Run command lines with random options and junk behind them, in this process."""
    rng = np.random.default_rng(seed)
    (folder / "arm.urdf").write_text(lj.urdf(lj.realise(lj.optimal_jacobian(8))))
    (folder / "j.csv").write_text("1,-0.5,-0.5\n0,0.8660254037844386,-0.8660254037844386\n")
    with chdir(folder):
        for _ in range(count):
            line = _LINES[int(rng.integers(len(_LINES)))].split()
            command: Any = app.get_command(None, line[0])  # type: ignore[arg-type]
            command = getattr(command, "commands", {}).get(line[1], command)
            options = [one.opts[0] for one in command.params if one.opts[0].startswith("--")]
            for _ in range(int(rng.integers(1, _MOST_OPTIONS + 1))):
                option = options[int(rng.integers(len(options)))]
                line += [option, _WORDS[int(rng.integers(len(_WORDS)))]]
            yield _ended(line)


def _ended(words: list[str]) -> str:
    """Run the program in this process; what is refused is one printable line."""
    before, err, code = sys.argv, io.StringIO(), None
    sys.argv = ["lockedjoint", *words]
    try:
        with redirect_stdout(io.TextIOWrapper(io.BytesIO())), redirect_stderr(err):
            main()
    except SystemExit as ended:
        code = ended.code
    except Exception:  # that is what is looked for
        return "raw"
    finally:
        sys.argv = before
    said = err.getvalue()
    if code != _REFUSED:
        return "done" if code in _RUN else "wrong"
    one = said.startswith("Error: ") and said.count("\n") == 1 and said[:-1].isprintable()
    return "refused" if one else "wrong"


def stores(seed: int, count: int, folder: Path) -> Iterator[str]:
    """Damage a store in a few places, and read it: what is read has to be what was written.

    Damage is one of three: bits that are flipped, an end that is cut off, and bytes that are
    copied over others.
    """
    rng = np.random.default_rng(seed)
    grid = {"starts": 4, "formulations": ["residual"], "models": ["free"], "joints": [3]}
    path = folder / "whole.db"
    with open_store(path, writable=True) as store, ThreadPoolExecutor(1) as one:
        run(declaration({**grid, "task_dimensions": [2]}), store, one)
    whole, right = path.read_bytes(), _rows(path)
    for k in range(count):
        content = bytearray(whole)
        kind = int(rng.integers(3))
        if kind == 0:
            for place in rng.integers(len(content), size=int(rng.integers(1, _MOST_BITS + 1))):
                content[place] ^= 1 << int(rng.integers(8))
        elif kind == 1:
            del content[int(rng.integers(len(content))) :]
        else:
            size = _COPIED_BYTES
            at, other = (int(place) for place in rng.integers(len(content) - size, size=2))
            content[at : at + size] = content[other : other + size]
        damaged = folder / f"damaged_{k}.db"
        damaged.write_bytes(content)
        read: list[list[str]] = []
        outcome = _outcome(partial(_read, damaged, read))
        damaged.unlink()
        yield "wrong" if outcome == "done" and read[0] != right else outcome


def _read(path: Path, read: list[list[str]]) -> None:
    """Append the rows of a store to a list."""
    read.append(_rows(path))


def _rows(path: Path) -> list[str]:
    """Return the rows of a store as sorted words, without times."""
    with open_store(path) as store:
        table = store.frame().drop(columns=list(TIMES))
    return sorted(map(repr, table.to_dict("records")))


def certificates(seed: int, count: int) -> Iterator[str]:
    """Claim of a goal within reach that it is out of reach, with a proof that is changed.

    The proof is one that a goal 9 m away is out of reach. Its targets become where a point of
    the robot is at a random configuration, so whatever its splits of boxes are, it is false.
    """
    robot, rng = _robot(), np.random.default_rng(seed)
    chain = Damage.of(robot, [lj.Locked(robot.chain.names[0], 0.0)]).chain
    proof = prove_unreachable(chain, ToolGoal(lj.Pose((9.0, 0.0, 0.0))), _MOST_BOXES)
    assert proof is not None
    for _ in range(count):
        q = rng.uniform(*chain.ranges)
        place = chain.tip_at(q)[0][:, 0]
        content = json.loads(json.dumps(proof.content))
        content["targets"] = [place.tolist()] * len(content["targets"])
        splits = content["splits"]
        for _ in range(int(rng.integers(0, _MOST_SPLITS))):
            at = int(rng.integers(len(splits) + 1))
            splits[at:at] = [int(rng.integers(-1, len(content["joints"]) + 1))]
        if rng.random() < _CUT_SHARE:
            del splits[int(rng.integers(len(splits))) :]
        yield _checked(partial(check, content))


def two_point_certificates(seed: int, count: int) -> Iterator[str]:
    """Claim less than six lines in space attain when two joints lock, with changed multipliers.

    The multipliers are those of the record, where the claim is 0.2 % above what is attained.
    """
    rng = np.random.default_rng(seed)
    text = (files("lockedjoint.formulations.bounds") / "two_point.json").read_text("utf-8")
    [stored] = [
        one for one in json.loads(text) if (one["task_dimension"], one["joints"]) == (3, 6)
    ]
    names = ("task_dimension", "joints", "blocks", "lift", "violation", "trace_limit")
    attained = 3 / (1 - measures.sigma_bound(3, 6, 6, 2) ** 2 / 2)  # tr G of the icosahedron
    for _ in range(count):
        claim = {name: json.loads(json.dumps(stored[name])) for name in names}
        claim["trace_limit"] = attained * (1 - _TOO_SHARP)
        factor = float(rng.choice(_FACTORS))
        kind = int(rng.integers(3))
        if kind == 0:
            claim["violation"] *= factor
        elif kind == 1:
            claim["lift"][int(rng.integers(len(claim["lift"])))] *= factor
        else:
            block = claim["blocks"][int(rng.integers(len(claim["blocks"])))]
            i, k = (int(place) for place in rng.integers(len(block), size=2))
            block[i][k] *= factor
            block[k][i] = block[i][k]
        yield _checked(partial(prove_two_point, **claim))


def relaxation_certificates(seed: int, count: int) -> Iterator[str]:
    """Claim more than the best that a relaxation proves, with changed multipliers."""
    rng = np.random.default_rng(seed)
    proofs = [prove(relaxation.solve(relaxation.build(lj.arm(spec)))) for spec in _RELAXED]
    for _ in range(count):
        false = _sharper(proofs[int(rng.integers(len(proofs)))], rng)
        yield _checked(false.check)


def _sharper(proof: RelaxationProof, rng: np.random.Generator) -> RelaxationProof:
    """Return a proof with one number changed at random, which claims a little more."""
    factor = Fraction(float(rng.choice(_FACTORS)))
    sharper = replace(proof, level=proof.level * (1 - Fraction(_TOO_SHARP)))
    kind = int(rng.integers(3))
    if kind == 0:
        conditions = [list(weights) for weights in proof.conditions]
        weights = conditions[int(rng.integers(len(conditions)))]
        place = int(rng.integers(len(weights)))
        weights[place] = weights[place] * factor if weights[place] else factor
        return replace(sharper, conditions=tuple(tuple(weights) for weights in conditions))
    if kind == 1:
        failures = [matrix.copy() for matrix in proof.failures]
        matrix = failures[int(rng.integers(len(failures)))]
        i, k = rng.integers(len(matrix), size=2)
        matrix[i, k] += factor
        matrix[k, i] = matrix[i, k]
        return replace(sharper, failures=tuple(failures))
    sums = list(proof.sums)
    block = int(rng.integers(len(sums)))
    weight = sums[block].weight
    sums[block] = replace(sums[block], weight=weight * factor if weight else factor)
    return replace(sharper, sums=tuple(sums))


def lever_certificates(seed: int, count: int) -> Iterator[str]:
    """Claim what centres do not prove: too sharp a bound, or balls that do not hold all axes.

    The certificate is that on record, with one thing changed at random: the bound, the limit,
    a number of a frame, the radius, or the number of centres. Balls of radius 0.2 around the
    centres, and those of six centres, leave out many frames.
    """
    rng = np.random.default_rng(seed)
    text = _LEVERS.read_text("utf-8")
    for _ in range(count):
        content = json.loads(text)
        kind = int(rng.integers(5))
        if kind == 0:
            content["bound"] *= 1 - _TOO_SHARP
        elif kind == 1:
            content["limit"] = str(Fraction(int(rng.integers(*_FALSE_LIMITS)), 1000))
        elif kind == 2:
            frame = content["frames"][int(rng.integers(len(content["frames"])))]
            row, column = int(rng.integers(3)), int(rng.integers(7))
            frame[row][column] += float(rng.choice(_SHIFTS))
        elif kind == 3:
            content["radius"] = float(rng.uniform(*_SMALL_RADII))
        else:
            rng.shuffle(content["frames"])
            del content["frames"][int(rng.integers(1, _FEW_CENTRES + 1)) :]
        yield _checked(partial(_levers, content))


def _levers(content: dict[str, Any]) -> None:
    """Verify a certificate of isotropic lever arms."""
    verify_levers(LeverCertificate.read(Part(content)))


def _checked(proof: Callable[[], object]) -> str:
    """Return how the check of a false certificate ends."""
    try:
        proof()
    except (CertificateError, ValueError):
        return "refused"
    except Exception:  # that is what is looked for
        return "raw"
    return "wrong"
