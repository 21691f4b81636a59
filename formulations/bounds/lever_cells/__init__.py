"""That no isotropic 7R arm has lever arms within a limit, by branch and bound over its axes.

The axes are unit tight frames, and cells of these are excluded. The derivations are in
results/bounds/lever_cells.md; `lever_certificate` runs the proof. Data flow in this order:

- `charts`, `box_frames`, `normal_part`, `boxes`: all tight frames in boxes of coordinates;
- `centres`, `traces`, `weights`, `half_spaces`: which image of a centre is nearest;
- `nodes`, `regions`: boxes cut in halves until none has a frame nearest to the centre, on the
  sphere around it (then the balls of all centres hold all frames) or in its ball;
- `cells`, `expansion`, `remainders`: the equations of an arm, to second order and the rest;
- `equations`, `programs`, `multipliers`: multipliers of a cell;
- `forms`, `certificates`: whether they exclude the cell;
- `arms`: boxes in the ball cut in halves until none has an arm.

`corners` bounds norms over a cube, and `cases` holds arrays that belong together.
"""
