"""Kinematics and dynamics of many configurations: loops over blocks of them that compile to vector instructions.

arm             the arm as numbers, and where its joints are
kinematics      poses and Jacobians of a frame
dynamics        joint torques and mass matrices
"""
