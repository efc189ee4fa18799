// A triangle that covers the viewport at the far plane, with the view direction of its corners.
layout(std140) uniform Frame { FRAME_FIELDS };
uniform mat4 map_from_clip;
out vec3 ray;
flat out vec3 low, high;
#ifdef AIR
flat out float haze;
#endif
TONE
void main() {
    vec2 corner = vec2((gl_VertexID & 1) * 4 - 1, (gl_VertexID >> 1) * 4 - 1);
    vec4 near = map_from_clip * vec4(corner, -1.0, 1.0), far = map_from_clip * vec4(corner, 1.0, 1.0);
    ray = far.xyz / far.w - near.xyz / near.w;
    low = shown(horizon.rgb * 0.31831 * exposure.x);
    high = shown(zenith.rgb * 0.31831 * exposure.x);
#ifdef AIR
    haze = exposure.z * 3.0;
#endif
    gl_Position = vec4(corner, 0.9999999, 1.0);
}
