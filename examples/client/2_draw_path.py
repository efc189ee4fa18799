"""Follows a circle in a running simulator, and draws the path, the point that it aims at, and its distance to the path.

Start a simulator with 'autodrive run plane', open its page, and run this program in the same folder. From another
folder, it needs the address of the simulator; another argument is the simulated time to drive [s]:

    python examples/client/2_draw_path.py 127.0.0.1:8730 20
"""

import sys

import numpy as np

import autodrive

RADIUS = 1.0
"""Of the circle [m]."""
AHEAD = 0.4
"""The vehicle aims at the point of the path that is this far ahead [rad along the circle]."""
WHEELBASE, STEERING_LIMIT = 0.14155, 0.5236
"""Of nigel [m, rad]."""


def main(address: str | None = None, seconds: str = "20") -> None:
    """Drive for that simulated time."""
    with autodrive.Client(address) as sim:
        sim.set_driving_mode("V1", is_autonomous=True)
        start = sim.frame.vehicles["V1"].pose.position[:2]
        heading = sim.frame.vehicles["V1"].imu.euler[2]
        centre = start + RADIUS * np.array([-np.sin(heading), np.cos(heading)])
        angles = np.linspace(0.0, 2.0 * np.pi, 101)
        sim.draw.path(centre + RADIUS * np.column_stack((np.cos(angles), np.sin(angles))), name="circle")
        end = sim.frame.time + float(seconds)
        for frame in sim.frames(rate=20.0):
            vehicle = frame.vehicles["V1"]
            from_centre = vehicle.pose.position[:2] - centre
            angle = np.arctan2(from_centre[1], from_centre[0]) + AHEAD
            goal = centre + RADIUS * np.array([np.cos(angle), np.sin(angle)])
            # pure pursuit (Coulter 1992): the arc through the rear axle and the goal
            way = goal - vehicle.pose.position[:2]
            bearing = np.arctan2(way[1], way[0]) - vehicle.imu.euler[2]
            steering = np.arctan(2.0 * WHEELBASE * np.sin(bearing) / np.hypot(*way))
            sim.drive("V1", throttle=0.5, steering=float(np.clip(steering / STEERING_LIMIT, -1.0, 1.0)))
            error = np.hypot(*from_centre) - RADIUS
            sim.draw.points([goal], name="goal", color="#ff2d55", size=0.05, lifetime=0.5)
            sim.draw.text(f"{1000 * error:+.0f} mm", (*goal, 0.15), lifetime=0.5)
            if frame.time >= end:
                break


if __name__ == "__main__":
    main(*sys.argv[1:])
