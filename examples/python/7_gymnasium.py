"""7. Drive a lap in a Gymnasium environment with a driver of three lines, and print the reward.

It needs the extra `envs`: pip install -e '.[envs]'.
"""

import math

import gymnasium

WHEELBASE, STEERING_LIMIT = 0.14155, math.radians(30.0)  # [m], [rad]

env = gymnasium.make("autodrive:NigelLaneKeeping-v0", max_episode_steps=1000)
observation, _ = env.reset(seed=1)
total, is_success, is_over = 0.0, False, False
while not (is_over or is_success):
    x, y = observation[8:10]  # the lane 0.4 m ahead, in the vehicle frame
    curvature = 2.0 * y / (x * x + y * y)  # of the circle to that point (pure pursuit)
    action = [1.0, math.atan(WHEELBASE * curvature) / STEERING_LIMIT]
    observation, reward, is_terminated, is_truncated, info = env.step(action)
    total, is_success, is_over = total + float(reward), info["is_success"], is_terminated or is_truncated
print(f"lap {'complete' if is_success else 'not complete'}, reward {total:.1f} m")
env.close()
