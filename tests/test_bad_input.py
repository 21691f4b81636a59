"""Bad input to every command: one sentence, no traceback, no new file, no work, soon.

Each case runs in this process. Words in braces stand for what is too long to write out, see
`WORDS`; the files are those of `folder`.
"""

from __future__ import annotations

import io
import json
import os
import shlex
import subprocess
import sys
import time
from contextlib import redirect_stderr, redirect_stdout
from functools import cache
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from formulations.__main__ import main
from formulations.campaign.campaign import run
from formulations.campaign.declaration import declaration
from formulations.campaign.records import open_store
from formulations.commands.app import GROUPS
from formulations.commands.prove import verify
from nlp.executors import LocalExecutor

ROOT = Path(__file__).parents[1]
MEMORY = 4 * 2**30

WORDS = {
    "n400": "9" * 400,
    "n5000": "9" * 5000,
    "e64": str(2**64),
    "e63": str(2**63),
    "e32": str(2**32 + 1),
    "tera": str(10**12),
    "long": "x" * 100_000,
    "path": "/".join(["d" * 200] * 30),
    "bell": "me\a",
}

# One command a line; an empty line or one that begins with # is skipped.
LINES = """
# what a whole number may be
compare --starts 0
compare --starts -4
compare --starts many
compare --starts 1e3
compare --starts {e64}
compare --starts {n400}
compare --starts {n5000}
compare --starts ²
compare --seed {e64}
compare --seed {e63}
compare --seed {n5000}
compare --seed -1
compare --seed 1.5
compare --seed x
compare --seed nan
compare --seed ''
compare --workers 0
compare --workers {e64}
compare --workers -1
compare --joints {tera}
compare --joints {n5000}
compare --joints 1000
compare --joints 6
compare --joints 3 --task-dimension 3
compare --joints 1000 --task-dimension 999
compare --joints 1000000 --task-dimension 2
compare --task-dimension {tera}
compare --task-dimension 0
compare --ipopt linear_solver=ma97
compare --ipopt linear_solver=none
compare --ipopt tolerance=1
compare --ipopt tol
compare --ipopt tol=inf
compare --ipopt tol=nan
compare --ipopt tol=-1
compare --ipopt tol=0
compare --ipopt max_iter=1_0
compare --ipopt max_iter={e32}
compare --ipopt max_iter=-1
compare --ipopt max_iter=1.5
compare --ipopt max_iter={n5000}
compare --ipopt =
compare --ipopt ''
compare --ipopt {long}=1
compare --ipopt tol={long}
compare --ipopt hsllib=evil.so
compare --ipopt output_file=valid.csv
compare --ipopt option_file_name=valid.csv
compare --ipopt max_wall_time=0
compare --ipopt max_wall_time=nan
compare --unknown
compare --out /proc/nowhere
compare --out valid.csv
compare --out valid.csv/deeper
compare --out {path}
reproduce --starts 0
reproduce --starts {e64}
reproduce --seed {e64}
reproduce --out valid.csv
reproduce extra
reproduce --joints 3
failures --starts 0
failures --starts {n400}
failures --seed {e64}
failures --out valid.csv
failures --workers 0
robots --starts 0
robots --seed {e64}
robots --only nothing-has-this-name
robots --out valid.csv
robots --workers 1.5
benchmark --joints 6
benchmark --joints 21
benchmark --joints ''
benchmark --joints 7,,8
benchmark --joints {tera}
benchmark --joints {n5000}
benchmark --joints seven
benchmark --time-limit 0
benchmark --time-limit inf
benchmark --time-limit nan
benchmark --time-limit 1e400
benchmark --seed {e64}
benchmark --starts 0
benchmark --out valid.csv
report --only nothing
report --only ''
report --only comparison,comparison,nothing
report --only comparison --all
report --starts 0
report --seed {e64}
report --workers 0
report --out valid.csv --only existence
nothing
--nothing
solve
solve something
solve max-min extra
solve max-min --locked 2
solve max-min --locked 0
solve max-min --locked {e64}
solve max-min --locked 8 --joints 20
solve max-min --locked 20 --joints 40
solve residual --locked 2 --joints 9
solve max-min --never-fails 0 --locked 12 --joints 30
solve max-min --model nothing
solve max-min --model ''
solve max-min --model {long}
solve max-min --model lever-revolute:²
solve max-min --model lever-revolute:٧
solve max-min --model lever-revolute:{n5000}
solve max-min --model lever-revolute:{tera} --joints {tera}
solve max-min --model lever-revolute:-1,prismatic:8
solve max-min --model lever-revolute:0
solve max-min --model lever-revolute:
solve max-min --model :7
solve max-min --model lever-revolute:3,prismatic:3
solve max-min --model ,
solve max-min --encoding nothing
solve max-min --encoding reduced --joints 8 --locked 2
solve max-min --encoding two-stage --joints 8 --locked 2
solve max-min --encoding reduced --solver fatrop
solve max-min --encoding shared-factor --solver fatrop
solve residual --encoding shared-factor
solve residual --from-residual-minima
solve residual --goal expected
solve max-min --out valid.csv/a.json
solve max-min --out .
solve max-min --out {path}
solve residual --task-dimension 3
solve residual --never-fails 1
solve max-min --goal expected
solve max-min --never-fails 0 --goal other
solve max-min --never-fails 7
solve max-min --never-fails -1
solve max-min --never-fails one
solve max-min --never-fails ''
solve max-min --never-fails {n5000}
solve max-min --never-fails ²
solve max-min --never-fails 0,1,2,3,4,5,6
solve max-min --failure-probabilities 0.1,0.2
solve max-min --failure-probabilities 1
solve max-min --failure-probabilities nan
solve max-min --failure-probabilities 0_1
solve max-min --failure-probabilities inf
solve max-min --failure-probabilities 0
solve max-min --failure-probabilities -0.1
solve max-min --failure-probabilities 1e-300
solve max-min --failure-probabilities ''
solve max-min --failure-probabilities 0.1 --joints {tera}
solve max-min --never-fails 1 --joints {tera}
solve max-min --solver nothing
solve residual --solver fatrop --ipopt tol=inf
solve residual --solver fatrop --ipopt tol=nan
solve residual --solver fatrop --ipopt tol=0
solve residual --solver fatrop --ipopt max_iter={e32}
solve residual --solver fatrop --ipopt mu_strategy=adaptive
solve isotropy --solver fatrop
solve max-min --joints {tera}
solve residual --joints {tera} --model free
solve residual --joints 5000
solve residual --joints 60 --task-dimension 59 --model free
solve residual --joints 100 --task-dimension 99 --model free-mean
solve isotropy --starts {n400}
solve isotropy --seed {e64}
solve isotropy --seed {n5000}
solve isotropy --workers 0
# bounds
bound --joints 6
bound --joints {tera}
bound --joints {n400}
bound --joints 1000 --task-dimension 999
bound --joints {tera} --task-dimension 2000
bound --quantity nothing
bound --trace -1
bound --trace 0
bound --trace nan
bound --trace inf
bound --trace 1e308
bound --trace 1e-320
bound --trace x
bound --lever-arm 1e308
bound --lever-arm 1e-308
bound --lever-arm 1e160
bound --lever-arm 1e-160
bound --lever-arm nan
bound --lever-arm inf
bound --lever-arm -1
bound --lever-arm 0
bound --lever-arm 1 --task-dimension 3
bound --lever-arm 1 --trace 3
bound --lever-arm 1 --joints {tera}
bound --solver NOTHING
bound --solver ''
bound --solver clarabel
bound --lever-arm 1 --solver foo
bound --rigorous
bound --preset compact
bound --seed 0
bound --order 3
bound --quantity worst-case --rigorous
bound --quantity worst-case --preset tight
bound --quantity two-point --trace 3
bound --quantity two-point --joints 7
bound --quantity two-point --joints {tera} --task-dimension 2
bound --quantity two-point --task-dimension 1
bound --quantity two-point --lever-arm 1
bound --quantity two-point --seed 1
bound --quantity two-point --rigorous
bound --quantity two-point --task-dimension 2 --solver NOTHING
bound --quantity planar --task-dimension 2
bound --quantity planar --joints 2
bound --quantity planar --joints 21 --level 1
bound --quantity planar --joints 5 --locked 4 --level 1
bound --quantity planar --joints 5 --level 0
bound --quantity planar --joints 15
bound --quantity planar --joints 5 --solver CLARABEL
bound --level 1
bound --locked 2
bound --manipulability
atlas improve lever-revolute_6x9_k2 --search hops
atlas improve free-mean_2x5_k2_manipulability --search symmetric
atlas improve free-mean_2x5_k2 --search nearest
atlas improve free-mean_2x5_k2 --search hops --workers 2
bound --quantity existence --trace 3
bound --quantity existence --order 4
bound --quantity existence --order 0
bound --quantity existence --order {e64}
bound --quantity existence --order two
bound --quantity existence --joints 9
bound --quantity existence --joints {tera}
bound --quantity existence --task-dimension 0
bound --quantity existence --task-dimension {tera}
bound --quantity existence --preset compact
bound --quantity existence --solver NOTHING
bound --quantity existence --rigorous
bound --quantity existence --seed 1
bound --quantity residual --preset nothing
bound --quantity residual --joints 12
bound --quantity residual --joints {tera}
bound --quantity residual --preset low
bound --quantity residual --solver CLARABEL
bound --quantity residual --order 3
bound --quantity residual --seed {e64}
bound --quantity residual --seed -1
bound --quantity residual --lever-arm 2
bound --quantity max-min --preset nothing
bound --quantity max-min --lever-arm 1
bound --quantity max-min --task-dimension 3
bound --quantity max-min --solver CLARABEL
bound --quantity max-min --joints {tera}
bound --quantity max-min --seed {n400}
bound --quantity max-min --preset localised --joints 8
bound --quantity max-min --joints 8 --preset null-vector
bound --quantity max-min --joints 8 --rigorous
bound --quantity max-min --joints 8 --seed 3
bound --quantity max-min --out a.json
bound --quantity max-min --preset compact
bound --quantity max-min --rigorous --out .
bound --quantity max-min --rigorous --preset null-vector
bound --quantity max-min --rigorous --preset null-vector --out a.json
bound --quantity max-min --preset localised --out a.json
bound --quantity max-min --joints 8 --out a.json
bound --quantity worst-case --out a.json
bound --quantity isotropy
bound --quantity isotropy --free-levers --joints 6
bound --quantity isotropy --free-levers --rigorous
bound --quantity max-min --free-levers --preset localised
bound --quantity residual --free-levers
bound --free-levers
# the atlas
atlas nothing
atlas --mark foo
atlas --mark ''
atlas --model nothing
atlas --model {long}
atlas --joints 1
atlas --joints {n5000}
atlas --locked 0
atlas --locked {n400}
atlas --task-dimension 0
atlas --entries missing
atlas --entries valid.csv
atlas --entries empty_entries
atlas --entries broken_entries
atlas --entries other_entries
atlas --entries {path}
atlas show
atlas show nothing
atlas show ''
atlas show {long}
atlas show unit-revolute_6x7_k1.json
atlas show ../entries/unit-revolute_6x7_k1
atlas show unit-revolute_6x7_k1 --entries missing
atlas show free-mean_2x4_k1 --entries other_entries
atlas show free-mean_2x3_k1 --entries broken_entries
atlas verify extra
atlas verify --entries missing
atlas verify --entries empty_entries
atlas verify --entries valid.csv
atlas verify --entries broken_entries
atlas verify --entries other_entries
atlas submit
atlas submit missing.csv
atlas submit .
atlas submit valid.csv
atlas submit wide.csv
atlas submit seven.csv
atlas submit seven.csv --locked 0
atlas submit seven.csv --locked 2
atlas submit seven.csv --locked {e64}
atlas submit seven.csv --isotropic
atlas submit seven.csv --by ''
atlas submit seven.csv --by '{bell}'
atlas submit seven.csv --by {n400}
atlas submit seven.csv --out valid.csv
atlas submit seven.csv --out new
atlas submit seven.csv --entries missing
atlas submit seven.csv --pick 3
atlas submit several.json
atlas submit best.csv --entries missing --out new
atlas submit best.csv --entries empty_entries
atlas submit best.csv --out valid.csv
atlas improve
atlas improve nothing
atlas improve free-mean_2x3_k1 --minutes 0
atlas improve free-mean_2x3_k1 --minutes -1
atlas improve free-mean_2x3_k1 --minutes nan
atlas improve free-mean_2x3_k1 --minutes inf
atlas improve free-mean_2x3_k1 --minutes x
atlas improve free-mean_2x3_k1 --workers 0
atlas improve free-mean_2x3_k1 --out valid.csv
atlas improve free-mean_2x3_k1 --out broken_entries
solve manipulability --locked 2
solve manipulability --locked 0
solve manipulability --locked 3 --joints 8
solve manipulability --locked 8 --joints 20
solve manipulability --encoding shared-factor
solve manipulability --from-residual-minima
solve manipulability --never-fails 0
solve manipulability --goal expected
solve manipulability --solver fatrop
posture arm.urdf --formulation manipulability --locked 2
# proofs
prove --out .
prove --out valid.csv/a.json
prove --out {path}
prove extra
verify missing.json
verify .
verify {path}
verify --samples {tera}
verify --samples -1
verify --samples {n5000}
verify --samples 1e3
verify certificate.json --samples {e64}
verify certificate.json --samples 100000000
# Jacobians
measure
measure missing.csv
measure valid.csv extra
measure {path}
measure {long}.csv
measure valid.txt
measure valid
measure valid.csv --locked 0
measure valid.csv --locked 3
measure valid.csv --locked {e64}
measure valid.csv --locked {n5000}
measure wide.csv --locked 4
measure wide.csv --locked 30
measure wide.csv --locked 30 --never-fails 0
measure valid.csv --locked 2 --never-fails 0,1
measure valid.csv --never-fails {e64}
measure valid.csv --never-fails 0,
measure valid.csv --failure-probabilities 0.1,0.2
measure valid.csv --failure-probabilities 2
measure valid.csv --tolerance 0
measure valid.csv --tolerance inf
measure valid.csv --tolerance nan
measure valid.csv --tolerance -1
measure valid.csv --tolerance tight
measure /dev/zero
measure zero.csv
measure fifo.csv
realise
realise missing.csv
realise valid.csv --to nothing
realise valid.csv --to figure --json
realise valid.csv --out valid.csv/a.urdf --to urdf
realise valid.csv --out .
realise valid.csv --to figure --out a.txt
realise valid.csv --to figure --out a
realise valid.csv --criterion nothing
realise valid.csv --criterion reach --order 0,1,2
realise valid.csv --criterion reach --signs +++
realise valid.csv --order 0,1
realise valid.csv --order 0,1,1
realise valid.csv --order 0,1,{n5000}
realise valid.csv --order a,b,c
realise valid.csv --order ''
realise valid.csv --signs +
realise valid.csv --signs abc
realise valid.csv --convention nothing
realise valid.csv --to dh --convention nothing
realise valid.csv --to urdf --convention modified
realise valid.csv --to axes --convention standard
realise valid.csv --task nothing
realise valid.csv --task spatial
realise valid.csv --kinds RR
realise valid.csv --kinds XYZ
realise valid.csv --length 0
realise valid.csv --length nan
realise valid.csv --length inf
realise valid.csv --length 1e308
realise valid.csv --length 1e-308
realise valid.csv --tolerance 0
realise valid.csv --tolerance inf
realise valid.csv --pick 1
realise valid.csv --pick {e64}
realise valid.csv --seed {e64} --criterion neighbourhood
realise valid.csv --samples {tera} --criterion neighbourhood
realise valid.csv --samples {tera}
realise valid.csv --samples 0
realise valid.csv --shortlist {tera} --criterion neighbourhood
realise valid.csv --shortlist 5
realise valid.csv --shortlist 0
realise valid.csv --seed 4 --order given --slide never
realise valid.csv --radius 0
realise valid.csv --radius 2
realise valid.csv --radius inf
realise wide.csv
realise wide.csv --count
realise wide.csv --to figure
realise wide.csv --criterion total-length
realise wide.csv --slide length
realise valid.csv --slide
realise valid.csv --slide far
realise valid.csv --to urdf --length 1e-9
realise valid.csv --to urdf --length 1e9
realise several.json
realise several.json --pick 9
figure
figure figure-1
figure nothing --out a.svg
figure seven-axes --out a.txt
figure seven-axes --out a
figure seven-axes --out .
figure seven-axes --out valid.csv/a.svg
figure seven-axes --out a.svg --data valid.csv/b.csv
figure seven-axes --out a.svg --data .
figure seven-axes --out a.svg --jacobian missing.csv
figure seven-axes --out a.svg --jacobian wide.csv
figure seven-axes --out a.svg --jacobian valid.csv
figure seven-axes --out a.svg --jacobian nan.csv --starts 3
figure seven-axes --out a.svg --jacobian seven.csv --starts 3
figure seven-axes --out a.svg --jacobian seven.csv --seed 3
figure seven-axes --out a.svg --jacobian seven.csv --workers 2
figure seven-axes --out a.svg --pick 1
figure seven-axes --out a.svg --store valid.db
figure seven-axes --out a.svg --starts 0
figure seven-axes --out a.svg --starts {e64}
figure seven-axes --out a.svg --seed {e64}
figure seven-axes --out a.svg --workers 0
figure singular-values --out a.svg --jacobian wide.csv
figure trade-off --out a.svg --jacobian valid.csv
figure trade-off --out a.svg --store valid.db
figure optima --out a.svg --jacobian valid.csv
figure optima --out a.svg --store missing.db
figure optima --out a.svg --store valid.csv
figure optima --out a.svg --store .
figure optima --out a.svg --store valid.db --starts 3
figure optima --out a.svg --store valid.db --seed 3
# robots
measure-robot
measure-robot missing.urdf
measure-robot missing.csv
measure-robot missing.xml
measure-robot valid.csv
measure-robot valid.json
measure-robot dh.csv
measure-robot dh.csv --tip nothing
measure-robot mjcf.xml --tip nothing
measure-robot mjcf.xml --base nothing
measure-robot .
measure-robot arm.urdf --tip nothing
measure-robot arm.urdf --tip ''
measure-robot arm.urdf --base nothing
measure-robot arm.urdf --base l7
measure-robot arm.urdf --locked 0
measure-robot arm.urdf --locked 7
measure-robot arm.urdf --locked {e64}
measure-robot long.urdf --locked 12
measure-robot arm.urdf --length 0
measure-robot arm.urdf --length inf
measure-robot arm.urdf --length 1e-300
measure-robot arm.urdf --length 1e308
measure-robot arm.urdf --task nothing
measure-robot arm.urdf --task ''
measure-robot arm.urdf --task vx,vx
measure-robot arm.urdf --frame nothing
measure-robot arm.urdf --point 1,2
measure-robot arm.urdf --point 1,2,3,4
measure-robot arm.urdf --point a,b,c
measure-robot arm.urdf --point nan,0,0
measure-robot arm.urdf --point 1_0,0,0
measure-robot arm.urdf --point ٣,0,0
measure-robot arm.urdf --held j0=0_1
measure-robot arm.urdf --configuration 0,0,0,0,0,0,0_1
measure-robot digits_arm.urdf
measure-robot arm.urdf --point 1e308,1e308,0
measure-robot arm.urdf --point {n400},0,0
measure-robot arm.urdf --held nothing=1
measure-robot arm.urdf --held j0
measure-robot arm.urdf --held j0=x
measure-robot arm.urdf --held j0=1e308
measure-robot arm.urdf --held j0=0 --held j0=1
measure-robot arm.urdf --configuration 1,2
measure-robot arm.urdf --configuration ''
measure-robot arm.urdf --configuration j0=9
measure-robot arm.urdf --configuration j0=nan
measure-robot arm.urdf --configuration j0=0,j0=1
measure-robot arm.urdf --configuration nothing=0
measure-robot arm.urdf --configuration 0,0,0,0,0,0,1e308
measure-robot arm.urdf --configuration 0,0,0,0,0,0,{n400}
measure-robot arm.urdf --configuration missing.json
measure-robot arm.urdf --configuration array3d.json
measure-robot arm.urdf --configuration huge.json
measure-robot arm.urdf --configuration digits.json
measure-robot arm.urdf --configuration deep.json
measure-robot arm.urdf --out valid.csv/a.json
measure-robot arm.urdf --out .
posture
view missing.urdf
view arm.urdf --port 65536
view arm.urdf --port -1
view arm.urdf --port 8o
view arm.urdf --host nowhere.invalid
view arm.urdf --host ''
view arm.urdf --host 192.0.2.1 --port 0
view arm.urdf --configuration 1
view arm.urdf --tip nothing
view arm.urdf --starts 0
view arm.urdf --held j0=x
posture missing.urdf
posture arm.urdf --formulation nothing
posture arm.urdf --formulation residual --locked 2
posture arm.urdf --locked 7
posture arm.urdf --locked {e64}
posture long.urdf --locked 12
posture arm.urdf --starts 0
posture arm.urdf --starts {e64}
posture arm.urdf --seed {e64}
posture arm.urdf --workers 0
posture arm.urdf --ipopt tol=inf
posture arm.urdf --ipopt nothing=1
posture arm.urdf --ipopt hsllib=a.so
posture arm.urdf --tip nothing
posture arm.urdf --length nan
posture arm.urdf --out .
posture arm.urdf --out valid.csv/a.json
posture arm.urdf --at 1,2
posture arm.urdf --at a,b,c
posture arm.urdf --at 1,2,3,4
posture arm.urdf --at nan,0,0
posture arm.urdf --at {n400},0,0
posture arm.urdf --at 1e308,0,0
posture arm.urdf --at ''
posture arm.urdf --at 0.3,0,1,2,0,0,0
posture arm.urdf --at missing.json
posture arm.urdf --at deep.json
posture arm.urdf --at huge.json
posture arm.urdf --at 100,0,0
posture arm.urdf --at 0.3,0.4,1 --tolerance -1
posture arm.urdf --at 0.3,0.4,1 --tolerance 0.1,0.1
posture arm.urdf --at 0.3,0.4,1,0,0,0 --tolerance 0.1,4
posture arm.urdf --at 0.3,0.4,1 --tolerance ''
posture arm.urdf --tolerance 0.1
posture arm.urdf --clearance 0
posture arm.urdf --clearance 0.1
posture mjcf.xml --task vx --clearance 0.1
posture dh.csv --task position --clearance 0.1
posture arm.urdf --failure-probabilities 0.1,0.2
posture arm.urdf --failure-probabilities 2
posture arm.urdf --failure-probabilities 0.1 --failure-probabilities 0
posture arm.urdf --formulation residual --failure-probabilities 0.1
posture arm.urdf --never-fails nothing
posture arm.urdf --never-fails 0,1,2,3,4,5,6
posture arm.urdf --goal nothing
posture arm.urdf --goal expected
measure-robot arm.urdf --failure-probabilities x
measure-robot arm.urdf --never-fails 9
path arm.urdf
path arm.urdf --waypoints missing.csv
path missing.urdf --waypoints valid.csv
path arm.urdf --waypoints deep.json
path arm.urdf --waypoints zero.csv
path arm.urdf --waypoints fifo.csv
path arm.urdf --waypoints huge.json
path arm.urdf --waypoints digits.json
path arm.urdf --waypoints {path}
path arm.urdf --waypoints way.csv --duration 0
path arm.urdf --waypoints way.csv --duration inf
path arm.urdf --waypoints way.csv --duration x
path arm.urdf --waypoints way.csv --samples 1
path arm.urdf --waypoints way.csv --samples {tera}
path arm.urdf --waypoints way.csv --tracks 1
path arm.urdf --waypoints way.csv --tracks {e64}
path arm.urdf --waypoints way.csv --seed {e64}
path arm.urdf --waypoints way.csv --limits nothing
path arm.urdf --waypoints way.csv --limits nothing=0:1
path arm.urdf --waypoints way.csv --limits j0=1:0
path arm.urdf --waypoints way.csv --limits j0=0:nan
path arm.urdf --waypoints way.csv --limits j0=0:1 --limits j0=0:1
path arm.urdf --waypoints way.csv --tip nothing
path arm.urdf --waypoints way.csv --task nothing
path arm.urdf --waypoints way.csv --held nothing=1
path arm.urdf --waypoints way.csv --point 1,2
path arm.urdf --waypoints way.csv --out valid.csv
path arm.urdf --waypoints way.csv --out valid.csv/deeper
workspace
workspace missing.urdf --tip a
workspace arm.urdf --optimise nothing
workspace arm.urdf --limits nothing
workspace arm.urdf --limits {long}=0:1
workspace arm.urdf --voxel nan
workspace arm.urdf --voxel 1e-300
workspace arm.urdf --slice 1e-300
workspace arm.urdf --optimise limits --least-width 1e300
workspace arm.urdf --starts 2
workspace arm.urdf --orientation 1,2
workspace arm.urdf --orientation 0,nan,0
workspace arm.urdf --orientation 1,1,1,1
workspace arm.urdf --orientation 0,0,0 --optimise lengths
workspace arm.urdf --orientation 0,0,0 --voxel 1e-300
workspace arm.urdf --orientation 0,0,0 --voxel nan
workspace arm.urdf --figure a.doc
workspace arm.urdf --out .
# campaigns and stores
campaign
campaign valid.toml
campaign missing.toml --store new.db
campaign . --store new.db
campaign valid.toml --store .
campaign valid.toml --store valid.csv
campaign valid.toml --store valid.csv/new.db
campaign valid.toml --store {path}
campaign valid.toml --store new.db --workers 0
campaign valid.toml --store new.db --workers {e64}
campaign valid.toml --store new.db --chunk 0
campaign valid.toml --store new.db --chunk {e64}
campaign valid.toml --store new.db --time-limit 0
campaign valid.toml --store new.db --time-limit inf
campaign valid.toml --store new.db --scheduler ''
campaign valid.toml --store new.db --scheduler nothing://here:1
campaign valid.toml --store new.db --scheduler tls://127.0.0.1:1
campaign valid.toml --store new.db --scheduler tcp://127.0.0.1:99999999
campaign valid.toml --store new.db --scheduler tcp://127.0.0.1:port
campaign valid.toml --store new.db --scheduler tcp://127.0.0.1:1 --workers 2
join
join new.db
join new.db missing.db
join new.db valid.csv
join new.db .
join valid.csv valid.db
join . valid.db
show
show missing.db
show valid.csv
show .
show {path}
show valid.db --to nothing
show valid.db --to parquet
show valid.db --to csv --json
show valid.db --where 'nothing == 1'
show valid.db --where joints
show valid.db --where ''
show valid.db --where 'joints == x'
show valid.db --group-by nothing
show valid.db --group-by ''
show valid.db --group-by joints,joints
show valid.db --group-by joints --records
figure optima --out a.svg --store {path}
join {path} valid.db
join valid.json valid.db
show valid.db --records --optima
show valid.db --out valid.csv/a.csv
show valid.db --out .
"""

