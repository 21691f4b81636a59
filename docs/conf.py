"""Sphinx configuration of the documentation site.

Build it, in an environment with the extra ``docs``::

    python -m sphinx -j auto -W --keep-going -b html docs docs/_build/html

Sphinx runs this file first, in four steps: it prepares what pages and their cells need (paths,
IPython's profile, pages of results and of the reference), starts the export of the atlas,
states the settings, and connects functions that check and link. What is written is in
docs/_build and docs/results, which git ignores: delete them to begin anew.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
from importlib import import_module
from importlib.metadata import version as installed
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from docutils import nodes
from docutils.parsers.rst.states import Inliner
from jupyter_cache import get_cache
from sphinx.util.logging import getLogger

# Preparations --------------------------------------------------------------------------------
HERE = Path(__file__).parent
sys.path[:0] = [str(HERE.parent), str(HERE)]
# Cells run in kernels of their own: they find this checkout, its command, one thread each.
os.environ["PYTHONPATH"] = os.pathsep.join(
    filter(None, [str(HERE.parent), os.environ.get("PYTHONPATH")])
)
os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# `-j auto` reads a page on each core; what a page solves starts no workers beside it.
os.environ.setdefault("LOKY_MAX_CPU_COUNT", "1")
os.environ["IPYTHONDIR"] = str(HERE / "_build" / "ipython")
PROFILE = HERE / "_build" / "ipython" / "profile_default"
(PROFILE / "startup").mkdir(parents=True, exist_ok=True)
# Pages have no commands of IPython but `%%bash`. It is told here: figures as SVG, five digits.
(PROFILE / "ipython_kernel_config.py").write_text(
    """c = get_config()
c.InlineBackend.figure_formats = {"svg"}
c.PlainTextFormatter.float_precision = "5"
""",
    encoding="utf-8",
)
# IPython's own `%%bash` sends output in pieces of a hundred bytes, and MyST-NB ends each with
# a new line. It also goes on after a command that failed.
(PROFILE / "startup" / "bash.py").write_text(
    """import subprocess
from IPython.core.magic import register_cell_magic

@register_cell_magic
def bash(_, cell):
    done = subprocess.run(["bash", "-e", "-c", cell], capture_output=True, text=True)
    print(done.stdout + done.stderr, end="")
    done.check_returncode()
