"""Ticks of the tracker. Read `tick` first."""
