"""jacokin in the Python of ROS: the packages of the one that runs the tests come first, ROS's own fill up.

python beside_ros.py jacokin WORDS...
python beside_ros.py SCRIPT WORDS...
"""

from __future__ import annotations

import os
import runpy
import site
import sys

there = list(sys.path)
for folder in os.environ["JACOKIN_PATHS"].split(os.pathsep):
    site.addsitedir(folder)  # what pip installed may be named in .pth files, as pinocchio is
sys.path[:0] = [folder for folder in sys.path if folder not in there]
what = sys.argv.pop(1)
if what == "jacokin":
    from jacokin.__main__ import main

    main()
else:
    runpy.run_path(what, run_name="__main__")
