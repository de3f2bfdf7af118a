"""The parts a scene is made of. Read `entity` first."""
