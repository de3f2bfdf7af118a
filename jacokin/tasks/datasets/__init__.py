"""Episodes as data that other libraries read. Read `recording` first.

recording  `record`, and what is kept of an episode while others are run; `replay`: the same episodes again
recorded   an episode, the checks of what was read from disk, and where a data set is written until it is complete
hdf5       files in the layout of robomimic, and data sets of Minari
lerobot    data sets of LeRobot: Parquet and videos
video      pictures to ffmpeg
"""
