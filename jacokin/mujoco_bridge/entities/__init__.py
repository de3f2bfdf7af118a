"""Entities, the parts of a scene: attaching, poses, hooks, pickling. Read `entity` first."""
