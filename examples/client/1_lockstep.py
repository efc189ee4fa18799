"""1. Drive in lock-step: time advances only with each step, and each run gives exactly the same result.

Start the simulator, then this program in the same folder. From another folder, it needs the address or link of the
simulator as its argument.
"""

import sys

import autodrive

with autodrive.Client(*sys.argv[1:2]) as sim, sim.lockstep():
    frame = sim.reset(seed=1)
    for _ in range(300):
        y = frame.vehicles["V1"].ips.position[1]
        steering = -2.0 * (y - 0.2)  # follows the line y = 0.2 m
        frame = sim.step({"V1": autodrive.Command(throttle=0.5, steering=steering)})
    print(f"{frame.time:.2f} s: {frame.vehicles['V1'].ips.position.round(4)}")
