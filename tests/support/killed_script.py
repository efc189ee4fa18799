"""A devkit script of the standard library that a test kills: `python -S killed_script.py PORT STAGE`.

It serves simulators one after another and prints each stage that it reaches: `listening`, `connected` (TCP), `open`
(after half of the handshake), `commands` (after each telemetry message, which it answers).
"""

import base64
import hashlib
import json
import socket
import sys


def frame(text: str) -> bytes:
    data = text.encode()
    size = bytes([len(data)]) if len(data) < 126 else b"\x7e" + len(data).to_bytes(2, "big")
    return b"\x81" + size + data


def serve(client: socket.socket) -> None:
    print("connected", flush=True)
    request = b""
    while b"\r\n\r\n" not in request:
        request += client.recv(65536)
    key = next(line for line in request.split(b"\r\n") if line.lower().startswith(b"sec-websocket-key")).split()[1]
    accept = base64.b64encode(hashlib.sha1(key + b"258EAFA5-E914-47DA-95CA-C5AB0DC85B11").digest()).decode()
    answer = (
        "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        f"Sec-WebSocket-Accept: {accept}\r\n\r\n"
    )
    client.sendall(answer[:50].encode())
    print("open", flush=True)
    client.sendall(answer[50:].encode())
    client.sendall(frame('0{"sid":"x","upgrades":[],"pingTimeout":20000,"pingInterval":25000}'))
    client.sendall(frame("40"))
    commands = frame("42" + json.dumps(["Bridge", {"V1 Throttle": "0.1", "V1 Steering": "0"}]))
    while client.recv(2**20):
        client.sendall(commands)
        print("commands", flush=True)


with socket.create_server(("127.0.0.1", int(sys.argv[1]))) as listener:
    print("listening", flush=True)
    while True:
        serve(listener.accept()[0])