TOML = {"starts": 2, "formulations": ["residual"], "models": ["free"], "joints": [3]}
TOML |= {"task_dimensions": [2]}

# A campaign file's key and the value that is not allowed.
DECLARED = """
starts = 0
starts = {e64}
starts = {n5000}
starts = 1.5
starts = true
starts = "2"
starts = 1979-05-27
starts = inf
seed = -1
seed = {e64}
seed = 1979-05-27T07:32:00Z
seed = nan
formulations = []
formulations = "residual"
formulations = ["nothing"]
formulations = [1]
formulations = [["residual"]]
formulations = [07:32:00]
models = ["nothing"]
models = ["free:²"]
models = ["free:{n400}"]
models = [{{}}]
joints = [2]
joints = [{tera}]
joints = [{n400}]
joints = [true]
joints = [3.0]
joints = 3
joints = [1979-05-27]
task_dimensions = [0]
task_dimensions = [{tera}]
task_dimensions = [3]
encodings = ["nothing"]
encodings = ["shared-factor"]
from_residual_minima = ["yes"]
from_residual_minima = [1]
locked = [0]
locked = [{e64}]
locked = [2]
solver = "nothing"
solver = 1
solver = ["ipopt"]
compiled = "yes"
compiled = 1
compiled = 1979-05-27
options = 1
options = {{tol = inf}}
options = {{tol = nan}}
options = {{tol = "small"}}
options = {{tol = 1979-05-27}}
options = {{tol = [1e-8]}}
options = {{tol = {{a = 1}}}}
options = {{tol = true}}
options = {{max_iter = {e32}}}
options = {{max_iter = {n400}}}
options = {{nothing = 1}}
options = {{hsllib = "evil.so", linear_system_scaling = "mc19"}}
options = {{output_file = "valid.csv", file_print_level = 5}}
options = {{option_file_name = "valid.csv"}}
nothing = 1
"\\u0000" = 1
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
        "nul": b"\0" * 100,
        "noise": noise,
        "spaces": b" \n" * 50,
        "utf16": valid.decode("latin-1").encode("utf-16"),
        "cut": valid[: len(valid) // 3],
        "nul_inside": valid[: len(valid) // 2] + b"\0" + valid[len(valid) // 2 + 1 :],
        "marked": b"\xff\xfe" + valid,
        "page": b"<!DOCTYPE html><html><body>404</body></html>\n",
    }


SEVEN = np.vstack([np.eye(3), np.eye(3)]) @ np.ones((3, 7)) + np.arange(42).reshape(6, 7)

JACOBIANS = {
    "complex.npy": _saved(np.ones((2, 3), complex)),
    "bools.npy": _saved(np.ones((2, 3), bool)),
    "text.npy": _saved(np.full((2, 3), "1")),
    "dates.npy": _saved(np.zeros((2, 3), "M8[s]")),
    "spans.npy": _saved(np.zeros((2, 3), "m8[s]")),
    "records.npy": _saved(np.zeros((2, 3), "f8,f8")),
    "void.npy": _saved(np.zeros((2, 3), "V8")),
    "objects.npy": _saved(np.full((2, 3), None)),
    "scalar.npy": _saved(np.float64(1)),
    "flat.npy": _saved(np.ones(6)),
    "cube.npy": _saved(np.ones((2, 3, 4))),
    "none.npy": _saved(np.ones((0, 3))),
    "nan.npy": _saved(np.full((2, 3), np.nan)),
    "overflow.npy": _saved(np.full((2, 3), 1e200)),
    "longdouble.npy": _saved(np.full((2, 3), np.longdouble("1e4000"))),
    "tall.npy": _saved(np.ones((3, 2))),
    "shape_huge.npy": _header("(1000000000000, 3000000000000)"),
    "shape_over.npy": _header(f"({2**63}, 3)"),
    "shape_wide.npy": _header("(2, 100000000)"),
    "shape_negative.npy": _header("(-2, 3)"),
    "shape_true.npy": _header("(True, 3)"),
    "shape_text.npy": _header("'23'"),
    "shape_deep.npy": _npy("(" * 80),
    "shape_digits.npy": _header("(" + "9" * 40 + ", 3)"),
    "descr_object.npy": _header("(2, 3)", "'|O'"),
    "descr_none.npy": _header("(2, 3)", "None"),
    "descr_nested.npy": _header("(2, 3)", "[('a', [('b', '<f8')])]"),
    "magic.npy": b"\x93NUMPY\xff\xff" + b"\0" * 50,
    "length.npy": b"\x93NUMPY\x02\x00\xff\xff\xff\xff{",
    "nan.csv": b"1,2,nan\n1,2,3\n",
    "inf.csv": b"1,2,inf\n1,2,3\n",
    "ragged.csv": b"1,2,3\n1,2\n",
    "square.csv": b"1,2\n3,4\n",
    "words.csv": b"x,y,z\n1,2,3\n",
    "semicolons.csv": b"1;2;3\n4;5;6\n",
    "complex.csv": b"1j,2,3\n4,5,6\n",
    "underscores.csv": b"1_0,2,3\n4,5,6\n",
    "scripts.csv": "١,2,3\n4,5,6\n".encode(),
    "digits.csv": b"9" * 400 + b",2,3\n4,5,6\n",
    "overflow.csv": b"1e200,2,3\n4,1e200,6\n",
    "quoted.csv": b'"1","2","3"\n"4","5","6"\n',
    "number.json": b"3",
    "text.json": b'"abc"',
    "null.json": b"null",
    "list.json": b"[]",
    "object.json": b"{}",
    "array3d.json": b"[[[1],[2],[3]],[[4],[5],[6]]]",
    "ragged.json": b"[[1,2,3],[1,2]]",
    "nan.json": b"[[1,2,NaN],[1,2,3]]",
    "bools.json": b"[[true,false,true],[true,true,true]]",
    "mixed_bools.json": b"[[true,2,3],[4,5,6]]",
    "texts.json": b'[["1","2","3"],["4","5","6"]]',
    "mixed_texts.json": b'[["1",2,3],[4,5,6]]',
    "nulls.json": b"[[null,2,3],[4,5,6]]",
    "digits.json": b"[[" + b"9" * 5000 + b",2,3],[4,5,6]]",
    "huge.json": b"[[" + b"9" * 400 + b",2,3],[4,5,6]]",
    "deep.json": b"[" * 200_000,
    "deep_closed.json": b"[" * 500 + b"]" * 500,
    "deep_object.json": b'{"a":' * 100_000,
    "no_jacobian.json": b'[{"jacobian": [[1,2,3],[4,5,6]]}, {}]',
    "null_jacobian.json": b'{"jacobian": null}',
    "text_jacobian.json": b'{"jacobian": "abc"}',
    "mixed.json": b'[{"jacobian": [[1,2,3],[4,5,6]]}, 3]',
}

CAMPAIGNS = {
    "deep.toml": b"a = " + b"[" * 100_000,
    "deep_table.toml": b"a = " + b"{a=" * 50_000,
    "dotted.toml": b".".join([b"a"] * 20_000) + b" = 1\n",
    "dotted_table.toml": b"[" + b".".join([b"a"] * 20_000) + b"]\n",
    "digits.toml": b"starts = " + b"9" * 5000 + b"\n",
    "twice.toml": b"starts = 1\nstarts = 2\n",
    "words.toml": b"this is not TOML\n",
    "json.toml": json.dumps(TOML).encode(),
    "keys.toml": b"".join(b"k%d = 1\n" % k for k in range(50_000)),
}


def _toml(line: str = "") -> bytes:
    key, _, value = line.partition(" = ")
    lines = [f"{k} = {json.dumps(v)}" for k, v in TOML.items() if k != key]
    return "\n".join([*lines, f"{key} = {value}"] if line else lines).encode() + b"\n"


def _urdf(joints: int) -> bytes:
    links = "".join(f'<link name="l{k}"/>' for k in range(joints + 1))
    rows = "".join(
        f'<joint name="j{k}" type="revolute"><parent link="l{k}"/><child link="l{k + 1}"/>'
        f'<origin xyz="0.1 0.05 0.3" rpy="0.4 0.7 0.2"/><axis xyz="0 {k % 2} {1 - k % 2}"/>'
        '<limit lower="-2" upper="2" effort="1" velocity="1"/></joint>'
        for k in range(joints)
    )
    return f'<robot name="made">{links}{rows}</robot>'.encode()


# The same arm of four joints as a table and as MJCF.
_DH = "# convention: standard\nkind,a,d,alpha_deg,theta_deg\n" + "R,0.3,0.1,90,0\n" * 4
_MJCF = "".join(f'<body name="l{k}" pos="0 0 1"><joint name="j{k}"/>' for k in range(4))
_MJCF = f"<mujoco><worldbody>{_MJCF}{'</body>' * 4}</worldbody></mujoco>"


def _store() -> bytes:
    """A store of two cells, four starts each, with digests."""
    with TemporaryDirectory() as folder:
        path = Path(folder, "s.db")
        grid = {"starts": 4, "formulations": ["residual", "max-min"], "models": ["free"]}
        with open_store(path, writable=True) as store, LocalExecutor(1) as one:
            run(declaration({**grid, "joints": [3], "task_dimensions": [2]}), store, one)
        return path.read_bytes()


VALID = {
    "valid.csv": b"1,0,0.5\n0,1,0.5\n",
    "valid.npy": _saved(np.array([[1, 0, 0.5], [0, 1, 0.5]])),
    "valid.json": b'{"jacobian": [[1, 0, 0.5], [0, 1, 0.5]]}',
    "valid.toml": _toml(),
    "arm.urdf": _urdf(7),
    "dh.csv": _DH.encode(),
    "mjcf.xml": _MJCF.encode(),
    "valid.db": _store(),
    "certificate.json": (ROOT / "results/existence/certificate.json").read_bytes(),
}
MORE = {
    "wide.csv": "\n".join(",".join(["1", "0", "0.5"] * 1000) for _ in "xy").encode(),
    "seven.csv": "\n".join(",".join(map(str, row)) for row in SEVEN).encode(),
    "best.csv": b"1,-0.5,-0.5\n0,0.8660254037844386,-0.8660254037844386\n",
    "several.json": b'[{"jacobian": [[1,0,1],[0,1,1]]}, {"jacobian": [[1,0,1],[0,1,1]]}]',
    "long.urdf": _urdf(40),
    "digits_arm.urdf": _urdf(7).replace(b"0.05", b"0_5"),
    "way.csv": b"x,y,z\n0.5,0.2,1\n0.4,0.3,1\n",
    "valid.txt": b"1,2,3\n4,5,6\n",
    "valid": b"1,2,3\n4,5,6\n",
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
    "valid.csv": (
        *("measure *", "realise *", "atlas submit *"),
        "figure singular-values --out a.svg --jacobian *",
    ),
    "valid.npy": ("measure *", "realise *", "figure singular-values --out a.svg --jacobian *"),
    "valid.json": ("measure *", "realise *", "measure-robot arm.urdf --configuration *"),
    "valid.toml": ("campaign * --store new.db",),
    "arm.urdf": ("measure-robot *", "posture *", "workspace *", "path * --waypoints way.csv"),
    "dh.csv": ("measure-robot * --task position",),
    "mjcf.xml": ("measure-robot * --task vx",),
    "valid.db": ("show *", "join new.db *", "figure optima --out a.svg --store *"),
    "certificate.json": ("verify *",),
}
DAMAGED = {
    f"{damage}_{name}": (content, name)
    for name, valid in VALID.items()
    for damage, content in _damaged(valid).items()
}
# Damage that leaves what still can be read; of a store, see tests/campaign/test_stores.py.
HARMLESS = {"cut_valid.csv", "utf16_arm.urdf", "utf16_mjcf.xml", "nul_inside_valid.db"}


def _cases() -> list[tuple[str, ...]]:
    """Every case as the words of a command line."""
    lines = [line for line in LINES.splitlines() if line and not line.startswith("#")]
    for name, (_, kind) in DAMAGED.items():
        if name not in HARMLESS:
            lines += [reader.replace("*", name) for reader in READERS[kind]]
    lines += [
        reader.replace("*", name)
        for name, reader in product(JACOBIANS, ("measure *", "realise *", "atlas submit *"))
    ]
    lines += [f"campaign {name} --store new.db" for name in CAMPAIGNS]
    lines += [f"campaign declared_{k}.toml --store new.db" for k in range(len(_declared()))]
    words = [[word.format(**WORDS) for word in shlex.split(line)] for line in lines]
    return [tuple(one) for one in words]


def _declared() -> list[str]:
    return [line.format(**WORDS) for line in DECLARED.splitlines() if line]


CASES = _cases()

# What would take most memory: large numbers, and files that promise much.
_LARGE = ("--joints 1", "--locked 8", "--locked 30", "shape_", "length.npy", "deep", "dotted")
LARGE = [one for one in CASES if any(part in " ".join(one)[:200] for part in _LARGE)]
LARGE += [one for one in CASES if WORDS["tera"] in one]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with good and bad files of every kind."""
    place = tmp_path_factory.mktemp("bad_input")
    damaged = {name: content for name, (content, _) in DAMAGED.items()}
    declared = {f"declared_{k}.toml": _toml(line) for k, line in enumerate(_declared())}
    everything = VALID | MORE | JACOBIANS | CAMPAIGNS | damaged | declared
    for name, content in everything.items():
        (place / name).write_bytes(content)
    for name, content in ENTRIES.items():
        (place / name).mkdir()
        if content:
            (place / name / "free-mean_2x3_k1.json").write_bytes(content)
    (place / "zero.csv").symlink_to("/dev/zero")
    os.mkfifo(place / "fifo.csv")
    return place


