"""The messages of kinova-ros that velocities need."""

from making import make

SEVEN = "".join(f"float32 joint{j}\n" for j in range(1, 8))
globals().update(make("kinova_msgs", {"JointVelocity": SEVEN, "JointAngles": SEVEN}))
