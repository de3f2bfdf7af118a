"""The action FollowJointTrajectory of ROS 1."""
