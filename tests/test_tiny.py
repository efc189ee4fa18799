"""The smallest use of the simulator: a world, a step, a Frame."""

import math

import autodrive

frame = autodrive.make("mini_map", seed=1).step({"V1": autodrive.Command(throttle=0.5)})


def test_a_step_gives_the_frame_one_tick_later() -> None:
    assert (frame.tick, frame.time) == (1, 0.01)
    assert frame.events == ()


def test_a_frame_has_the_values_that_the_readme_shows() -> None:
    vehicle = frame.vehicles["V1"]
    assert abs(vehicle.speed) < 0.01  # the dead time of the motors is not over
    assert vehicle.ips.position.shape == (3,)
    assert math.isclose(vehicle.ips.position[2], 0.0325, abs_tol=1e-6)  # radius of the wheels
    assert vehicle.lidar is not None  # from the start on


def test_the_car_drives_and_scans() -> None:
    world = autodrive.make("mini_map", seed=1)
    now = world.frame
    while now.time < 1.0:
        now = world.step({"V1": autodrive.Command(throttle=0.5, steering=0.2)})
    vehicle = now.vehicles["V1"]
    assert vehicle.speed > 0.1
    assert vehicle.pose.position[1] > 0.01  # positive steering turns left
    assert vehicle.lidar is not None
    assert vehicle.lidar.ranges.shape == (360,)
    assert vehicle.lidar.ranges.min() > 0.15
