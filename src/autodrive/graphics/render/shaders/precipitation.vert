// Rain streaks and snow flakes in front of a camera: one quad for each six vertices, at places that change with `seed`.
layout(std140) uniform Frame { FRAME_FIELDS };
uniform int seed, flakes;    // flakes: from this number on, quads are snow
uniform vec4 shape;          // width of a pixel, height of a pixel, slant by the wind, unused
out vec2 at;
flat out float alpha;
TONE
flat out vec3 colour;

uint mixed(uint x) {  // finaliser of MurmurHash3
    x ^= x >> 16u; x *= 0x85ebca6bu; x ^= x >> 13u; x *= 0xc2b2ae35u; return x ^ (x >> 16u);
}

void main() {
    int quad = gl_VertexID / 6, corner = gl_VertexID - 6 * quad;
    uint h = mixed(uint(quad) * 0x9e3779b9u + mixed(uint(seed)));
    vec2 center = vec2(float(h & 0xffffu), float(h >> 16u)) / 32767.5 - 1.0;
    h = mixed(h);
    float near = float(h & 0xffu) / 255.0;  // 0: far, thin and short
    at = vec2(corner == 1 || corner == 2 || corner == 4 ? 1.0 : -1.0, corner < 2 || corner == 3 ? -1.0 : 1.0);
    bool is_snow = quad >= flakes;
    vec2 size = is_snow ? vec2(1.0 + 1.6 * near) * shape.xy : vec2(0.7 * shape.x, 0.04 + 0.10 * near);
    vec2 off = at * size;
    off.x += is_snow ? 0.0 : off.y * shape.z * 0.5;
    alpha = is_snow ? 0.85 : 0.16 + 0.16 * near;
    colour = shown(0.31831 * 1.25 * horizon.rgb * exposure.x);
    gl_Position = vec4(center + off, -0.999, 1.0);
}
