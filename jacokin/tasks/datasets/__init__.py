"""Episodes as data that other libraries read. Read `recording` first.

recording  `record`, and what is kept of an episode
hdf5       files in the layout of robomimic, and data sets of Minari
lerobot    data sets of LeRobot: Parquet and videos
video      pictures to ffmpeg
replaying  `replay`: the same episodes again
"""
