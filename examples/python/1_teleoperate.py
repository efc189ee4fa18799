"""1. Drive with the keyboard in a terminal; shows the structure of a driving script.

A driving script is a server. Start it, then the simulator: autodrive run mini_map --devkit 127.0.0.1:4567
Keys: w, s throttle +, -; a, d left, right; q straight; e stop; x stop and straight; l headlights; Ctrl-C quits.
"""

import os
import select
import sys
import termios
import tty

from autodrive.devkit import Nigel, drive

PORT = int(sys.argv[1]) if len(sys.argv) > 1 else 4567

nigel = Nigel("V1", is_left_positive=True)
nigel.throttle_command = nigel.steering_command = 0.0
nigel.headlights_command = 0


def step():
    """Called for each message of the simulator, after `nigel` is updated; the commands are sent after it."""
    while select.select([sys.stdin], [], [], 0)[0]:
        press(os.read(sys.stdin.fileno(), 1).decode(errors="replace"))
    print(
        f"\rthrottle {nigel.throttle_command:+.1f}  steering {nigel.steering_command:+.1f}  "
        f"at ({nigel.position[0]:+.2f}, {nigel.position[1]:+.2f}) m ",
        end="",
        flush=True,
    )


def press(key):
    """Change the commands according to a key."""
    throttle_step = {"w": 0.2, "s": -0.2}.get(key, 0.0)
    steering_step = {"a": 0.2, "d": -0.2}.get(key, 0.0)
    nigel.throttle_command = 0.0 if key in "ex" else max(-1.0, min(1.0, nigel.throttle_command + throttle_step))
    nigel.steering_command = 0.0 if key in "qx" else max(-1.0, min(1.0, nigel.steering_command + steering_step))
    if key == "l":
        nigel.headlights_command = (nigel.headlights_command + 1) % 3


print(__doc__)
before = termios.tcgetattr(sys.stdin)
tty.setcbreak(sys.stdin)  # keys arrive without Enter
try:
    drive(step, nigel, port=PORT)
finally:
    print()
    termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)
