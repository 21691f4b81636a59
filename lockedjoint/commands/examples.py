"""Examples of every command, which end its help."""

# The help of each command, also within a group, ends with its lines.
_EXAMPLES = """
compare
compare --joints 4 --task-dimension 2 --starts 20 --out-dir planar
solve max-min --joints 8 --out best.json
solve residual --model lever-revolute:5,prismatic:2 --starts 500
measure best.json --failures 2
measure example
measure arm.urdf --tip tool --q posture.json
realise best.json --to urdf --out arm.urdf
realise best.json --criterion total-length --to figure --out arm.svg
bound
bound record 8
bound worst-case 8
bound two-point 9
bound planar 7 --failures 3 --level 0.97
bound residual --out bound.json
bound max-min
bound isotropy --out bound.json
prove --out certificate.json
prove 9
verify certificate.json
verify
posture arm.urdf --out posture.json
posture arm.urdf --at 0.4,0.1,0.5 --tolerance 0.01
path arm.urdf way.csv
path arm.urdf way.csv --limits elbow=0:2 --out-dir plan
recover arm.urdf --q 0,0.5,0,-1.5,0,1,0 --locked elbow --at 0.4,0.1,0.5
recover arm.urdf --q state.json --locked elbow=1.2 --at pose.json --out-dir recovery
recover arm.urdf --waypoints plan/path.json@2.5 --locked elbow
workspace arm.urdf --optimise limits
workspace arm.urdf --limits elbow=0:2 --out workspace.svg
prove-workspace arm.urdf --limits elbow=0:2 --out kept.npz
prove-workspace arm.urdf --effort finest=0.01 --effort halvings=2
view arm.urdf
view arm.urdf --beside plan/path.json
codegen arm.urdf --out-dir code
codegen arm.urdf --tip tool --task position --name arm
campaign study.toml study.db
campaign study.toml study.db --workers 8 --time-limit 60
show study.db
show study.db --where 'joints == 8' --to csv --out table.csv
join all.db one.db two.db
join copy.db study.db
atlas
atlas --where 'joints == 7' --where 'mark == "open"'
atlas show unit-revolute_6x7_k1
atlas verify
atlas export site
atlas submit best.json --by 'A. Name' --out-dir entries
atlas improve free-mean_2x7_k3 --time-limit 1800
reproduce
reproduce --starts 20 --out-dir here
figure trade-off --out trade-off.svg
figure optima study.db --out optima.pdf --figure-style paper.mplstyle
"""


def examples(words: str) -> str:
    r"""Return the end of the help of a command: the examples whose lines begin with its words.

    The help of a group has those of its commands, too. ``\b`` tells click to keep the lines.
    """
    lines = [line for line in _EXAMPLES.splitlines() if f"{line} ".startswith(f"{words} ")]
    return "\n".join(["\b\nExamples:", *(f"  lockedjoint {line}" for line in lines)])
