"""Bounds on what any Jacobian can reach: a closed form, and semidefinite relaxations.

`certified` picks the best bound for an arm, and names how it is known. It calls or looks up:

- closed forms: `several_failures`, `unequal_failures`, `isotropic`, `two_sliders`;
- the relaxation: `relaxed` (solve, round, check), with `relaxation_rounding`,
  `feasible_weights`, `frame_symmetry` and `relaxation_proof`;
- two locked joints: `two_point` (search) and `two_point_proof`;
- branch and bound: `planar`, with `planar_node`, `planar_cells` and `planar_conditions`;
  `five_levers`;
- seven revolute joints: the folder `moments`, `spectral_limit` and `revolute_exclusions`;
- isotropic lever arms by cells, which proves no bound yet: the folder `lever_cells`.

All of them use `rational_roots`, `exact_matrices` or `unit_cube` where a proof is exact.
"""
