"""Bad input to every command: one sentence that names what is wrong, and nothing written.

A row of the table is a command line and, behind an arrow, words that its sentence must have:
without an arrow the last option of the command line, or its last word. Every command has two
rows at least. Each runs in this process, in `folder`. Words in braces stand for what is too
long to write out, see `WORDS`.
"""

from __future__ import annotations

import io
import json
import os
import re
import resource
import shlex
import sys
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from contextlib import chdir, redirect_stderr, redirect_stdout
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

import click
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from lockedjoint.__main__ import main
from lockedjoint.commands.app import app
from lockedjoint.formulations.campaign.campaign import declaration, run
from lockedjoint.formulations.campaign.records import open_store
from tests import made_robots as made

ROOT = Path(__file__).parents[1]
COMMANDS = {name: app.get_command(click.Context(app), name) for name in app.list_commands(None)}
SECONDS = 8  # of the processor, the first import of a library included
MEMORY = 1e9  # bytes by which the largest use of memory may grow

WORDS = {
    "n400": "9" * 400,
    "n5000": "9" * 5000,
    "e64": str(2**64),
    "e32": str(2**32 + 1),
    "tera": str(10**12),
    "long": "x" * 100_000,
    "path": "/".join(["d" * 200] * 30),
    "control": "\x1b[31m\n\u202e",
}

