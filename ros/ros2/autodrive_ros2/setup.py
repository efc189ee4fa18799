"""Installs the bridge as a ROS 2 package."""

from glob import glob

from setuptools import setup

NAME = "autodrive_ros2"

setup(
    name=NAME,
    version="1.0.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", glob("launch/*.launch.py")),
        (f"share/{NAME}/config", glob("config/*")),
        (f"share/{NAME}/rviz", glob("rviz/*.rviz")),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="AutoDRIVE Simulator developers",
    maintainer_email="autodrive@example.org",
    description="Bridge between an AutoDRIVE simulator and ROS 2",
    license="BSD-2-Clause",
    entry_points={
        "console_scripts": [
            f"autodrive_bridge = {NAME}.bridge:main",
            f"teleop_keyboard = {NAME}.teleop_keyboard:main",
            f"teleop_joy = {NAME}.teleop_joy:main",
        ]
    },
)
