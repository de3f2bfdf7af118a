"""Where an arm can reach: maps of its workspace, and where to put its base. Read `building` first.

Everything public is imported from here.

building      `build`: a grid of positions times a set of orientations; how far from a sample the tool can be
samples       which poses a map is made of, their orientations, and what makes most of them superfluous
folder, map   what is kept of each pose, and what is read from a map
placement     where to put the base for given targets, and its picture
pictures      maps as PNG and as a page that turns them, with the arm and obstacles
"""

from jacokin import lazy

__all__, __getattr__, __dir__ = lazy.door(__name__)
