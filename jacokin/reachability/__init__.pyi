from jacokin.reachability.building import build as build
from jacokin.reachability.folder import bundled as bundled
from jacokin.reachability.folder import load as load
from jacokin.reachability.map import ReachabilityMap as ReachabilityMap
from jacokin.reachability.placement import BasePlacement as BasePlacement
from jacokin.reachability.placement import place_base as place_base
from jacokin.reachability.samples import Grid as Grid
from jacokin.reachability.samples import Orientations as Orientations

__all__: list[str]
