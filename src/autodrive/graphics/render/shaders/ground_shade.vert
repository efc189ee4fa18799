// The ground that each vehicle dims, two triangles for each. SUNLIT: a rectangle around its shadow; else around itself.
layout(std140) uniform Frame { FRAME_FIELDS };
layout(std140) uniform Camera { mat4 clip_from_map; vec4 eye; };
#ifdef SUNLIT
uniform vec2 along;      // the level direction of the sunlight
uniform vec4 areas[16];  // corners of the rectangles: along it, to its left, opposite corner [m]
#else
uniform float reach;     // a vehicle dims the ground so far around it [m]
#endif
out vec3 place;
flat out int slot;
void main() {
    slot = gl_VertexID / 6;
    int corner = gl_VertexID - 6 * slot;
    bvec2 is_far = bvec2(corner == 1 || corner == 2 || corner == 4, corner == 2 || corner > 3);
#ifdef SUNLIT
    vec2 at = mix(areas[slot].xy, areas[slot].zw, vec2(is_far)), x = along, middle = vec2(0.0);
#else
    vec2 at = (caster_tile[slot].zw + reach) * mix(vec2(-1.0), vec2(1.0), vec2(is_far)), x = caster_place[slot].zw, middle = caster_place[slot].xy;
#endif
    place = vec3(middle + at.x * x + at.y * vec2(-x.y, x.x), 0.0);
    gl_Position = clip_from_map * vec4(place, 1.0);
}
