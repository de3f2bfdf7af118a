"""Robot descriptions: the bundled ones and their table of numbers, URDF, MJCF, and the chain taken from either."""
