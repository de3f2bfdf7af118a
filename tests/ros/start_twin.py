"""`jacokin` in the Python of ROS: the packages of the one that runs the tests come first, ROS's own fill up."""

from __future__ import annotations

import os
import site
import sys

there = list(sys.path)
for folder in os.environ["JACOKIN_PATHS"].split(os.pathsep):
    site.addsitedir(folder)  # what pip installed may be named in .pth files, as pinocchio is
added = [folder for folder in sys.path if folder not in there]
sys.path[:0] = added

from jacokin.cli.entry import main  # noqa: E402 - found there

main()
