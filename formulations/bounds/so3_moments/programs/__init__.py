"""The semidefinite programs in the pseudo-moments, their solution and their multipliers.

moment_program        the program, from values at sampled configurations
predictor_corrector   a dense method made for its shape
cvxpy_solver          a general conic solver
multipliers           multipliers made semidefinite, refined and checked
"""