def _state(place: Path) -> dict[str, tuple[int, int]]:
    """Sizes and times of all files, apart from those that SQLite keeps beside what it reads."""
    with os.scandir(place) as entries:
        about = {one.name: one.stat(follow_symlinks=False) for one in entries}
    return {
        name: (one.st_size, one.st_mtime_ns)
        for name, one in about.items()
        if not name.endswith((".db-shm", ".db-wal"))
    }


@cache
def _unit() -> float:
    """Return the processor seconds, here and now, of the command that checks the theorem."""
    began = time.process_time()
    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
        verify()
    return time.process_time() - began


def refused(words: tuple[str, ...], place: Path) -> str:
    """Run a command in this process, check all that is promised, return its sentence."""
    least = _unit()
    before, began = _state(place), time.process_time()
    out, err = io.StringIO(), io.StringIO()
    argv, there = sys.argv, Path.cwd()
    sys.argv = ["lockedjoint", *words]
    os.chdir(place)
    try:
        with redirect_stdout(out), redirect_stderr(err), pytest.raises(SystemExit) as ended:
            main()
    finally:
        sys.argv = argv
        os.chdir(there)
    said = err.getvalue()
    damaged = any(word.endswith((".db", "certificate.json")) for word in words)
    assert ended.value.code in ((1, 2) if damaged else (2,)), said
    assert out.getvalue() == ""
    assert said.startswith("Error: ")
    assert said.count("\n") == 1
    assert len(said) < 2000
    assert _state(place) == before, "nothing half-written"
    assert time.process_time() - began < 4 * least
    return said