""",
    encoding="utf-8",
)
# A page for each Markdown file of `results/`, at the same place: links between them, and those
# of pages to `/results/...`, are right in the repository and here.
shutil.rmtree(HERE / "results", ignore_errors=True)
for file in (HERE.parent / "results").rglob("*.md"):
    name = file.relative_to(HERE.parent)
    up = "../" * len(name.parts)  # from the page to the top of the repository
    page = HERE / name
    page.parent.mkdir(parents=True, exist_ok=True)
    options = f":relative-images:\n:relative-docs: {up.removeprefix('../')}docs/\n"
    page.write_text(f"```{{include}} {up}{name.as_posix()}\n{options}```\n", encoding="utf-8")
# Pages of the reference that are made from the program; reference/*.md include them.
made = HERE / "_build" / "made"
made.mkdir(parents=True, exist_ok=True)
made_pages = import_module("made_pages")  # a module of this folder
(made / "commands.md").write_text(made_pages.commands_page(), encoding="utf-8")
(made / "library.md").write_text(made_pages.library_page(), encoding="utf-8")
# Outputs of cells are kept as long as the code that made them is the same: the name of their
# folder is a hash of it, and folders of other code are deleted.
code = hashlib.sha256()
for package in ("formulations", "lockedjoint", "nlp"):
    for file in sorted((HERE.parent / package).rglob("*")):
        if file.is_file() and file.suffix in (".py", ".json", ".csv", ".toml", ".j2"):
            code.update(file.read_bytes())
CACHE = HERE / "_build" / "jupyter_cache" / code.hexdigest()[:16]
for old in CACHE.parent.glob("*"):
    if old.is_dir() and old != CACHE:
        shutil.rmtree(old)

# The atlas is made by its own command while pages are read, and copied as it is. EXPORT is the
# process that makes it, None if it is there already.
ATLAS = HERE / "_build" / "atlas" / CACHE.name / "atlas"
EXPORT = None
if not (ATLAS / "ro-crate-metadata.json").exists():  # written last
    shutil.rmtree(ATLAS.parents[1], ignore_errors=True)
    ATLAS.parent.mkdir(parents=True)
    command = [sys.executable, "-m", "lockedjoint", "atlas", "export", str(ATLAS)]
    EXPORT = subprocess.Popen(command, stdout=subprocess.DEVNULL)

project = "lockedjoint"
author = "The lockedjoint developers"
version = release = installed("lockedjoint")
extensions = [
    "myst_nb",
    "sphinx.ext.apidoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
]
exclude_patterns = ["_build", "jupyter_execute", "reference/*/modules.rst"]
# A warning on names that two modules have: a class may be named alike in both.
suppress_warnings = ["ref.python"]

# Pages ---------------------------------------------------------------------------------------
myst_enable_extensions = ["dollarmath", "colon_fence", "deflist"]
myst_heading_anchors = 3
nb_execution_mode = "cache"
nb_execution_cache_path = str(CACHE)
# The cache's database is made here: two processes that read pages would make it at once.
get_cache(CACHE).db  # noqa: B018
nb_execution_in_temp = True
nb_execution_timeout = 1200  # a cell; machines may be busy
nb_execution_raise_on_error = True
nb_execution_show_tb = True
nb_merge_streams = True

# Reference -----------------------------------------------------------------------------------
default_role = "py:obj"
apidoc_modules = [
    {
        "path": "../lockedjoint",
        "destination": "reference/modules",
        "module_first": True,
        "max_depth": 1,
        "follow_links": True,  # to nlp and formulations
        "exclude_patterns": [
            "../lockedjoint/adapters",
            "../lockedjoint/commands",
            "../lockedjoint/commands/app.py",
        ],
    },
]
autodoc_default_options = {"members": True, "ignore-module-all": True}
autodoc_member_order = "bysource"
apidoc_automodule_options = {"members"}
autodoc_mock_imports = ["placo"]  # see docs/howto/use_in_other_tools.md
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented_params"
autodoc_typehints_format = "short"
autodoc_type_aliases = {"npt.ArrayLike": "ArrayLike", "FloatArray": "FloatArray"}
autodoc_preserve_defaults = True
# Docstrings write norms as |v|, which reStructuredText takes for a substitution: bars are text.
Inliner.dispatch["|"] = lambda _, bar, __: (
    *(bar.string[: bar.end("start")], []),
    *(bar.string[bar.end("start") :], []),
)
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False
python_use_unqualified_type_names = True

smartquotes = False  # options begin with two hyphens, in tables of results too

# Looks ---------------------------------------------------------------------------------------
html_theme = "furo"
html_title = "lockedjoint"
html_static_path = ["_static"]
# Mathematics is drawn by files of the site, without a network, where this package is installed.
mathjax = find_spec("sphinx-mathjax-offline")
if mathjax is not None and mathjax.origin is not None:
    html_static_path.append(str(Path(mathjax.origin).parent / "static"))
    mathjax_path = "mathjax/tex-chtml.js"
html_search_scorer = str(HERE / "_static" / "scorer.js")
html_extra_path = [str(ATLAS.parent)]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sphinx = html_show_copyright = False
html_theme_options = {"navigation_with_keys": True}
# What is copied from a shell cell can be pasted into a shell: it is without its `%%bash`.
copybutton_exclude = ".linenos, .gp, .go, span:empty + .o, span:empty + .o + .k"
copybutton_prompt_text = "$ "

# What is linked to, checked and awaited ------------------------------------------------------
# Addresses of names of other libraries. Intersphinx would read their inventories from the net,
# and neither CasADi (one page) nor pinocchio (Doxygen) has one.
NUMPY = "https://numpy.org/doc/stable/reference/"
CVXPY = "https://www.cvxpy.org/api_reference/"
CASADI = "https://web.casadi.org/python-api/"
PINOCCHIO = "https://gepettoweb.laas.fr/doc/stack-of-tasks/pinocchio/master/doxygen-html/"
ELSEWHERE = {
    "ArrayLike": f"{NUMPY}typing.html#numpy.typing.ArrayLike",
    "FloatArray": f"{NUMPY}typing.html#numpy.typing.NDArray",
    "NDArray": f"{NUMPY}typing.html#numpy.typing.NDArray",
    **{name: f"{NUMPY}generated/numpy.{name}.html" for name in ("ndarray", "dtype")},
    **{
        name: f"{NUMPY}arrays.scalars.html#numpy.{name}"
        for name in ("float64", "int64", "complex128", "bool")
    },
    "Generator": f"{NUMPY}random/generator.html",
    **dict.fromkeys(("SX", "MX", "DM", "Function"), CASADI),
    "Problem": f"{CVXPY}cvxpy.problems.html#cvxpy.Problem",
    "Variable": f"{CVXPY}cvxpy.expressions.html#cvxpy.expressions.variable.Variable",
    "Model": f"{PINOCCHIO}structpinocchio_1_1ModelTpl.html",
}
# Libraries, as docstrings abbreviate them, and types that stand alone: what begins with one of
# these is looked up in `ELSEWHERE`.
OTHERS = {
    "numpy",
    "np",
    "npt",
    "casadi",
    "ca",
    "cvxpy",
    "cp",
    "pinocchio",
    "ArrayLike",
    "FloatArray",
}


def link_elsewhere(_app: Any, _env: Any, node: Any, content: nodes.Element) -> Any:
    """Return a link to the documentation of another library, if a name is of one."""
    parts = node["reftarget"].split(".")
    library, name = parts[0], parts[-1]
    if library not in OTHERS or name not in ELSEWHERE:
        return None
    return nodes.reference("", "", content, refuri=ELSEWHERE[name], internal=False)


def check_pictures(_app: Any, document: nodes.document) -> None:
    """Warn of a picture without a text that stands for it."""
    for image in document.findall(nodes.image):
        if not image.get("alt"):
            getLogger(__name__).warning("a picture without alt text", location=image)


def await_atlas(_app: Any, _builder: Any) -> None:
    """Wait until the atlas is written: its files are copied before pages are."""
    if EXPORT and EXPORT.wait():
        raise RuntimeError(f"the export of the atlas ended with status {EXPORT.returncode}")


def setup(app: Any) -> None:
    """Connect the functions above."""
    app.connect("missing-reference", link_elsewhere)
    app.connect("doctree-read", check_pictures)
    app.connect("write-started", await_atlas)
