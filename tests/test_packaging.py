"""The wheel and the sdist: complete, equal, and at work in an environment of their own."""

import re
import runpy
import shutil
import site
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from importlib.metadata import version
from pathlib import Path

import pytest
import yaml
from packaging.version import Version

from lockedjoint import __version__

ROOT = Path(__file__).parents[1]
PACKAGES = ("lockedjoint", "nlp", "formulations")
LINKS = {"lockedjoint/nlp", "lockedjoint/formulations"}  # files, where there are no links
TOP = ["pyproject.toml", "README.md", "LICENSE", "CHANGELOG.md", "CITATION.cff"]
TOP += ["hatch_build.py"]
TOP += ["CONTRIBUTING.md", "RELEASING.md", "SECURITY.md"]
SKIPPED = {"__pycache__", "_build", "jupyter_execute", ".jupyter_cache"}


def run(*arguments, cwd):
    done = subprocess.run(
        [str(word) for word in arguments],
        **{"cwd": cwd, "capture_output": True, "text": True, "check": False, "timeout": 300},
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    return done.stdout


def files_in(folder):
    """Files of a folder of the checkout, relative to it, without what running leaves."""
    return {
        path.relative_to(ROOT).as_posix()
        for path in (ROOT / folder).rglob("*")
        if path.is_file() and not SKIPPED & set(path.relative_to(ROOT).parts)
    } - LINKS


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """The sdist of a copy of the checkout, and the wheel built from that sdist."""
    folder = tmp_path_factory.mktemp("packaging")
    source = folder / "source"
    source.mkdir()
    for name in TOP:
        shutil.copy(ROOT / name, source)
    for name in (*PACKAGES, "tests", "docs", "results"):
        skipped = shutil.ignore_patterns(*SKIPPED)
        shutil.copytree(ROOT / name, source / name, symlinks=True, ignore=skipped)
    out = folder / "dist"
    run(sys.executable, "-m", "build", "--no-isolation", "--outdir", out, source, cwd=folder)
    [sdist], [wheel] = out.glob("*.tar.gz"), out.glob("*.whl")
    return sdist, wheel


def test_wheel_and_sdist_hold_what_they_should(built):
    sdist, wheel = built
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if ".dist-info/" not in name}
    files = set().union(*(files_in(name) for name in PACKAGES))
    assert names == {f"lockedjoint/{name.removeprefix('lockedjoint/')}" for name in files}
    with tarfile.open(sdist) as archive:
        names = {member.name.partition("/")[2] for member in archive if member.isfile()}
    folders = (*PACKAGES, "tests", "results")
    assert set().union(*map(files_in, folders), TOP) <= names


FOREIGN = """[build-system]
requires = ["hatchling"]
build-backend = "hatchling.build"
[project]
name = "foreign"
version = "1"
[tool.hatch.build.targets.wheel]
packages = ["nlp", "formulations"]
"""


@pytest.fixture(scope="module")
def foreign(tmp_path_factory):
    """A wheel of somebody else's packages `nlp` and `formulations`."""
    source = tmp_path_factory.mktemp("foreign")
    (source / "pyproject.toml").write_text(FOREIGN)
    for name in ("nlp", "formulations"):
        (source / name).mkdir()
        (source / name / "__init__.py").write_text("OURS = False\n")
    run(sys.executable, "-m", "build", "--wheel", "--no-isolation", source, cwd=source)
    [wheel] = (source / "dist").glob("*.whl")
    return wheel


