"""Cells of unit tight frames, in which no isotropic 7R arm has lever arms within a limit.

The derivations are in results/bounds/lever_cells.md. Data flow in this order:

- `charts`, `box_frames`, `normal_part`, `boxes`: all tight frames in boxes of coordinates;
- `centres`, `traces`, `weights`, `half_spaces`: which centre is nearest;
- `cells`, `expansion`, `remainders`: the equations of an arm, to second order and the rest;
- `equations`, `programs`, `multipliers`: multipliers of a cell;
- `forms`, `certificates`: whether they exclude the cell;
- `trees`: boxes cut in halves until all are excluded.

`corners` bounds norms over a cube, and `cases` holds arrays that belong together.
"""
