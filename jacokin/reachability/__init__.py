"""Where an arm can reach: maps of its workspace, and where to put its base. Everything public is imported from here.

building        `build`: a grid of positions times a set of orientations; read this file first
sampling        which poses a map is made of, and what makes most of them superfluous
answers         what is kept of each pose
map, loading    what is read from a map
placement       where to put the base for given targets
pictures, page  maps as PNG and as a page that turns them
"""

from jacokin import lazy

__all__, __getattr__, __dir__ = lazy.door(__name__, __file__)
