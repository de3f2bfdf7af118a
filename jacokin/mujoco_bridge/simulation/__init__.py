"""The compiled scene: physics, live arrays, the forward pass. Read `physics` first."""
