"""Files of trajectories.

stored       what every trajectory that can be saved and loaded is
export       files for other programs: ROS, Kinova's driver
tables       CSV and NPZ
"""
