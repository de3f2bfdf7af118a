"""The only part that knows viser: the scene, the panel and the guarded web server."""
