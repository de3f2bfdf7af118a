"""The ids of the Gymnasium environments, apart from the tasks themselves, which load MuJoCo."""

from __future__ import annotations

_NAMES = {
    "reach_site": "ReachSite",
    "reach_duplo": "ReachBrick",
    "lift_brick": "LiftBrick",
    "lift_large_box": "LiftBox",
    "place_brick": "PlaceBrick",
    "place_cradle": "PlaceCradle",
    "stack_2_bricks": "Stack2",
    "stack_2_bricks_moveable_base": "Stack2MoveableBase",
    "stack_3_bricks": "Stack3",
    "stack_3_bricks_random_order": "Stack3RandomOrder",
    "stack_2_of_3_bricks_random_order": "Stack2Of3RandomOrder",
    "reassemble_3_bricks_fixed_order": "Reassemble3",
    "reassemble_5_bricks_random_order": "Reassemble5RandomOrder",
    "reach_top_left": "ReachTopLeft",
    "reach_top_right": "ReachTopRight",
    "reach_bottom_left": "ReachBottomLeft",
    "reach_bottom_right": "ReachBottomRight",
}

IDS = {task: f"jacokin/{name}-v0" for task, name in _NAMES.items()}
"""The id of each task."""
