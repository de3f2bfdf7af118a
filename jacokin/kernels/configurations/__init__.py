"""Kinematics and dynamics of many configurations: loops that compile to vector instructions. Read `arm` first.

arm             the arm as numbers, and where its joints are
kinematics      poses and Jacobians of a frame
dynamics        joint torques and mass matrices
"""
