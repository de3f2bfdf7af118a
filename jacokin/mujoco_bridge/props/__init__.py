"""Things to handle, and what to put them on. Read `primitive` first; all sizes are in `sizes.toml`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from jacokin import lazy

if TYPE_CHECKING:
    from jacokin.mujoco_bridge.props.box import Box as Box
    from jacokin.mujoco_bridge.props.box import large_box as large_box
    from jacokin.mujoco_bridge.props.brick import Brick as Brick
    from jacokin.mujoco_bridge.props.free_prop import FreeProp as FreeProp
    from jacokin.mujoco_bridge.props.free_prop import FreePropObservables as FreePropObservables
    from jacokin.mujoco_bridge.props.pedestal import Cradle as Cradle
    from jacokin.mujoco_bridge.props.pedestal import Pedestal as Pedestal
    from jacokin.mujoco_bridge.props.primitive import Primitive as Primitive

__all__, __getattr__, __dir__ = lazy.door(
    __name__,
    {
        "jacokin.mujoco_bridge.props.box": ("Box", "large_box"),
        "jacokin.mujoco_bridge.props.brick": ("Brick",),
        "jacokin.mujoco_bridge.props.free_prop": ("FreeProp", "FreePropObservables"),
        "jacokin.mujoco_bridge.props.pedestal": ("Cradle", "Pedestal"),
        "jacokin.mujoco_bridge.props.primitive": ("Primitive",),
    },
)
