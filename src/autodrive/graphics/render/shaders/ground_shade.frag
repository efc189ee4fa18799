// How much sun (SUNLIT) or sky a vehicle takes from the ground z = 0, for scene.frag: only where it does.
layout(std140) uniform Frame { FRAME_FIELDS };
in vec3 place;
flat in int slot;
out vec4 pixel;
#ifdef SUNLIT
SHADOW_FORMULAS
#else
LIGHT_FORMULAS
#endif
void main() {
#ifdef SUNLIT
    pixel = vec4(0.0, 0.0, 1.0 - beside(slot, mat3(sun_from_map) * (place + vec3(0.0, 0.0, still_offset.w))), 0.0);
#else
    pixel = vec4(0.0, 0.0, 0.0, 1.0 - open_beside(caster_place[slot], caster_tile[slot].zw, place.xy - caster_place[slot].xy));
#endif
}
