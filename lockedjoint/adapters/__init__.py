"""Failure tolerance inside other tools: one module for each, which imports that tool.

`pink`, `mink` and `placo` solve inverse kinematics as quadratic programs; here are the tasks
and constraints that raise the smooth worst case s(q) of an arm in them. `jax` has it as a
function.
"""
