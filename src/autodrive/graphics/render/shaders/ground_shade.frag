// How much sun and sky a vehicle takes from the ground z = 0, for scene.frag: only where it does. SUNLIT: by day.
layout(std140) uniform Frame { FRAME_FIELDS };
in vec3 place;
flat in int slot;
out vec4 pixel;
LIGHT_FORMULAS
#ifdef SUNLIT
SHADOW_FORMULAS
#endif
void main() {
    vec4 other = caster_place[slot];
    float lit = 1.0;
#ifdef SUNLIT
    lit = beside(slot, mat3(sun_from_map) * (place + vec3(0.0, 0.0, still_offset.w)));
#endif
    pixel = vec4(0.0, 0.0, 1.0 - lit, 1.0 - open_beside(other, place.xy - other.xy));
}
