"""Where an arm can reach: maps of its workspace, and where to put its base. Read `building` first.

Everything public is imported from here.

building               `build`: a grid of positions times a set of orientations
samples, orientations  which poses a map is made of, and what makes most of them superfluous
chunk                  what is kept of each pose
folder, map            what is read from a map
bound                  how far from a reached sample the tool can be
placement              where to put the base for given targets
placement_picture      such a place from above and from the side
pictures, outlines     maps as PNG and as a page that turns them, with the arm and obstacles
"""

from jacokin import lazy

__all__, __getattr__, __dir__ = lazy.door(__name__, __file__)
