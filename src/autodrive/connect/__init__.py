"""Connections to other software: the page server, the devkit bridge, clients, devkit scripts, ROS."""
