"""Inverse kinematics by quadratic programs, for what the closed form does not cover. Read `search` first."""
