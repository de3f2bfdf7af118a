"""What an arm did, from recordings of ROS: .bag of ROS 1, .mcap and .db3 of ROS 2 (extra `logs`). Read `log` first.

Everything public is imported from here.

log            `Log`: joints, commands and poses of a recording, by the names of their topics; where the arm stands
               still, for `calibrate`; joints smoothed and differentiated, for `identify_arm`
messages       what messages say in radians and metres, and which are read
bag            the files themselves; the only part that imports rosbags
motion_files   motions in files of this package, of ROS and of Kinova's driver
"""

from jacokin import lazy

__all__, __getattr__, __dir__ = lazy.door(__name__)
