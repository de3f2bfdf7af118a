"""Following targets at a fixed rate within position and velocity limits. Read `tracker` first."""
