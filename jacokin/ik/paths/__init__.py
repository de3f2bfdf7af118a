"""Joint trajectories over many ticks: along poses, and between configurations. Read `track` first."""
