"""The arm in MuJoCo: its kinematic twin, self-contact, and MuJoCo's own computation on its description."""
