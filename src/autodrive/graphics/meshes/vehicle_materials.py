"""Materials of the vehicle: linear colours, estimated; metals are partly metallic because there are no reflections."""

from autodrive.graphics.assets.asset import Material

VEHICLE_MATERIALS = {
    material.name: material
    for material in (
        Material("acrylic", (0.016, 0.050, 0.125), roughness=0.28, is_paint=True),
        Material("brass", (0.82, 0.56, 0.20), roughness=0.35, metallic=0.5),
        Material("steel", (0.60, 0.61, 0.63), roughness=0.35, metallic=0.6),
        Material("aluminium", (0.74, 0.75, 0.76), roughness=0.45, metallic=0.6),
        Material("rubber", (0.020, 0.020, 0.022), roughness=0.9),
        Material("rim", (0.80, 0.50, 0.02), roughness=0.5),
        Material("motor", (0.84, 0.55, 0.03), roughness=0.5),
        Material("black", (0.014, 0.014, 0.016), roughness=0.42),
        Material("matt_black", (0.018, 0.018, 0.020), roughness=0.8),
        Material("servo", (0.015, 0.07, 0.30), roughness=0.4),
        Material("white", (0.78, 0.78, 0.76), roughness=0.55),
        Material("battery", (0.015, 0.06, 0.26), roughness=0.4),
        Material("board_green", (0.010, 0.13, 0.055), roughness=0.5),
        Material("board_blue", (0.010, 0.06, 0.22), roughness=0.5),
        Material("board_red", (0.30, 0.015, 0.015), roughness=0.5),
        Material("glass", (0.008, 0.008, 0.014), roughness=0.12),
        Material("lens_glass", (0.030, 0.012, 0.045), roughness=0.08),
        Material("wire_red", (0.55, 0.02, 0.015), roughness=0.6),
        Material("wire_orange", (0.70, 0.22, 0.02), roughness=0.6),
        Material("strap", (0.03, 0.03, 0.034), roughness=0.9),
        Material("carbon", (0.030, 0.031, 0.034), roughness=0.35),
        Material("shell", (0.62, 0.040, 0.020), roughness=0.30, is_paint=True),
        Material("spring", (0.62, 0.05, 0.03), roughness=0.45),
        Material("racer_rim", (0.70, 0.70, 0.71), roughness=0.45),
        Material("ribbon", (0.62, 0.62, 0.60), roughness=0.7),
    )
}
"""Materials of vehicles by name."""
