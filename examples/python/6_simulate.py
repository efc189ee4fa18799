"""6. Run a scenario from Python, without a page and as fast as possible, and print its summary.

It needs no other program. `RunOptions(devkit=("127.0.0.1", 4567))` lets a driving script drive the vehicles.
"""

from autodrive.run import RunOptions, simulate

summary = simulate(RunOptions("boxes", duration=5.0, speed=None, seed=1, has_page=False))
print(f"{summary.ticks} ticks, {summary.real_time_factor:.0f} times real time")
for name, vehicle in summary.vehicles.items():
    print(f"{name}: {vehicle.distance:.2f} m, {vehicle.collisions} collisions")