@pytest.mark.parametrize("words", CASES, ids=lambda words: " ".join(words)[:60])
def test_one_sentence(words, folder):
    refused(words, folder)


def test_there_are_enough():
    print(len(CASES), "cases")
    assert len(CASES) >= 300
    commands = {words[0] for words in CASES}
    assert {name for names in GROUPS.values() for name in names} <= commands


# A digit or a name becomes something else; each is refused by every option that takes a number.
JUNK = st.sampled_from(["", " ", "-", "nan", "1e999", "0x10", "1_0", "--", "½", "٣", "\u202e1"])
NUMBERS = [
    (command, option)
    for command, options in {
        "compare": "joints task-dimension starts seed workers",
        "solve max-min": "joints locked starts seed workers",
        "reproduce": "starts seed",
        "failures": "starts seed workers",
        "robots": "starts seed workers",
        "benchmark": "starts seed time-limit",
        "bound": "joints task-dimension trace lever-arm",
        "verify": "samples",
        "measure valid.csv": "locked tolerance",
        "realise valid.csv": "length tolerance pick seed samples shortlist radius",
        "measure-robot arm.urdf": "locked length",
        "posture arm.urdf": "locked length starts seed workers",
        "view arm.urdf": "port length starts seed",
        "workspace arm.urdf": "voxel slice",
        "atlas": "joints task-dimension locked",
        "atlas submit best.csv": "locked pick",
        "atlas improve free-mean_2x3_k1": "minutes workers",
        "campaign valid.toml --store new.db": "workers chunk time-limit",
        "figure seven-axes --out a.svg": "pick starts seed workers",
        "report": "starts seed workers",
    }.items()
    for option in options.split()
]


@settings(max_examples=40)
@given(
    option=st.sampled_from(NUMBERS), junk=JUNK | st.text("①²³xyz,;.", min_size=2, max_size=9)
)
def test_no_option_takes_junk_for_a_number(option, junk, folder):
    command, name = option
    refused((*command.split(), f"--{name}", junk), folder)


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
    refused(tuple(READERS[name][0].replace("*", file.name).split()), folder)


@pytest.mark.long
@pytest.mark.processes
def test_memory_is_bounded(folder):
    """What would take most memory, in one process that has 4 GB of addresses."""
    script = (
        "import resource, sys, pathlib\n"
        "resource.setrlimit(resource.RLIMIT_AS, (int(sys.argv[1]),) * 2)\n"
        "import test_bad_input as bad\n"
        "for words in bad.LARGE: bad.refused(words, pathlib.Path(sys.argv[2]))"
    )
    paths = os.pathsep.join((str(ROOT), str(Path(__file__).parent)))
    done = subprocess.run(
        [sys.executable, "-c", script, str(MEMORY), str(folder)],
        env={**os.environ, "PYTHONPATH": paths, "OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
