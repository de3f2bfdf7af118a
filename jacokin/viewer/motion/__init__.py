"""Arms that move by themselves: trajectories that are read and played back, and a tracker that follows the gizmo."""
