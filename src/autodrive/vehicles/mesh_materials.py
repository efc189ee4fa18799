"""Of what the car is made: linear colours, by eye."""

from autodrive.render.asset import Material

ACRYLIC = Material("acrylic", (0.016, 0.050, 0.125), roughness=0.28)
BRASS = Material("brass", (0.80, 0.58, 0.24), roughness=0.35, metallic=1.0)
STEEL = Material("steel", (0.60, 0.61, 0.63), roughness=0.35, metallic=1.0)
ALUMINIUM = Material("aluminium", (0.74, 0.75, 0.76), roughness=0.45, metallic=1.0)
RUBBER = Material("rubber", (0.020, 0.020, 0.022), roughness=0.9)
RIM = Material("rim", (0.80, 0.50, 0.02), roughness=0.5)
MOTOR = Material("motor", (0.84, 0.55, 0.03), roughness=0.5)
BLACK = Material("black", (0.014, 0.014, 0.016), roughness=0.42)
MATT_BLACK = Material("matt_black", (0.018, 0.018, 0.020), roughness=0.8)
SERVO = Material("servo", (0.015, 0.07, 0.30), roughness=0.4)
WHITE = Material("white", (0.78, 0.78, 0.76), roughness=0.55)
BATTERY = Material("battery", (0.015, 0.06, 0.26), roughness=0.4)
BOARD_GREEN = Material("board_green", (0.010, 0.13, 0.055), roughness=0.5)
BOARD_BLUE = Material("board_blue", (0.010, 0.06, 0.22), roughness=0.5)
BOARD_RED = Material("board_red", (0.30, 0.015, 0.015), roughness=0.5)
GLASS = Material("glass", (0.008, 0.008, 0.014), roughness=0.12)
WIRE_RED = Material("wire_red", (0.55, 0.02, 0.015), roughness=0.6)
WIRE_ORANGE = Material("wire_orange", (0.70, 0.22, 0.02), roughness=0.6)
STRAP = Material("strap", (0.03, 0.03, 0.034), roughness=0.9)
RIBBON = Material("ribbon", (0.62, 0.62, 0.60), roughness=0.7)
