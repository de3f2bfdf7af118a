"""How to reach a pose: the closed form, mink's QP, and the solver that combines them. Start with ``solver.py``."""
