"""The bridge between an AutoDRIVE simulator and ROS 2, and two ways to drive by hand."""
