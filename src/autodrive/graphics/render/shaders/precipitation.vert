// Rain streaks and snow flakes in front of a camera, and drops on its lens: one quad for each six vertices. Streaks and
// flakes are at places that change with `seed`. They are lit by the sky and by headlights.
layout(std140) uniform Frame { FRAME_FIELDS };
uniform mat4 map_from_clip;
uniform int seed, flakes, drops, heads;  // from these numbers on, quads are snow, and drops; number of headlights
uniform vec4 shape;          // width of a pixel, height of a pixel, slant by the wind, time [s]
out vec2 at;
flat out float alpha, is_drop;
TONE
flat out vec3 colour;
vec3 place;
LIGHT_FORMULAS

uint mixed(uint x) {  // finaliser of MurmurHash3
    x ^= x >> 16u; x *= 0x85ebca6bu; x ^= x >> 13u; x *= 0xc2b2ae35u; return x ^ (x >> 16u);
}

void main() {
    int quad = gl_VertexID / 6, corner = gl_VertexID - 6 * quad;
    bool is_snow = quad >= flakes && quad < drops;
    is_drop = quad >= drops ? 1.0 : 0.0;
    uint own = uint(quad) * 0x9e3779b9u;
    // a drop stays on the lens for a few seconds, each at its own time
    uint h = mixed(own + mixed(quad < drops ? uint(seed) : uint(shape.w / 4.0 + float(mixed(own) & 0xffu) / 256.0)));
    vec2 center = vec2(float(h & 0xffffu), float(h >> 16u)) / 32767.5 - 1.0;
    h = mixed(h);
    float near = float(h & 0xffu) / 255.0;  // 0: far, thin and short
    at = vec2(corner == 1 || corner == 2 || corner == 4 ? 1.0 : -1.0, corner < 2 || corner == 3 ? -1.0 : 1.0);
    vec2 size = is_snow ? vec2(1.0 + 1.6 * near) * shape.xy : vec2(0.7 * shape.x, 0.04 + 0.10 * near);
    size = quad >= drops ? (4.0 + 7.0 * near) * shape.xy : size;
    vec2 off = at * size;
    off.x += quad >= flakes ? 0.0 : off.y * shape.z * 0.5;
    alpha = is_snow ? 0.85 : 0.16 + 0.16 * near;
    vec4 from = map_from_clip * vec4(center, -1.0, 1.0), to = map_from_clip * vec4(center, 1.0, 1.0);
    place = from.xyz / from.w + normalize(to.xyz / to.w - from.xyz / from.w) * mix(2.5, 0.4, near);
    vec3 arriving = 1.25 * horizon.rgb, l;
    for (int i = 0; i < heads; i++) arriving += 0.8 * lamp_light(i, l);
    colour = shown(0.31831 * arriving * exposure.x);
    gl_Position = vec4(center + off, -0.999, 1.0);
}
