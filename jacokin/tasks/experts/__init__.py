"""Scripted policies that solve tasks. Read `expert` first, then `driver`."""
