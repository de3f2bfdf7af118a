"""Colours and light of dm_control's manipulation tasks, so that pictures look the same.

Numbers of `dm_control/manipulation/shared/arenas.py` and `dm_control/composer/arena.xml`, 1.0.50.
"""

from __future__ import annotations

import mujoco

_SKY_RGB = ((0.4, 0.6, 0.8), (0.0, 0.0, 0.0))  # at the zenith, at the nadir
_FLOOR_RGB = ((0.2, 0.3, 0.4), (0.1, 0.2, 0.3))  # of the two kinds of tiles
_EDGE_RGB = (0.8, 0.8, 0.8)  # of the lines between tiles
_REFLECTANCE = 0.2  # of the floor
_HEADLIGHT, _LAMP, _SHINE = 0.6, 0.7, 0.3  # intensities
_FLOOR_SHINE = 0.5  # MuJoCo's default


def set_looks(spec: mujoco.MjSpec) -> None:
    """Give an arena the looks of the reference."""
    spec.visual.headlight.diffuse = [_HEADLIGHT] * 3
    for texture in spec.textures:
        if texture.type == mujoco.mjtTexture.mjTEXTURE_SKYBOX:
            texture.rgb1, texture.rgb2 = _SKY_RGB
        elif texture.builtin == mujoco.mjtBuiltin.mjBUILTIN_CHECKER:
            texture.rgb1, texture.rgb2 = _FLOOR_RGB
            texture.mark, texture.markrgb = mujoco.mjtMark.mjMARK_EDGE, _EDGE_RGB
            floor = spec.material(texture.name)
            floor.reflectance, floor.specular = _REFLECTANCE, _FLOOR_SHINE
    for light in spec.lights:
        light.diffuse, light.specular = [_LAMP] * 3, [_SHINE] * 3