TABLE = """
# numbers, names and what is too much
compare --starts {n5000}
compare --joints 6 -> joints
compare --unknown
nothing
measurr -> No such command 'measurr'. Did you mean 'measure'?
atlas showw -> Did you mean 'show'?
reproduce extra
reproduce --out-dir valid.csv -> output folder
solve something
solve residual --ipopt tolerance=1 -> Ipopt option
solve residual --solver fatrop --ipopt max_iter={e32} -> Fatrop option max_iter
solve max-min --model {long} -> model
solve max-min --setting encoding=nothing -> encoding
solve max-min --failures 20 --joints 40 -> failures
solve max-min --failure-probabilities one=0
solve max-min --maximise expected -> maximise
solve max-min --out .
# the atlas
atlas --where 'nothing == 1'
atlas --entries missing verify -> --entries
atlas show unit-revolute_6x7_k1.json
atlas show nothing
atlas export broken_entries/free-mean_2x3_k1.json
atlas export site --entries missing -> --entries
atlas submit wide.csv -> jacobian
atlas submit seven.csv --by ''
atlas improve nothing
atlas improve free-mean_2x3_k1 --out-dir broken_entries -> file
# bounds and proofs
bound nothing
bound worst-case --lever-arm 1e160 -> length
bound worst-case --solver NONE -> solver
bound two-point 7 -> joints
bound planar 5 --failures 4 --level 1 -> failures
bound residual 5 -> joints
bound max-min --preset compact -> preset
prove 6 -> joints
prove 8 --out .
verify missing.json
verify broken.npz -> cubes that
# Jacobians
measure fifo.csv
measure {path} -> file
measure {control}.csv -> .csv
measure valid.csv --q 1 -> none of a Jacobian
realise valid.csv --to nothing
realise valid.csv --slide far
figure seven-axes --out a.txt -> a name that ends in .svg
figure optima valid.csv -> store
# robots
measure dh.csv -> free joints between bas
measure arm.urdf --tip l7:a,b,c -> tip
measure arm.urdf --task nothing -> task
measure arm.urdf --locked j0=1e308 -> joint j0
measure arm.urdf --q J3=0 -> nearest: j3.
measure arm.urdf --q j0=0,elbow=1 -> not of the arm: elbow.
measure arm.urdf --q digits.json -> file
measure arm.urdf --q valid.json -> valid.json
measure arm.urdf --locked elbow=1 -> locked joint is elbow; allowed: one of j0, j1
measure arm.urdf --tip l7:0,0 -> tip is l7:0,0; allowed: LINK, or LINK:X,Y,Z
measure exampla -> or example; nearest: example.
measure arm.urdf --srdf arm.urdf -> content is URDF
measure arm.urdf --group arm -> an SRDF file
codegen arm.urdf --name a-b -> a name in C
codegen missing.urdf
view arm.urdf --address nowhere.invalid:1 -> nowhere.invalid
view arm.urdf --beside way.csv -> way.csv
posture arm.urdf --at 0.3,0.4,1,0,0,0 --tolerance 0.1,4 -> tolerance
posture mjcf.xml --task vx --clearance 0.1 -> clearance
posture arm.urdf --obstacles arm.urdf@1,2 -> pose
posture arm.urdf --obstacles way.csv -> or the file of a mesh: .stl
posture arm.urdf --workers 0 -> --workers is 0; allowed: a whole number of at least 1
posture long.urdf --failures 12 -> failures
path arm.urdf zero.csv -> waypoints
path arm.urdf way.csv --limits j0=1:0 -> limits of j0
path arm.urdf way.csv --recoveries
path arm.urdf way.csv --acceleration 1,2 -> acceleration is 2 numbers; allowed: 7, one a joint
path arm.urdf way.csv --effort sample=6 -> duration, tracks, rounds, seed; nearest: samples.
path arm.urdf way.csv --task tip:vx,vy,vz -> directions along the base's axes
path arm.urdf way.csv --jerk 5 -> one with an acceleration
path arm.urdf way.csv --q 9,0,0,0,0,0,0 -> joint j0 is 9 rad
recover arm.urdf --locked j0 --at 0.3,0.4,1 --waypoints way.csv -> --at
recover arm.urdf --locked j0=3 --at 0.3,0.4,1 -> j0
recover arm.urdf --locked j0 --at 0.3,0.4,1 --jerk 0 -> jerk limits
recover arm.urdf --locked j0 --at 0.3,0.4,1 --effort progress=1 -> --effort is progress
recover arm.urdf --locked j0 --waypoints way.csv@soon -> FILE, or FILE@SECONDS
recover arm.urdf --locked j0 --waypoints way.csv@1 -> way.csv
recover arm.urdf --reduced j0=1:2 --at 0.3,0.4,1 -> joint j0
workspace arm.urdf --optimise nothing
workspace arm.urdf --effort voxel=1e-300 -> voxel
workspace arm.urdf --effort voxels=1 -> nearest: voxel.
workspace arm.urdf --orientation 1,2 -> orientation
workspace arm.urdf --out a.svg --out b.png -> one file of a kind
prove-workspace arm.urdf --effort halvings=13 -> halvings
prove-workspace arm.urdf --effort fine=1 -> --effort is fine; allowed: one of finest, halvings
prove-workspace arm.urdf --limits {long}=0:1 -> limits
# campaigns and stores
campaign missing.toml new.db -> campaign file
campaign valid.toml new.db --scheduler tcp://127.0.0.1:1 --workers 2
join new.db missing.db
join valid.json valid.db -> store
show valid.db --where 'nothing == 1' -> condition
show valid.db --group-by nothing -> group
# where nothing can be written, or something would be lost
figure optima valid.db --out link.svg -> --out is
show valid.db --to csv --out valid.db -> --out is
compare --out-dir pages -> output file is
compare --out-dir /proc/nowhere -> output folder
"""

# What writes a file, which cannot be made below another file.
WRITERS = ["solve max-min", "bound max-min", "prove", "realise valid.csv", "figure seven-axes"]
WRITERS += ["measure arm.urdf", "posture arm.urdf", "workspace arm.urdf", "show valid.db"]

TOML = {"starts": 2, "formulations": ["residual"], "models": ["free"], "joints": [3]}
TOML |= {"task_dimensions": [2]}

# A campaign file's key and the value that is not allowed, and words of the sentence: the key.
DECLARED = """
starts = 0
starts = {e64}
starts = true
starts = "2"
starts = 1979-05-27
seed = -1
formulations = []
formulations = "residual"
formulations = ["nothing"]
formulations = [07:32:00]
models = ["free:²"]
models = [{{}}]
models = ["unit-revolute"] -> 6 for the model unit-revolute
joints = 3
joints = [2]
joints = [{tera}]
joints = [true]
task_dimensions = [0] -> free in the campaign file is 0
task_dimensions = [3] -> joints
encodings = ["nothing"]
encodings = ["shared-factor"]
from_residual_minima = [1]
failures = [0]
failures = [{e64}]
failures = [2]
solver = "nothing"
solver = "fatrop" -> without constraints or bounds
options = 1 -> a table of solver options
options = {{nothing = 1}}
options = {{tol = "small"}}
options = {{tol = 1979-05-27}}
options = {{tol = [1e-8]}}
options = {{max_iter = {n400}}}
options = {{hsllib = "evil.so", linear_system_scaling = "mc19"}}
options = {{output_file = "valid.csv", file_print_level = 5}}
options = {{option_file_name = "valid.csv"}}
nothing = 1
"\\u0000" = 1 -> \\x00
"""


