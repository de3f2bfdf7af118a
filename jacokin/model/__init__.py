"""What the arm is: descriptions, frames, limits, forward kinematics and Jacobians. Start with ``robot.py``."""
