"""At the sizes of a paper, in 7-point type, no text leaves a figure or lies on another."""

from functools import cache
from itertools import combinations

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text

import lockedjoint as lj
from lockedjoint.figures import arms, optima, singular_values
from lockedjoint.figures.manipulator import figure as drawing
from lockedjoint.figures.robots import draw_kept, draw_path
from lockedjoint.figures.style import Look, looking
from lockedjoint.formulations.joints.models import arm
from lockedjoint.formulations.reproduction import reference
from lockedjoint.formulations.solving.effort import Effort
from lockedjoint.kinematics.chain import ChainJoint
from lockedjoint.kinematics.serial_chain import chain_about_z
from lockedjoint.nlp.starts import generator
from lockedjoint.paths.plan import PathPlan, Trajectory
from lockedjoint.synthesis.from_jacobian import realise
from lockedjoint.workspaces.kept_cubes import KeptCubes

SEVEN = arm("unit-revolute", 7).jacobian(arm("unit-revolute", 7).sample(generator(3, 3)))
WIDE = np.random.default_rng(5).normal(size=(3, 13))
LABELS = [label for label, _ in optima.PROBLEMS for _ in range(50)]
SIGMAS = np.random.default_rng(0).uniform(0.2, 0.6, len(LABELS)).tolist()
ENDS = [
    {"problem": label, "label": label, "counted": k % 9 > 0, "worst_case_sigma": sigma}
    for k, (label, sigma) in enumerate(zip(LABELS, SIGMAS, strict=True))
]
TIMES, SEVEN_LEFT = np.linspace(0, 10, 30), np.arange(210).reshape(30, 7) % 3 > 0
TRAJECTORY = Trajectory(np.zeros((30, 7)), SEVEN_LEFT, 0.1 + 0.2 * np.sin(TIMES) ** 2)
PLAN = dict.fromkeys(PathPlan.__dataclass_fields__) | {
    **{"planned": TRAJECTORY, "minimum_norm": TRAJECTORY, "times": TIMES},
    **{"joints": [f"panda_joint{k}" for k in range(7)], "places": np.linspace(1, 3, 30)},
}


def kept(m):
    """A row of kept cubes."""
    # A slider in space.
    joints = [ChainJoint(f"joint_{k}", k + m == 6, -3.0, 3.0) for k in range(4)]
    robot = chain_about_z(joints, [np.eye(4)] * 4, np.eye(4) + 0.5 * np.eye(4, k=3))
    centre = 0.1 + np.eye(m)[0] * np.arange(5)[:, None] / 5
    limits = ((-1.0, 1.0),) * 4
    return KeptCubes(robot, limits, centre, np.full(5, 0.1))


FIGURES = {
    "figure-1": lambda: arms.figure_1(Effort(starts=2)).figure,
    "figure-3": lambda: arms.figure_3(Effort(starts=12)).figure,
    "seven-axes": lambda: arms.seven_axes(Effort(), SEVEN).figure,
    "singular-values": lambda: singular_values.make(Effort(starts=2)).figure,
    "trade-off": lambda: optima.trade_off(Effort(starts=1), points=3).figure,
    "optima": lambda: optima.draw(ENDS),
    "one histogram": lambda: optima.draw(ENDS[:50]),
    "bars": lambda: singular_values.bars(lj.measure(SEVEN)),
    "many bars": lambda: singular_values.bars(lj.measure(WIDE, failures=2)),
    "an arm in space": lambda: drawing(realise(lj.optimal_jacobian(8))),
    "a path": lambda: draw_path(PathPlan(**PLAN)),
    "kept squares": lambda: draw_kept(kept(2)),
    "kept cubes": lambda: draw_kept(kept(3)),
    "a planar arm": lambda: drawing(realise(reference.PLANAR_3R)),
}


@pytest.fixture(scope="module", autouse=True)
def computed_once():
    """What is solved for a figure does not depend on its size."""
    with pytest.MonkeyPatch.context() as patch:
        for module, name in ((optima, "_curve"), (arms, "optima")):
            patch.setattr(module, name, cache(getattr(module, name)))
        yield


def texts(figure):
    """What is written, and where: ticks outside of the panel are not drawn."""
    hidden = set()
    for axes in figure.axes:
        for axis, view in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
            low, high = np.sort(view) + 1e-9 * np.ptp(view) * np.array([-1, 1])
            for tick in axis.get_major_ticks():
                if not axes.axison or not low <= tick.get_loc() <= high:
                    hidden |= {tick.label1, tick.label2}
    written = [text for text in figure.findobj(Text) if text.get_text().strip()]
    shown = [text for text in written if text.get_visible() and text not in hidden]
    return {text: text.get_window_extent() for text in shown}


@pytest.mark.parametrize(("width", "height", "title"), [(8.5, 6.0, False), (17.0, 12.0, True)])
@pytest.mark.parametrize("name", FIGURES)
def test_texts_stay_on_the_canvas_and_apart(name, width, height, title):
    with looking(Look((width / 2.54, height / 2.54), title, {"font.size": 7.0})):
        figure = FIGURES[name]()
        FigureCanvasAgg(figure).draw()
        places = texts(figure)
    width, height = figure.bbox.size + 1  # a pixel
    for text, box in places.items():
        inside = min(box.x0, box.y0) >= -1 and box.x1 <= width and box.y1 <= height
        assert inside, text.get_text()
    for (text, box), (other, place) in combinations(places.items(), 2):
        across = min(box.x1, place.x1) - max(box.x0, place.x0)
        along = min(box.y1, place.y1) - max(box.y0, place.y0)
        assert min(across, along) <= 1, (text.get_text(), other.get_text())