def _npy(header: str) -> bytes:
    text = header.ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text.encode()


def _saved(array: object) -> bytes:
    file = io.BytesIO()
    np.save(file, array, allow_pickle=True)
    return file.getvalue()


def _header(shape: str, descr: str = "'<f8'") -> bytes:
    return _npy(f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}")


def _damaged(valid: bytes) -> dict[str, bytes]:
    """What a file of any kind can become."""
    noise = np.random.default_rng(0).bytes(5000)
    return {
        "empty": b"",
        "noise": noise,
        "utf16": valid.decode("latin-1").encode("utf-16"),
        "cut": valid[: len(valid) // 3],
        "nul_inside": valid[: len(valid) // 2] + b"\0" + valid[len(valid) // 2 + 1 :],
        "marked": b"\xff\xfe" + valid,
        "page": b"<!DOCTYPE html><html><body>404</body></html>\n",
    }


SEVEN = np.vstack([np.eye(3), np.eye(3)]) @ np.ones((3, 7)) + np.arange(42).reshape(6, 7)

# Arrays of other shapes and kinds, headers that promise too much, and what is no matrix.
DTYPES = {"records": "f8,f8", "void": "V8", "objects": object}
SHAPES = {"scalar": (), "flat": 6, "cube": (2, 3, 4), "none": (0, 3), "tall": (3, 2)}
HEADERS = {
    "huge": "(1000000000000, 3000000000000)",
    "over": f"({2**63}, 3)",
    "wide": "(2, 100000000)",
    "true": "(True, 3)",
    "digits": f"({'9' * 40}, 3)",
}
JACOBIANS = {
    **{f"{name}.npy": _saved(np.zeros((2, 3), kind)) for name, kind in DTYPES.items()},
    **{f"{name}.npy": _saved(np.ones(shape)) for name, shape in SHAPES.items()},
    **{f"shape_{name}.npy": _header(shape) for name, shape in HEADERS.items()},
    "nan.npy": _saved(np.full((2, 3), np.nan)),
    "overflow.npy": _saved(np.full((2, 3), 1e200)),
    "longdouble.npy": _saved(np.full((2, 3), np.longdouble("1e4000"))),
    "shape_deep.npy": _npy("(" * 80),
    "descr_object.npy": _header("(2, 3)", "'|O'"),
    "descr_nested.npy": _header("(2, 3)", "[('a', [('b', '<f8')])]"),
    "length.npy": b"\x93NUMPY\x02\x00\xff\xff\xff\xff{",
    "kind.md": b"1,2",
    "ragged.csv": b"1,2,3\n4,5",
    "words.csv": b"1,2,3\na,b,c",
    "two_headers.csv": b"a,b,c\na,b,c\n1,2,3",
    "empty_cell.csv": b"1,2,,3",
    "half_header.csv": b"1,2,x\n1,2,3",
    "object.json": b'{"jacobian": {"a": 1}}',
    "latin.json": b"\xff",
    "magic.npy": b"PK",
    "no_header.npy": b"\x93NUMPY\x01\x00",
    "complex.csv": b"1j,2,3\n4,5,6\n",
    "underscores.csv": b"1_0,2,3\n4,5,6\n",
    "digits.csv": b"9" * 400 + b",2,3\n4,5,6\n",
    "overflow.csv": b"1e200,2,3\n4,1e200,6\n",
    "quoted.csv": b'"1","2","3"\n"4","5","6"\n',
    "twice.json": b'{"jacobian": [[1,0,1],[0,1,1]], "jacobian": [[1,0,2],[0,1,1]]}',
    "array3d.json": b"[[[1],[2],[3]],[[4],[5],[6]]]",
    "mixed_texts.json": b'[["1",2,3],[4,5,6]]',
    "digits.json": b"[[" + b"9" * 5000 + b",2,3],[4,5,6]]",
    "huge.json": b"[[" + b"9" * 400 + b",2,3],[4,5,6]]",
    "deep.json": b"[" * 200_000,
    "deep_closed.json": b"[" * 500 + b"]" * 500,
    "no_jacobian.json": b'[{"jacobian": [[1,2,3],[4,5,6]]}, {}]',
}

CAMPAIGNS = {
    "deep.toml": b"a = " + b"[" * 100_000,
    "deep_table.toml": b"a = " + b"{a=" * 50_000,
    "dotted.toml": b".".join([b"a"] * 20_000) + b" = 1\n",
    "dotted_table.toml": b"[" + b".".join([b"a"] * 20_000) + b"]\n",
    "digits.toml": b"starts = " + b"9" * 5000 + b"\n",
    "json.toml": json.dumps(TOML).encode(),
    "keyless.toml": b"starts = 2\n",
    "keys.toml": b"".join(b"k%d = 1\n" % k for k in range(50_000)),
}


def _toml(line: str = "") -> bytes:
    key, _, value = line.partition(" = ")
    lines = [f"{k} = {json.dumps(v)}" for k, v in TOML.items() if k != key]
    return "\n".join([*lines, f"{key} = {value}"] if line else lines).encode() + b"\n"


def _urdf(joints: int, **more: dict[str, str]) -> bytes:
    axes = [f"0 {k % 2} {1 - k % 2}" for k in range(joints)]
    turned = {"rpy": "0.4 0.7 0.2"}
    kinds = {f"j{k}": turned | more.get(f"j{k}", {}) for k in range(joints)}
    return made.urdf(made.serial(["0.1 0.05 0.3"] * joints, axes, **kinds)).encode()


_SRDF = (
    '<robot name="made"><group name="arm"><chain base_link="l0" tip_link="l7"/></group>'
    '<group_state name="home" group="arm"><joint name="j0" value="0.5"/></group_state></robot>'
)
# The same arm of four joints as a table and as MJCF.
_DH = "# convention: standard\nkind,a,d,alpha_deg,theta_deg\n" + "R,0.3,0.1,90,0\n" * 4
_MJCF = "".join(f'<body name="l{k}" pos="0 0 1"><joint name="j{k}"/>' for k in range(4))
_MJCF = f"<mujoco><worldbody>{_MJCF}{'</body>' * 4}</worldbody></mujoco>"


def _store() -> bytes:
    """A store of two cells, four starts each, with digests."""
    with TemporaryDirectory() as folder:
        path = Path(folder, "s.db")
        grid = {"starts": 4, "formulations": ["residual", "max-min"], "models": ["free"]}
        with open_store(path, writable=True) as store, ThreadPoolExecutor(1) as one:
            run(declaration({**grid, "joints": [3], "task_dimensions": [2]}), store, one)
        return path.read_bytes()


VALID = {
    "valid.csv": b"1,0,0.5\n0,1,0.5\n",
    "valid.npy": _saved(np.array([[1, 0, 0.5], [0, 1, 0.5]])),
    "valid.json": b'{"jacobian": [[1, 0, 0.5], [0, 1, 0.5]]}',
    "valid.toml": _toml(),
    "arm.urdf": _urdf(7),
    "arm.srdf": _SRDF.encode(),
    "dh.csv": _DH.encode(),
    "mjcf.xml": _MJCF.encode(),
    "valid.db": _store(),
    "certificate.json": (ROOT / "results/existence/certificate.json").read_bytes(),
}
MORE = {
    "wide.csv": "\n".join(",".join(["1", "0", "0.5"] * 1000) for _ in "xy").encode(),
    "seven.csv": "\n".join(",".join(map(str, row)) for row in SEVEN).encode(),
    "best.csv": b"1,-0.5,-0.5\n0,0.8660254037844386,-0.8660254037844386\n",
    "long.urdf": _urdf(40),
    "way.csv": b"x,y,z\n0.5,0.2,1\n0.4,0.3,1\n",
    "broken.npz": b"no archive",
}
# Folders of entries of the atlas: the content of one file, cut, or of another entry.
_ENTRIES = ROOT / "formulations/atlas/entries"
ENTRIES = {
    "empty_entries": b"",
    "broken_entries": (_ENTRIES / "free-mean_2x3_k1.json").read_bytes()[:500],
    "other_entries": (_ENTRIES / "free-mean_2x4_k1.json").read_bytes(),
}
# What reads a file of this kind, the file in place of the star.
READERS = {
    "valid.csv": ("measure *", "figure singular-values * --out a.svg"),
    "valid.npy": ("measure *",),
    "valid.json": ("realise *", "measure arm.urdf --q *"),
    "valid.toml": ("campaign * new.db",),
    "arm.urdf": ("measure *", "path * way.csv"),
    "arm.srdf": ("measure arm.urdf --srdf * --group arm",),
    "dh.csv": ("measure * --task position",),
    "mjcf.xml": ("measure * --task vx",),
    "valid.db": ("show *", "join new.db *"),
    "certificate.json": ("verify *",),
}
DAMAGED = {
    f"{damage}_{name}": (content, name)
    for name, valid in VALID.items()
    for damage, content in _damaged(valid).items()
}
# Damage that leaves what still can be read; of a store, see test_stores.py.
HARMLESS = {
    "cut_valid.csv",
    "utf16_arm.urdf",
    "utf16_arm.srdf",
    "utf16_mjcf.xml",
    "nul_inside_valid.db",
}


def _cases() -> list[tuple[str, str]]:
    """Every command line, with words that its sentence has."""
    rows = [line.partition(" -> ") for line in TABLE.splitlines() if line and line[0] != "#"]
    cases = [(line, said or _fault(line)) for line, _, said in rows]
    cases += [(f"{line} --out valid.csv/a.svg", "--out") for line in WRITERS]
    for name, command in COMMANDS.items():
        if any(one.required and one.param_type_name == "argument" for one in command.params):
            cases.append((name, "Missing argument"))
    for name, (_, kind) in DAMAGED.items():
        readers = () if name in HARMLESS else READERS[kind]
        cases += [(reader.replace("*", name), "") for reader in readers]
    cases += [(f"measure {name}", name) for name in JACOBIANS]
    cases += [(f"campaign {name} new.db", "") for name in CAMPAIGNS]
    for k, (line, said) in enumerate(_declared()):
        named = said or line.partition(" = ")[0].rstrip("s")
        cases.append((f"campaign declared_{k}.toml new.db", named))
    return cases


def _fault(line: str) -> str:
    words = line.split()
    options = [word for word in words if word.startswith("--")]
    return options[-1].partition("=")[0] if options else words[-1].format(**WORDS)[:100]


def _declared() -> list[tuple[str, str]]:
    rows = (line.format(**WORDS).partition(" -> ") for line in DECLARED.splitlines() if line)
    return [(line, said) for line, _, said in rows]


CASES = _cases()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with good and bad files of every kind."""
    place = tmp_path_factory.mktemp("bad_input")
    damaged = {name: content for name, (content, _) in DAMAGED.items()}
    declared = {f"declared_{k}.toml": _toml(line) for k, (line, _) in enumerate(_declared())}
    everything = VALID | MORE | JACOBIANS | CAMPAIGNS | damaged | declared
    for name, content in everything.items():
        (place / name).write_bytes(content)
    for name, content in ENTRIES.items():
        (place / name).mkdir()
        if content:
            (place / name / "free-mean_2x3_k1.json").write_bytes(content)
    (place / "pages" / "comparison.json").mkdir(parents=True)
    (place / "link.svg").symlink_to("valid.db")
    (place / "zero.csv").symlink_to("/dev/zero")
    os.mkfifo(place / "fifo.csv")
    return place


def _state(place: Path) -> dict[str, tuple[int, int]]:
    """Sizes and times of all files, apart from those that SQLite keeps beside what it reads."""
    with os.scandir(place) as entries:
        about = {one.name: one.stat(follow_symlinks=False) for one in entries}
    kept = [name for name in about if not name.endswith((".db-shm", ".db-wal"))]
    return {name: (about[name].st_size, about[name].st_mtime_ns) for name in kept}


def refused(line: str, place: Path) -> str:
    """Run a command line in this process, check all that is promised, return its sentence."""
    words = [word.format(**WORDS) for word in shlex.split(line)]
    before, began, used = _state(place), time.process_time(), resource.RUSAGE_SELF
    most = resource.getrusage(used).ru_maxrss
    out, err = io.StringIO(), io.StringIO()
    with (
        chdir(place),
        patch.object(sys, "argv", ["lockedjoint", *words]),
        redirect_stdout(out),
        redirect_stderr(err),
        pytest.raises(SystemExit) as ended,
    ):
        main()
    said = err.getvalue()
    # A store or a certificate that is not whole is a check that failed.
    checked = any(word.endswith((".db", "certificate.json")) for word in words)
    assert ended.value.code in ((1, 2) if checked else (2,)), said
    assert (out.getvalue(), said[:7], said.count("\n")) == ("", "Error: ", 1)
    assert said[:-1].isprintable()
    assert len(said) < 2000
    assert _state(place) == before, "nothing half-written"
    assert time.process_time() - began < SECONDS
    assert 1e3 * (resource.getrusage(used).ru_maxrss - most) < MEMORY
    return said


@pytest.mark.parametrize(("line", "named"), CASES, ids=[line[:60] for line, _ in CASES])
def test_one_sentence(line, named, folder):
    assert named in refused(line, folder)


def test_every_command_has_two_rows():
    """The table's own, of the command or of what is below it."""
    rows = Counter(line.split()[0] for line, _ in CASES)
    assert all(rows[name] >= 2 for name in COMMANDS)


JUNK = st.sampled_from(["", " ", "-", "nan", "1e999", "0x10", "1_0", "--", "½", "٣", "\u202e1"])
# What stands for a number in the help, and command lines of all that take some.
METAVARS = {*"NMKSWLTX", "METRES", "SECONDS", "SHARE", "A,…", "V,…", "J,…", "METRES[,RADIANS]"}
LINES = """compare, solve max-min, reproduce, bound worst-case, prove, bound planar
bound residual, verify, measure valid.csv, realise valid.csv, path arm.urdf way.csv
posture arm.urdf --at 0.3,0.4,1, recover arm.urdf --locked j0 --at 0.3,0.4,1
 atlas, view arm.urdf, workspace arm.urdf
prove-workspace arm.urdf, campaign valid.toml new.db, atlas submit best.csv
atlas improve free-mean_2x3_k1, figure seven-axes --out a.svg"""


def _numbers(line: str) -> list[tuple[str, str]]:
    first, *rest = line.split()
    command = COMMANDS[first]
    command = getattr(command, "commands", {}).get(rest[0] if rest else "", command)
    return [(line, one.opts[0]) for one in command.params if one.metavar in METAVARS]


NUMBERS = [option for line in re.split(", |\n", LINES) for option in _numbers(line)]


@settings(max_examples=80)
@given(
    option=st.sampled_from(NUMBERS), junk=JUNK | st.text("①²³xyz,;.", min_size=2, max_size=9)
)
def test_no_option_takes_junk_for_a_number(option, junk, folder):
    line, name = option
    assert name in refused(f"{line} {name} {shlex.quote(junk)}", folder)


@settings(max_examples=40)
@given(
    name=st.sampled_from(["valid.csv", "valid.npy", "valid.json", "valid.toml"]),
    place=st.floats(0, 1, exclude_max=True),
    junk=st.sampled_from([b"\0", b"\xff", b"\x80\x81", b"\xed\xa0\x80"]),
)
def test_no_reader_takes_bytes_that_are_no_text(name, place, junk, folder):
    """A byte that no text has, anywhere; in an array's file, within its header."""
    valid, kind = VALID[name], name.rpartition(".")[2]
    at = int(place * (60 if kind == "npy" else len(valid)))
    mutant = valid[:at] + junk + valid[at + len(junk) :]
    assume(mutant != valid)
    file = folder / f"mutant.{kind}"
    file.write_bytes(mutant)
    refused(READERS[name][0].replace("*", file.name), folder)
