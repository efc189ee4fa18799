"""A script that waits before it answers each telemetry message, and prints a line for each step.

It wants a sign of life every second, as Engine.IO of either version understands that.
"""

# Runs in the environment of a devkit server.
# pyright: reportMissingImports=false, reportArgumentType=false

import sys
import time

import eventlet
import eventlet.wsgi
import socketio

port, thinking_time = int(sys.argv[sys.argv.index("--port") + 1]), float(sys.argv[sys.argv.index("--think") + 1])
sio = socketio.Server(async_mode="eventlet", ping_interval=1, ping_timeout=5)


@sio.on("disconnect")
def disconnect(sid, *reason):
    print("disconnect", flush=True)


@sio.on("Bridge")
def bridge(sid, data):
    print("telemetry", flush=True)
    time.sleep(thinking_time)
    sio.emit("Bridge", data={"V1 Throttle": "1", "V1 Steering": "0", "V1 Reset": "False"})


eventlet.wsgi.server(eventlet.listen(("127.0.0.1", port)), socketio.Middleware(sio), log_output=False)