@pytest.mark.slow
def test_packages_called_nlp_and_formulations_change_nothing(built, foreign, tmp_path):
    """In an environment of its own, with this one's dependencies, beside a user's files."""
    run(sys.executable, "-m", "venv", "--without-pip", "empty", cwd=tmp_path)
    python = tmp_path / "empty" / "bin" / "python"
    [packages] = (tmp_path / "empty").glob("lib/python*/site-packages")
    # A folder that a .pth file names is searched, and its own .pth files are not: not the one
    # that makes the checkout importable.
    (packages / "dependencies.pth").write_text("\n".join(site.getsitepackages()) + "\n")
    pip = (sys.executable, "-m", "pip", "--quiet", "--python", python)
    for wheel in (built[1], foreign):
        run(*pip, "install", "--no-deps", "--no-index", "--no-compile", wheel, cwd=tmp_path)
    work = tmp_path / "work"
    work.mkdir()
    for name in ("nlp.py", "formulations.py"):
        (work / name).write_text("raise ImportError('the user's own file')\n")
    where = "import lockedjoint.nlp as one; print(one.__file__)"
    assert Path(run(python, "-c", where, cwd=work).strip()).is_relative_to(packages)
    command = python.with_name("lockedjoint")
    run(command, "verify", cwd=work)
    small = ("--joints", "3", "--task-dimension", "2", "--starts", "1", "--workers", "1")
    run(command, "compare", *small, cwd=work)
    assert (work / "comparison" / "comparison.csv").is_file()
    run(*pip, "uninstall", "--yes", "foreign", cwd=tmp_path)
    run(python, "-m", "lockedjoint", "compare", *small, "--out-dir", "again", cwd=work)


def test_the_readme_of_an_index_has_no_relative_link(built):
    with zipfile.ZipFile(built[1]) as archive:
        [name] = [name for name in archive.namelist() if name.endswith(".dist-info/METADATA")]
        metadata = archive.read(name).decode()
    hook = runpy.run_path(str(ROOT / "hatch_build.py"))
    assert "# lockedjoint" in metadata
    assert "Description-Content-Type: text/markdown" in metadata
    readme = (ROOT / "README.md").read_text("utf-8")
    address = "https://example.org/us/lockedjoint"
    for text in (metadata, hook["readme_for_index"](readme, address)):
        targets = re.findall(r"\]\(([^)\s]+)\)", text)
        assert len(targets) >= 5
        assert all(re.match("https://|#", target) for target in targets)
    assert f"{address}/raw/main/results/figures/locked_joint.svg" in text
    assert f"({address}/blob/main/docs/atlas.md)" in text
    assert hook["addresses"]("", "") == {}
    assert hook["addresses"](address, "")["Issues"] == f"{address}/issues"


def test_the_lowest_versions_are_the_lower_bounds():
    with (ROOT / "pyproject.toml").open("rb") as file:
        project = tomllib.load(file)["project"]
    extras = [project["optional-dependencies"][name][0] for name in ("figures", "tables")]
    bounds = dict(line.split(">=") for line in [*project["dependencies"], *extras])
    lines = (ROOT / ".ci/lowest.txt").read_text("utf-8").splitlines()
    lowest = dict(line.split("==") for line in lines if not line.startswith("#"))
    assert lowest.keys() == bounds.keys()
    assert all(Version(lowest[name]) == Version(bounds[name]) for name in lowest)


def test_the_recipe_for_conda_states_what_pyproject_does():
    with (ROOT / "pyproject.toml").open("rb") as file:
        project = tomllib.load(file)["project"]
    recipe = yaml.safe_load((ROOT / ".ci/conda/recipe.yaml").read_text("utf-8"))
    run = [line.replace(" ", "") for line in recipe["requirements"]["run"]]
    assert run == [f"python{project['requires-python']}", *project["dependencies"]]
    assert recipe["context"]["version"] == __version__
    about = recipe["about"]
    assert about["summary"] == project["description"]
    assert about["license"] == project["license"]
    assert about["license_file"] == project["license-files"]
    [command] = project["scripts"].items()
    assert recipe["build"]["python"]["entry_points"] == [" = ".join(command)]


def test_the_version_is_the_same_everywhere():
    assert version("lockedjoint") == __version__
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert re.findall(r"^version: (.*)$", citation, re.MULTILINE) == [__version__]
    cite = (ROOT / "docs/cite.md").read_text(encoding="utf-8")
    assert re.findall(r"version = \{(.*)\}", cite) == [__version__]
    assert re.findall(r"lockedjoint (\d+\.\d+\.\d+)", cite) == [__version__] * 2
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.findall(r"^## \[(.*)\]", changes, re.MULTILINE)[0] in ("Unreleased", __version__)
    with (ROOT / "pyproject.toml").open("rb") as file:
        assert "version" in tomllib.load(file)["project"]["dynamic"]
