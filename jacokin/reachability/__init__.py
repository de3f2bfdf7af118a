"""Where an arm can reach: maps of its workspace, and where to put its base. Everything public is imported from here.

building        `build`: a grid of positions times a set of orientations; read this file first
sampling        which poses a map is made of, and what makes most of them superfluous
answers         what is kept of each pose
map, loading    what is read from a map
placement       where to put the base for given targets
pictures, page  maps as PNG and as a page that turns them
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from jacokin import lazy

if TYPE_CHECKING:
    from jacokin.reachability.building import build as build
    from jacokin.reachability.loading import bundled as bundled
    from jacokin.reachability.loading import load as load
    from jacokin.reachability.map import ReachabilityMap as ReachabilityMap
    from jacokin.reachability.placement import BasePlacement as BasePlacement
    from jacokin.reachability.placement import place_base as place_base
    from jacokin.reachability.sampling.grid import Grid as Grid
    from jacokin.reachability.sampling.orientations import Orientations as Orientations

__all__, __getattr__, __dir__ = lazy.door(
    __name__,
    {
        "jacokin.reachability.building": ("build",),
        "jacokin.reachability.sampling.grid": ("Grid",),
        "jacokin.reachability.loading": (
            "bundled",
            "load",
        ),
        "jacokin.reachability.map": ("ReachabilityMap",),
        "jacokin.reachability.sampling.orientations": ("Orientations",),
        "jacokin.reachability.placement": (
            "BasePlacement",
            "place_base",
        ),
    },
)
