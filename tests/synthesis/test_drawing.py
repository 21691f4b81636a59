"""Drawings show what they say."""

from itertools import pairwise

import numpy as np

from formulations.plot.manipulator import (
    clear_views,
    columns_text,
    figure,
)
from formulations.synthesis.from_jacobian import realise


def test_every_arm_is_drawn_with_names_frame_scale_and_columns(arm):
    drawn, views = figure(arm), clear_views(arm)
    places = np.vstack([arm.points, arm.end_effector])
    for panel, view in zip(drawn.axes, views, strict=True):
        assert panel.get_title() == view.name
        texts = [text.get_text() for text in panel.texts]
        assert {str(i) for i in range(arm.joints)} <= set(texts)
        assert len({"x", "y", "z"} & set(texts)) >= 2
        lines = [np.array(line.get_xydata()) for line in panel.lines]
        lines = np.array([line for line in lines if line.shape == (2, 2)])
        [length] = [float(text.split()[0]) for text in texts if text.endswith(" m")]
        assert np.isclose(np.diff(lines, axis=1)[:, 0], [length, 0]).all(axis=1).any()
        for link in pairwise(view.project(places)[:, :2]):
            assert np.isclose(lines, link, atol=1e-12).all(axis=(1, 2)).any()
    assert drawn._supxlabel.get_text() == columns_text(arm)


def test_columns_of_a_figure_are_those_of_the_jacobian(optimum):
    arm = realise(optimum).arranged([3, 0, 6, 1, 5, 2, 4])
    head, *lines = columns_text(arm).splitlines()
    assert head.split() == ["joint", "column", "vx", "vy", "vz", "wx", "wy", "wz"]
    for i, line in enumerate(lines):
        joint, column, *entries = map(float, line.split())
        assert (joint, column) == (i, arm.columns[i])
        np.testing.assert_allclose(entries, optimum[:, arm.columns[i]], atol=1e-4)
