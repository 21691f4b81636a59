"""The mathematics: the paper's sections and equations, and the file in which each of them is.

A. A. Maciejewski and R. G. Roberts, "On the existence of an optimally failure tolerant 7R
manipulator Jacobian" (1995).

==================================================  ===========================================
in the paper                                        here
==================================================  ===========================================
Section 2, eqs. (1)–(5), (15): the measure          `measures`
eqs. (6)–(8): its bound                             `measures`, `bounds.several_failures`
eqs. (9)–(11): range and null space                 `measures`
Section 3, eqs. (12)–(20): planar, positional       `joints.kinds` (free columns),
and canonical examples                              `reproduction.sections_2_and_3`
Section 4, eq. (21): revolute joints                `joints.kinds`, `joints.arm`
eqs. (22)–(43): the isotropy equations              `isotropy_equations`
eqs. (44)–(45): the residual minimum of 7R          `residual`, `reproduction.seven_joints`
eq. (46): its worst case, "possible to improve"     `max_min`, `encodings`
eqs. (47)–(49): 8R, and families of optima          `isotropy`, `reproduction.eight_joints`
Section 5: does an optimal 7R exist?                `existence`
Appendix: f_1 … f_21 in closed form                 `isotropy_equations`
==================================================  ===========================================

One statement a file: `residual`, `max_min`, `isotropy`, `manipulability`, `condition`. A
statement builds a problem; `solving` solves and judges it. `relaxation` states in cvxpy how
good any answer could be, `bounds` makes proofs of it.

Beyond the paper: several and unequal failures (`max_min`, `bounds.unequal_failures`), isotropy
against worst case (`solving.trade_off_curve`), global bounds (`bounds.moments`), the best
known of every kind of arm (`atlas`). Later works: docs/related_work.md.

Data flows one way: model → formulation → problem → solution → record → table. This storey
imports the engine below it, `lockedjoint.nlp`, and nothing of robots.
"""
