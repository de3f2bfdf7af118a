"""Things to handle, and what to put them on. Read `primitive` first; all sizes are in `sizes.toml`.

primitive   boxes, spheres, cylinders
from_files  your own: a mesh, an MJCF file
brick       bricks that click together
pedestal    a pillar, and a cradle on its top
"""

from jacokin import lazy

__all__, __getattr__, __dir__ = lazy.door(__name__)
