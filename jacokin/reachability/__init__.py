"""Where an arm can reach: maps of its workspace, and where to put its base. Everything public is imported from here.

building        `build`: a grid of positions times a set of orientations; read this file first
samples         which poses a map is made of
symmetries      what makes most of them superfluous
map             what is read from a map
placement       where to put the base for given targets
pictures, page  maps as PNG and as a page that turns them
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from jacokin import lazy

if TYPE_CHECKING:
    from jacokin.reachability.building import build as build
    from jacokin.reachability.grid import Grid as Grid
    from jacokin.reachability.map import ReachabilityMap as ReachabilityMap
    from jacokin.reachability.map import bundled as bundled
    from jacokin.reachability.map import load as load
    from jacokin.reachability.orientations import Orientations as Orientations
    from jacokin.reachability.placement import BasePlacement as BasePlacement
    from jacokin.reachability.placement import place_base as place_base

__all__, __getattr__, __dir__ = lazy.door(
    __name__,
    {
        "jacokin.reachability.building": ("build",),
        "jacokin.reachability.grid": ("Grid",),
        "jacokin.reachability.map": (
            "ReachabilityMap",
            "bundled",
            "load",
        ),
        "jacokin.reachability.orientations": ("Orientations",),
        "jacokin.reachability.placement": (
            "BasePlacement",
            "place_base",
        ),
    },
)
